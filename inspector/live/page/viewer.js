// Rerun's viewer, fed through the page's own connection: pieces of a recording, each complete in itself.
const hint = document.getElementById("hint");
const canvas = document.getElementById("canvas");
const CHANNEL = "live";
const page = new URLSearchParams(location.search).get("page") ?? location.origin;
let viewer = null;

async function start() {
  delete WebAssembly.instantiateStreaming;
  await wasm_bindgen({ module_or_path: "re_viewer_bg.wasm" });
  viewer = new wasm_bindgen.WebHandle({
    url: [],
    render_backend: "webgl",
    hide_welcome_screen: true,
    persist: false,
    theme: matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark",
    panel_state_overrides: { top: "Hidden", blueprint: "Hidden", selection: "Hidden" },
    on_viewer_event: (event) => heard(typeof event === "string" ? JSON.parse(event) : event),
  });
  await viewer.start(canvas);
  viewer.open_channel(CHANNEL, "live");
  hint.textContent = "Your first try will appear here, with every stage's cost volumes, the scene in 3D, and more.";
}

function heard(event) {
  if (event.type.startsWith("time")) timed = true;
  parent.postMessage({ viewer: event }, page);
}

// The viewer loads a little with every picture that it draws, and needs a hundred pictures for the first try. Without a
// graphics card a large one costs a second, so its canvas is small and hidden until it has reported a time, which it does
// when it knows what to show, and until it has been idle for some pictures.
const IDLE_MILLISECONDS = 4, IDLE_PICTURES = 4;
const soon = requestAnimationFrame;
let timed = false, idle = 0;

window.requestAnimationFrame = (draw) => soon((time) => {
  const began = performance.now();
  draw(time);
  idle = performance.now() - began < IDLE_MILLISECONDS ? idle + 1 : 0;
  if (!timed || idle < IDLE_PICTURES) return;
  window.requestAnimationFrame = soon;
  hint.hidden = true;
  canvas.className = "";
});

const waiting = [];
const started = start().then(() => true, (error) => {
  hint.textContent = `The viewer cannot start in this browser (${error}). The image and the answers work without it.`;
  return false;
});

async function take(piece) {
  waiting.push(new Uint8Array(piece));
  if (!(await started)) return;
  if (!window.pieces) hint.textContent = "Loading your first try …";
  while (waiting.length) viewer.send_rrd_to_channel(CHANNEL, waiting.shift());
  window.pieces += 1;
}

window.pieces = 0;
let received = 0;

function connect() {
  const address = new URL(`../stream?from=${received}`, location.href).href.replace(/^http/, "ws");
  const socket = new WebSocket(address);
  socket.binaryType = "arraybuffer";
  socket.onmessage = (message) => {
    received += 1;
    take(message.data);
  };
  socket.onclose = () => setTimeout(connect, 2000);
}
connect();
