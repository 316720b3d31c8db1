// Talking with calib-inspect, and telling people.
import { at } from "./workspace.js";

const SOON = 2000; // milliseconds until a lost connection is tried again
let socket = null;

let later = null, timer = 0;

// Send a message, after the one that was left for later: what is asked for now is asked of the pose that is seen.
export function send(message) {
  const waiting = later;
  forgetLater();
  if (waiting) transmit({ ...waiting(), run: false });
  transmit(message);
}

// Send what `make` gives once nothing else was asked for in so many milliseconds.
export function sendLater(make, milliseconds) {
  forgetLater();
  later = make;
  timer = setTimeout(() => { forgetLater(); transmit(make()); }, milliseconds);
}

export function forgetLater() {
  clearTimeout(timer);
  later = null;
}

function transmit(message) {
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
  else say("Not connected to calib-inspect, so nothing was done; trying to connect again.", true);
}

// Messages go to the function of their name in `heard`.
export function connect(heard) {
  socket = new WebSocket(new URL("control", location.href).href.replace(/^http/, "ws"));
  socket.onmessage = ({ data }) => {
    const message = JSON.parse(data);
    heard[message.is](message);
  };
  socket.onclose = () => {
    say("The connection to calib-inspect is gone; trying again. Does it still run?", true);
    setTimeout(() => connect(heard), SOON);
  };
}

let shown = 0;

export function say(text, problem = false) {
  at("said").textContent = text;
  at("said").className = problem ? "problem" : "";
  clearTimeout(shown);
  shown = setTimeout(() => (at("said").textContent = ""), problem ? 12000 : 5000);
}
