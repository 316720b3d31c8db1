// Talking with calib-inspect, and telling people.
import { at } from "./workspace.js";

const SOON = 2000; // milliseconds until a lost connection is tried again
let socket = null;

export const send = (message) => socket.readyState === WebSocket.OPEN && socket.send(JSON.stringify(message));

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
