// Rerun's viewer, fed through the page's own connection: pieces of a recording, each complete in itself.
const hint = document.getElementById("hint");
const canvas = document.getElementById("canvas");
const CHANNEL = "live";
const page = new URLSearchParams(location.search).get("page") ?? location.origin;
let viewer = null;

async function start() {
  hint.textContent = "Starting the viewer: some seconds the first time.";
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
  canvas.hidden = false;
  await viewer.start(canvas);
  viewer.open_channel(CHANNEL, "live");
  hint.textContent = "The viewer takes the try in. Without a graphics card, on a busy machine, that is minutes.";
}

// The viewer says a time as soon as it has something to show: until then its canvas is blank.
function heard(event) {
  if (event.type.startsWith("time")) hint.hidden = true;
  parent.postMessage({ viewer: event }, page);
}

const waiting = [];
let starting = null;

async function take(piece) {
  waiting.push(new Uint8Array(piece));
  starting ??= start();
  try {
    await starting;
  } catch (error) {
    hint.hidden = false;
    hint.textContent = `The viewer does not start here (${error}). The picture and the answer above work without it.`;
    return;
  }
  while (waiting.length) viewer.send_rrd_to_channel(CHANNEL, waiting.shift());
  window.pieces += 1;
}

window.pieces = 0;
const socket = new WebSocket(new URL("../stream", location.href).href.replace(/^http/, "ws"));
socket.binaryType = "arraybuffer";
socket.onmessage = (message) => take(message.data);
