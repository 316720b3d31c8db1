// The page of `calib-inspect live`: requests of its buttons and keys, and what is done with the answers, which come
// over a websocket.
import { show, showSteps, walk } from "./answer.js";
import { at, live, shownTry } from "./workspace.js";
import { legend } from "./colours.js";
import { fit, forgetFrame, pixelUnder, redraw, showFrame } from "./picture.js";
import { extrinsicOf } from "./poses.js";
import { answered, makeSliders, release, showPose, turned } from "./sliders.js";
import { connect, say, send } from "./wire.js";

// ---- answers ------------------------------------------------------------------------------------------------------

const heard = {
  hello(message) {
    live.hello = message;
    live.tries = message.tries;
    at("name").textContent = message.known ? `${message.name}, ${message.known}` : message.name;
    at("accept").title = `Writes ${message.target}`;
    at("drive").hidden = !message.drives;
    at("run").textContent = message.stages.length ? "Run all stages" : "Run";
    if (!at("sliders").children.length) {
      makeSliders(message.range);
      at("single").replaceChildren(...message.stages.map(stageButton));
    }
    forgetFrame();
    setState(message.state);
    show(live.tries.length - 1, live.tries.length ? live.tries.at(-1).steps.length - 1 : 0);
    showLegend();
    if (live.held) release(); // the connection was lost before the server had the pose
  },
  state(message) {
    const moved = message.pose.some((value, i) => value !== live.pose[i]);
    setState(message);
    if (moved && !live.held && live.step !== "reference") live.step = 0;
    showSteps();
    redraw();
  },
  try(message) {
    live.tries[message.number] = message;
    answered();
    walk(message.number);
  },
  said(message) {
    if (message.ring) live.ring = message.ring;
    say(message.text);
    redraw();
  },
  problem(message) {
    live.held = null;
    say(message.text, true);
  },
  "sure?"(message) {
    at("sure-text").textContent = message.text;
    at("sure").returnValue = "no";
    at("sure").onclose = () => at("sure").returnValue === "yes" && send(message.again);
    at("sure").showModal();
  },
};

function setState(state) {
  live.state = state;
  if (live.held?.every((value, i) => value === state.pose[i])) live.held = null;
  live.pose = live.held ?? state.pose;
  showPose();
  at("frame").textContent = `frame ${state.frame.index} (${state.frame.position + 1} of ${state.frame.count})`;
  at("busy").textContent = state.busy ? `${state.busy}${state.progress ? ` ${state.progress[0]}/${state.progress[1]}` : "…"}` : "";
  at("stop").hidden = !state.busy || !state.progress;
  at("undo").disabled = !state.can_undo;
  at("redo").disabled = !state.can_redo;
  at("reference").disabled = !state.frame.reference;
  at("color").querySelector("[value=error]").disabled = !state.frame.reference;
  for (const id of ["previous", "next", "worst", "drive"]) at(id).disabled = state.frame.count < 2;
  showFrame();
}

function stageButton(number) {
  const button = document.createElement("button");
  button.textContent = `Stage ${number}`;
  button.onclick = () => send({ do: "run", stage: number });
  return button;
}

const showLegend = () => {
  at("legend").innerHTML = legend(live.hello.palettes, at("color").value);
};

// ---- requests -----------------------------------------------------------------------------------------------------

const run = () => at("auto").checked;
const to = (by) => send({ do: "frame", position: live.state.frame.position + by, run: run() });
const answerShown = () => live.current >= 0 && live.step !== 0 && live.step !== "reference";
const shown = () => ({ try: live.current, step: live.step });

at("previous").onclick = () => to(-1);
at("next").onclick = () => to(1);
for (const name of ["worst", "stop", "drive"]) at(name).onclick = () => send({ do: name });
for (const name of ["undo", "redo", "guess", "reference", "random"]) at(name).onclick = () => send({ do: name, run: run() });
at("run").onclick = () => send({ do: "run" });
at("take").onclick = () => send({ do: "take", ...shown() });
at("accept").onclick = () => send({ do: "accept", ...(answerShown() ? shown() : {}) });
at("color").onchange = () => { showLegend(); redraw(); };
at("size").oninput = redraw;
addEventListener("resize", () => { if (live.state) { fit(); redraw(); } });

document.addEventListener("keydown", (event) => {
  if (event.target.matches("input[type=number], select") || at("sure").open) return;
  const key = event.key.toLowerCase();
  if (event.ctrlKey || event.metaKey) {
    if (key === "z") {
      event.preventDefault();
      send({ do: event.shiftKey ? "redo" : "undo", run: run() });
    }
    return;
  }
  if (event.altKey) return;
  if (turned(key, event.shiftKey)) event.preventDefault();
  else if (key === "enter" && !event.target.matches("button")) send({ do: "run" });
  else if (key === "arrowleft" && !event.target.matches("input")) to(-1);
  else if (key === "arrowright" && !event.target.matches("input")) to(1);
});

// ---- clicks on a point --------------------------------------------------------------------------------------------

at("canvas").addEventListener("click", (event) => {
  const { current, state, step, pose } = live;
  if (current < 0) return say("Run the cascade first; then a click on a point shows why it was matched where it was.");
  const under = step === "reference" ? { under: state.frame.reference } : step === 0 ? { under: extrinsicOf(pose, state.frame.guess) } : { step };
  send({ do: "look", try: current, pixel: pixelUnder(event), ...under });
});

addEventListener("message", ({ data, origin }) => {
  if (origin === new URL(at("viewer").src).origin && data.viewer) clickInViewer(data.viewer);
});

// A click on an overlay in the viewer is a click on the picture: its selection names the overlay and the pixel.
function clickInViewer(event) {
  if (event.type !== "selection_change" || live.current < 0) return;
  for (const item of event.items ?? []) {
    const overlay = /^\/?overlay\/(miscalibrated|corrected|current|stage_(\d))/.exec(item.entity_path ?? "");
    if (!overlay || !item.position) continue;
    const { steps } = shownTry();
    const found = overlay[2] ? steps.findIndex((one) => one.name === `stage ${overlay[2]}`) : overlay[1] === "miscalibrated" ? 0 : steps.length - 1;
    send({ do: "look", try: live.current, step: Math.max(0, found), pixel: [item.position[0] - 0.5, item.position[1] - 0.5] });
    return;
  }
}

// Under another name of this machine, the viewer is another site, so the browser gives it a process of its own: without
// a graphics card it takes seconds per picture, and the points would wait for it.
const viewer = new URL("viewer/", location.href);
viewer.hostname = location.hostname === "localhost" ? "127.0.0.1" : "localhost";
viewer.searchParams.set("page", location.origin);
at("viewer").src = viewer.href;
connect(heard);
