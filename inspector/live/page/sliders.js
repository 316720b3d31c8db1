// Six sliders, their fields and their keys.
import { showSteps, stopWalking } from "./answer.js";
import { at, live } from "./workspace.js";
import { redraw } from "./picture.js";
import { forgetLater, send, sendLater } from "./wire.js";

const AXES = [
  { name: "roll", unit: "°", keys: "qa", digits: 3 },
  { name: "pitch", unit: "°", keys: "ws", digits: 3 },
  { name: "yaw", unit: "°", keys: "ed", digits: 3 },
  { name: "x", unit: "m", keys: "rf", digits: 4, hint: "right" },
  { name: "y", unit: "m", keys: "tg", digits: 4, hint: "down" },
  { name: "z", unit: "m", keys: "yh", digits: 4, hint: "ahead" },
];
const STEPS = { coarse: [0.25, 0.02], fine: [0.02, 0.002] }; // degrees, metres; with Shift a tenth
const RELEASE_MILLISECONDS = 300; // milliseconds without a key press after which keys count as released
let asked = null;

export function makeSliders([degrees, metres]) {
  for (const [i, axis] of AXES.entries()) {
    const range = i < 3 ? degrees : metres;
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
  live.held = live.pose = live.pose.with(axis, value);
  stopWalking();
  live.step = 0;
  showPose();
  showSteps();
  redraw();
}

export function showPose() {
  for (const [i, axis] of AXES.entries()) {
    const slider = at(`range-${axis.name}`);
    slider.max = Math.max(slider.max, Math.abs(live.pose[i])); // a random pose lies about the truth, not about the guess
    slider.min = -slider.max;
    slider.value = live.pose[i];
    at(`number-${axis.name}`).value = live.pose[i].toFixed(axis.digits).replace(/^-(?=[0.]*$)/, "");
  }
}

function poseMessage() {
  asked = performance.now();
  return { do: "pose", pose: live.pose, run: at("auto").checked };
}

export function release() {
  forgetLater(); // a pose set by keys counts as well
  send(poseMessage());
}

// On an answer: note how long it took since the release of a slider, if that caused it.
export function answered() {
  if (asked !== null) live.timing.answer = performance.now() - asked;
  asked = null;
}

// Act on a key of the sliders; returns whether it was one.
export function turned(key, fine) {
  const axis = AXES.findIndex(({ keys }) => keys.includes(key));
  if (axis < 0) return false;
  const size = STEPS[at("steps-size").value][axis < 3 ? 0 : 1] * (fine ? 0.1 : 1);
  move(axis, live.pose[axis] + (AXES[axis].keys[0] === key ? size : -size));
  sendLater(poseMessage, RELEASE_MILLISECONDS);
  return true;
}
