// The page of `calib-inspect live`. It draws the points itself, so that they follow the hand at once; what the cascade
// answers comes over a websocket.
const at = (id) => document.getElementById(id);
const AXES = [
  { name: "roll", unit: "°", keys: "qa", digits: 3 },
  { name: "pitch", unit: "°", keys: "ws", digits: 3 },
  { name: "yaw", unit: "°", keys: "ed", digits: 3 },
  { name: "x", unit: "m", keys: "rf", digits: 4, hint: "right" },
  { name: "y", unit: "m", keys: "tg", digits: 4, hint: "down" },
  { name: "z", unit: "m", keys: "yh", digits: 4, hint: "ahead" },
];
const STEPS = { coarse: [0.25, 0.02], fine: [0.02, 0.002] }; // degrees, metres
const STAGE_MILLISECONDS = 350; // an answer is shown stage by stage

let hello = null, state = null, scan = null, image = null, loaded = -1;
let pose = [0, 0, 0, 0, 0, 0];
let held = null; // the pose under the hand, until the server has it: its other messages must not move the sliders
let tries = [], current = -1, step = 0, walking = 0, asked = null;
const timing = { draws: 0, draw: 0, answer: 0 }; // milliseconds of the last draw and the last answer
window.live = { timing, get pose() { return pose; }, get tries() { return tries; }, get shown() { return [current, step]; } };

// ---- rigid transforms, 4x4 row by row -----------------------------------------------------------------------------

function multiply(a, b) {
  const c = new Array(16).fill(0);
  for (let i = 0; i < 4; i++) for (let j = 0; j < 4; j++) for (let k = 0; k < 4; k++) c[4 * i + j] += a[4 * i + k] * b[4 * k + j];
  return c;
}

function extrinsicOf([roll, pitch, yaw, x, y, z]) {
  const [a, b, c] = [pitch, yaw, roll].map((angle) => (angle * Math.PI) / 180);
  const [ca, sa, cb, sb, cc, sc] = [Math.cos(a), Math.sin(a), Math.cos(b), Math.sin(b), Math.cos(c), Math.sin(c)];
  const change = [
    cb * cc, -cb * sc, sb, x,
    ca * sc + sa * sb * cc, ca * cc - sa * sb * sc, -sa * cb, y,
    sa * sc - ca * sb * cc, sa * cc + ca * sb * sc, ca * cb, z,
    0, 0, 0, 1,
  ];
  return multiply(change, state.frame.guess);
}

function off(one, other) {
  if (!other) return null;
  let trace = 0;
  for (let i = 0; i < 3; i++) for (let k = 0; k < 3; k++) trace += one[4 * i + k] * other[4 * i + k];
  const turned = (Math.acos(Math.min(1, Math.max(-1, (trace - 1) / 2))) * 180) / Math.PI;
  return [turned, 100 * Math.hypot(one[3] - other[3], one[7] - other[7], one[11] - other[11])];
}

const figures = (error) => (error ? `${error[0].toFixed(2)}°, ${error[1].toFixed(1)} cm` : "");

// ---- drawing ------------------------------------------------------------------------------------------------------

const canvas = at("canvas"), context = canvas.getContext("2d");
let buffer = null, pixels = null, depths = null, layer = null, due = false;

function shownExtrinsic() {
  if (step === "reference") return state.frame.reference;
  if (current < 0 || step === 0 || !tries[current].steps[step]) return extrinsicOf(pose);
  return tries[current].steps[step].extrinsic;
}

function redraw() {
  if (due) return;
  due = true;
  requestAnimationFrame(() => {
    due = false;
    const began = performance.now();
    draw();
    timing.draw = performance.now() - began;
    timing.draws += 1;
  });
}

function fit() {
  const [width, height] = state.frame.size;
  const room = at("picture").clientWidth, high = Math.max(160, innerHeight * 0.5);
  const scale = Math.min(room / width, high / height);
  const density = Math.min(devicePixelRatio || 1, 2);
  canvas.style.width = `${Math.round(width * scale)}px`;
  canvas.style.height = `${Math.round(height * scale)}px`;
  canvas.width = Math.round(width * scale * density);
  canvas.height = Math.round(height * scale * density);
  layer = new OffscreenCanvas(canvas.width, canvas.height);
  buffer = new ImageData(canvas.width, canvas.height);
  pixels = new Uint32Array(buffer.data.buffer);
  depths = new Float32Array(canvas.width * canvas.height);
}

const rgba = (r, g, b) => (255 << 24) | (b << 16) | (g << 8) | r;

function colours() {
  const { turbo, viridis, near, far, edge, rest, worst } = hello.palettes;
  const lut = (table, index) => rgba(table[3 * index], table[3 * index + 1], table[3 * index + 2]);
  const turbos = Array.from({ length: 256 }, (_, i) => lut(turbo, i)), viridises = Array.from({ length: 256 }, (_, i) => lut(viridis, i));
  const span = Math.log(far / near), kind = at("color").value;
  if (kind === "intensity") return (i) => viridises[scan.intensity[i]];
  if (kind === "edge") return (i) => (scan.edge[i] ? rgba(...edge) : rgba(...rest));
  if (kind === "error" && scan.truth)
    return (i, z, u, v) => {
      const du = u - scan.truth[2 * i], dv = v - scan.truth[2 * i + 1], d = Math.hypot(du, dv);
      return turbos[Math.round(25 + 215 * Math.min(1, (Number.isFinite(d) ? d : worst) / worst))];
    };
  return (i, z) => turbos[Math.round(245 - 235 * Math.min(1, Math.max(0, Math.log(z / near) / span)))];
}

function project(m, i, [fx, fy, cx, cy]) {
  const x = scan.xyz[3 * i], y = scan.xyz[3 * i + 1], z = scan.xyz[3 * i + 2];
  const depth = m[8] * x + m[9] * y + m[10] * z + m[11];
  if (depth < 0.1) return null;
  return [(fx * (m[0] * x + m[1] * y + m[2] * z + m[3])) / depth + cx, (fy * (m[4] * x + m[5] * y + m[6] * z + m[7])) / depth + cy, depth];
}

function draw() {
  if (!scan || !image || !pixels) return;
  const m = shownExtrinsic(), camera = state.frame.camera, width = canvas.width, height = canvas.height;
  const scale = width / state.frame.size[0], size = Number(at("size").value) * Math.max(1, Math.round(width / 1000)), half = size >> 1;
  const colour = colours();
  pixels.fill(0);
  depths.fill(Infinity);
  for (let i = 0; i < scan.count; i++) {
    const seen = project(m, i, camera);
    if (!seen) continue;
    const left = Math.round((seen[0] + 0.5) * scale) - half, top = Math.round((seen[1] + 0.5) * scale) - half;
    if (left < 0 || top < 0 || left + size > width || top + size > height) continue;
    const paint = colour(i, seen[2], seen[0], seen[1]), depth = seen[2];
    for (let y = top; y < top + size; y++)
      for (let at = y * width + left, end = at + size; at < end; at++)
        if (depth < depths[at]) {
          depths[at] = depth;
          pixels[at] = paint;
        }
  }
  layer.getContext("2d").putImageData(buffer, 0, 0);
  context.globalAlpha = 1;
  context.fillStyle = "#18191e";
  context.fillRect(0, 0, width, height);
  context.globalAlpha = 0.7;
  context.drawImage(image, 0, 0, width, height);
  context.globalAlpha = 1;
  context.drawImage(layer, 0, 0);
  caption(m);
}

function caption(m) {
  const known = tries[current], name = step === "reference" ? "reference" : step === 0 || !known ? "mine" : known.steps[step].name;
  const error = step === "reference" ? null : off(m, state.frame.reference);
  at("caption").textContent = error ? `${name}: ${figures(error)} off` : name;
}

function legend() {
  const { turbo, viridis, near, far, worst, edge, rest } = hello.palettes, kind = at("color").value;
  const css = (table, i) => `rgb(${table.slice(3 * i, 3 * i + 3).join()})`;
  const ramp = (name, from, to) => `linear-gradient(90deg, ${[0, 1, 2, 3, 4, 5, 6].map((k) => css(name, Math.round(from + ((to - from) * k) / 6))).join()})`;
  const bar = (gradient, low, high) => `${low} <i style="width:160px;background:${gradient}"></i> ${high}`;
  at("legend").innerHTML = {
    depth: bar(ramp(turbo, 245, 10), `${near} m`, `${far} m`),
    intensity: bar(ramp(viridis, 0, 255), "weak return", "strong"),
    edge: `<i style="background:rgb(${edge.join()})"></i>depth edges: they must lie on outlines <i style="background:rgb(${rest.join()})"></i>others`,
    error: bar(ramp(turbo, 25, 240), "in place", `${worst} px off or more`),
  }[kind];
}

async function load() {
  const position = state.frame.position;
  loaded = position;
  const [blob, bytes] = await Promise.all([
    fetch(`picture.jpg?${position}`).then((answer) => answer.blob()),
    fetch(`points.bin?${position}`).then((answer) => answer.arrayBuffer()),
  ]);
  if (loaded !== position) return;
  image = await createImageBitmap(blob);
  const count = new Uint32Array(bytes, 0, 1)[0];
  scan = {
    count,
    xyz: new Float32Array(bytes, 4, 3 * count),
    intensity: new Uint8Array(bytes, 4 + 12 * count, count),
    edge: new Uint8Array(bytes, 4 + 13 * count, count),
    truth: null,
  };
  if (state.frame.reference) {
    scan.truth = new Float32Array(2 * count).fill(NaN);
    for (let i = 0; i < count; i++) {
      const seen = project(state.frame.reference, i, state.frame.camera);
      if (seen) scan.truth.set(seen.slice(0, 2), 2 * i);
    }
  }
  fit();
  redraw();
}

// ---- the sliders --------------------------------------------------------------------------------------------------

function makeSliders() {
  for (const [i, axis] of AXES.entries()) {
    const range = hello.range[i < 3 ? 0 : 1];
    const row = document.createElement("template");
    row.innerHTML = `<label for="range-${axis.name}">${axis.name} ${axis.hint ? `<small>(${axis.hint})</small> ` : ""}<kbd>${axis.keys[0]} ${axis.keys[1]}</kbd></label>
      <input type="range" id="range-${axis.name}" min="${-range}" max="${range}" step="any" value="0">
      <input type="number" id="number-${axis.name}" aria-label="${axis.name}" step="any" value="0"><span>${axis.unit}</span>`;
    at("sliders").append(row.content);
    const slider = at(`range-${axis.name}`), field = at(`number-${axis.name}`);
    slider.addEventListener("input", () => move(i, Number(slider.value)));
    slider.addEventListener("change", release);
    field.addEventListener("change", () => {
      if (!Number.isFinite(field.valueAsNumber)) return showPose();
      move(i, field.valueAsNumber);
      release();
    });
  }
  at("sliders").addEventListener("submit", (event) => event.preventDefault());
}

function move(axis, value) {
  held = pose = pose.with(axis, value);
  clearInterval(walking);
  step = 0;
  showPose(axis);
  showSteps();
  redraw();
}

function showPose() {
  for (const [i, axis] of AXES.entries()) {
    at(`range-${axis.name}`).value = pose[i];
    at(`number-${axis.name}`).value = pose[i].toFixed(axis.digits);
  }
}

function release() {
  asked = performance.now();
  send({ do: "pose", pose, run: at("auto").checked });
}

let released = 0;
document.addEventListener("keydown", (event) => {
  if (event.target.matches("input[type=number], select") || at("sure").open) return;
  const key = event.key.toLowerCase();
  if (event.ctrlKey || event.metaKey) {
    if (key === "z") {
      event.preventDefault();
      send({ do: event.shiftKey ? "redo" : "undo", run: at("auto").checked });
    }
    return;
  }
  if (event.altKey) return;
  const axis = AXES.findIndex(({ keys }) => keys.includes(key));
  if (axis >= 0) {
    event.preventDefault();
    const size = STEPS[at("steps-size").value][axis < 3 ? 0 : 1] * (event.shiftKey ? 0.1 : 1);
    move(axis, pose[axis] + (AXES[axis].keys[0] === key ? size : -size));
    clearTimeout(released);
    released = setTimeout(release, 300); // as long as keys come, nobody has let go
  } else if (key === "enter" && !event.target.matches("button")) send({ do: "run" });
  else if (key === "arrowleft" && !event.target.matches("input")) to(-1);
  else if (key === "arrowright" && !event.target.matches("input")) to(1);
});

// ---- the answer ---------------------------------------------------------------------------------------------------

function show(number, at_) {
  clearInterval(walking);
  current = number;
  step = at_;
  showAnswer();
  redraw();
}

function walk(number) {
  show(number, 0);
  const last = tries[number].steps.length - 1;
  walking = setInterval(() => {
    step = Math.min(last, step + 1);
    if (step === last) clearInterval(walking);
    showSteps();
    redraw();
  }, STAGE_MILLISECONDS);
}

function showAnswer() {
  const answer = tries[current];
  at("word").className = "";
  if (answer) {
    const word = answer.verdict ? answer.verdict.word : "no verdict";
    at("word").textContent = word[0].toUpperCase() + word.slice(1);
    at("word").className = word.split(" ")[0];
    const sure = answer.sigma ? ` Sure to ${answer.sigma[0].toFixed(2)}° / ${answer.sigma[1].toFixed(1)} cm (1σ).` : "";
    at("reason").textContent = `${answer.verdict ? answer.verdict.text : ""}${sure} Try ${answer.number}, frame ${answer.frame}: ${answer.title}, ${answer.milliseconds} ms.`;
  }
  showSteps();
  at("tries").replaceChildren(...tries.toReversed().slice(0, 200).map((one) => {
    const item = document.createElement("li"), button = document.createElement("button");
    const last = one.steps.at(-1);
    button.textContent = `${one.number}: frame ${one.frame}, ${one.title}: ${one.verdict ? one.verdict.word : "no verdict"}${last.error ? `, ${figures(last.error)} off` : ""}`;
    if (one.number === current) button.setAttribute("aria-current", "true");
    button.onclick = () => show(one.number, one.steps.length - 1);
    item.append(button);
    return item;
  }));
}

function showSteps() {
  const answer = tries[current], known = Boolean(state.frame.reference);
  const choices = [[0, "Mine"], ...(answer ? answer.steps.slice(1).map((one, i) => [i + 1, `After ${one.name}`]) : []), ...(known ? [["reference", "Reference"]] : [])];
  // buttons stay while their names do: one that is replaced between press and release never hears the click
  const names = choices.map(([, name]) => name), buttons = at("shown").children;
  if (names.join() !== Array.from(buttons, (button) => button.textContent).join())
    at("shown").replaceChildren(...names.map((name) => {
      const button = document.createElement("button");
      button.setAttribute("role", "radio");
      button.textContent = name;
      return button;
    }));
  for (const [i, [value]] of choices.entries()) {
    buttons[i].setAttribute("aria-checked", String(value === step));
    buttons[i].onclick = () => show(current, value);
  }
  const rows = answer ? answer.steps : [];
  at("steps").innerHTML = rows.length ? `<tr><th></th>${rows[0].error ? "<th>off by</th>" : ""}<th>moved by</th></tr>` : "";
  for (const [i, one] of rows.entries()) {
    const row = at("steps").insertRow();
    if (i === step) row.setAttribute("aria-current", "true");
    row.insertCell().textContent = i ? `after ${one.name}` : "from";
    if (one.error) row.insertCell().textContent = figures(one.error);
    row.insertCell().textContent = i ? figures(one.moved) : "–";
  }
  // a verdict is on what a try found: beside a pose that nothing has judged it must not look like one on that
  at("answer").classList.toggle("past", Boolean(answer) && (step === 0 || step === "reference"));
  at("take").disabled = !(answer && step !== 0 && step !== "reference");
}

// ---- talking ------------------------------------------------------------------------------------------------------

let socket = null;
const send = (message) => socket.readyState === WebSocket.OPEN && socket.send(JSON.stringify(message));

function say(text, problem = false) {
  at("said").textContent = text;
  at("said").className = problem ? "problem" : "";
  clearTimeout(say.timer);
  say.timer = setTimeout(() => (at("said").textContent = ""), problem ? 12000 : 5000);
}

function setState(next) {
  state = next;
  if (held && held.every((value, i) => value === state.pose[i])) held = null;
  pose = held ?? state.pose;
  showPose();
  at("frame").textContent = `frame ${state.frame.index} (${state.frame.position + 1} of ${state.frame.count})`;
  at("busy").textContent = state.busy ? `${state.busy}${state.progress ? ` ${state.progress[0]}/${state.progress[1]}` : "…"}` : "";
  at("stop").hidden = !state.busy || !state.progress;
  at("undo").disabled = !state.can_undo;
  at("redo").disabled = !state.can_redo;
  at("reference").disabled = !state.frame.reference;
  at("color").querySelector("[value=error]").disabled = !state.frame.reference;
  for (const id of ["previous", "next", "worst", "drive"]) at(id).disabled = state.frame.count < 2;
  if (loaded !== state.frame.position) load();
  else redraw();
}

const heard = {
  hello(message) {
    hello = message;
    at("name").textContent = message.known ? `${message.name}, ${message.known}` : message.name;
    at("accept").title = `Writes ${message.target}`;
    tries = message.tries;
    if (!at("sliders").children.length) {
      makeSliders();
      at("single").replaceChildren(...message.stages.map((number) => {
        const button = document.createElement("button");
        button.textContent = `Stage ${number}`;
        button.onclick = () => send({ do: "run", stage: number });
        return button;
      }));
    }
    loaded = -1;
    setState(message.state);
    show(tries.length - 1, tries.length ? tries.at(-1).steps.length - 1 : 0);
    legend();
  },
  state(message) {
    const moved = message.pose.some((value, i) => value !== pose[i]);
    setState(message);
    if (moved && !held && step !== "reference") step = 0;
    showSteps();
    redraw();
  },
  try(message) {
    tries.push(message);
    if (asked !== null) timing.answer = performance.now() - asked;
    asked = null;
    walk(message.number);
  },
  said: (message) => say(message.text),
  problem(message) {
    held = null;
    say(message.text, true);
  },
  "sure?"(message) {
    at("sure-text").textContent = message.text;
    at("sure").returnValue = "no";
    at("sure").onclose = () => at("sure").returnValue === "yes" && send(message.again);
    at("sure").showModal();
  },
};

function connect() {
  socket = new WebSocket(new URL("control", location.href).href.replace(/^http/, "ws"));
  socket.onmessage = ({ data }) => {
    const message = JSON.parse(data);
    heard[message.is](message);
  };
  socket.onclose = () => {
    say("The connection to calib-inspect is gone; trying again. Does it still run?", true);
    setTimeout(connect, 2000);
  };
}

const to = (by) => send({ do: "frame", position: state.frame.position + by, run: at("auto").checked });
const run = () => at("auto").checked;
at("previous").onclick = () => to(-1);
at("next").onclick = () => to(1);
at("worst").onclick = () => send({ do: "worst" });
at("stop").onclick = () => send({ do: "stop" });
at("undo").onclick = () => send({ do: "undo", run: run() });
at("redo").onclick = () => send({ do: "redo", run: run() });
at("guess").onclick = () => send({ do: "guess", run: run() });
at("reference").onclick = () => send({ do: "reference", run: run() });
at("random").onclick = () => send({ do: "random", run: run() });
at("run").onclick = () => send({ do: "run" });
at("drive").onclick = () => send({ do: "drive" });
at("take").onclick = () => send({ do: "take", try: current, step });
at("accept").onclick = () => send({ do: "accept", ...(current < 0 || step === 0 || step === "reference" ? {} : { try: current, step }) });
at("color").onchange = () => { legend(); redraw(); };
at("size").oninput = redraw;
addEventListener("resize", () => { if (state) { fit(); redraw(); } });
canvas.addEventListener("click", (event) => {
  if (current < 0) return say("Run the cascade first: then a click shows why a point was matched where it was.");
  const box = canvas.getBoundingClientRect(), [width, height] = state.frame.size;
  const pixel = [((event.clientX - box.left) / box.width) * width - 0.5, ((event.clientY - box.top) / box.height) * height - 0.5];
  const under = step === "reference" ? { under: state.frame.reference } : step === 0 ? { under: extrinsicOf(pose) } : { step };
  send({ do: "look", try: current, pixel, ...under });
});
addEventListener("message", ({ data, origin }) => {
  if (origin === new URL(at("viewer").src).origin && data.viewer) clickInViewer(data.viewer);
});

// A click on an overlay in the viewer is a click on the picture: its selection names the overlay and the pixel.
function clickInViewer(event) {
  if (event.type !== "selection_change" || current < 0) return;
  for (const item of event.items ?? []) {
    const overlay = /^\/?overlay\/(miscalibrated|corrected|current|stage_(\d))/.exec(item.entity_path ?? "");
    if (!overlay || !item.position) continue;
    const steps = tries[current].steps;
    const found = overlay[2] ? steps.findIndex((one) => one.name === `stage ${overlay[2]}`) : overlay[1] === "miscalibrated" ? 0 : steps.length - 1;
    send({ do: "look", try: current, step: Math.max(0, found), pixel: [item.position[0] - 0.5, item.position[1] - 0.5] });
    return;
  }
}

// Under this machine's other name the viewer is another site, so that the browser gives it a process of its own: without
// a graphics card it takes seconds a picture, and the points would wait for it.
const other = new URL("viewer/", location.href);
other.hostname = location.hostname === "localhost" ? "127.0.0.1" : "localhost";
other.searchParams.set("page", location.origin);
at("viewer").src = other.href;
connect();
