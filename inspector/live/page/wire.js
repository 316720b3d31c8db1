// Messages to and from calib-inspect, and messages to the user.
import { at } from "./workspace.js";

const SOON = 2000; // milliseconds until a lost connection is retried
let socket = null;

let later = null, timer = 0;

// Send a message, after any delayed one, so that the request applies to the pose that is shown.
export function send(message) {
  const waiting = later;
  forgetLater();
  if (waiting) transmit({ ...waiting(), run: false });
  transmit(message);
}

// Send the message that `make` returns after the given milliseconds, unless another one is sent first.
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
  else say("Not connected to calib-inspect: nothing was done. Reconnecting …", true);
}

// Messages go to the function of their name in `heard`.
export function connect(heard) {
  socket = new WebSocket(new URL("control", location.href).href.replace(/^http/, "ws"));
  socket.onmessage = ({ data }) => {
    const message = JSON.parse(data);
    heard[message.is](message);
  };
  socket.onclose = () => {
    say("The connection to calib-inspect was lost. Reconnecting … Check that it is still running.", true);
    setTimeout(() => connect(heard), SOON);
  };
}

let shown = 0;

export function say(text, problem = false) {
  at("said").textContent = text;
  at("said").className = problem ? "problem" : "";
  clearTimeout(shown);
  const forget = () => {
    at("said").textContent = "";
  };
  shown = setTimeout(forget, problem ? 12000 : 5000);
}
