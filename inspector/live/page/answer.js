// The answers of the cascade: the verdict, the stages of the shown try, and all tries so far.
import { at, live, shownTry } from "./workspace.js";
import { redraw } from "./picture.js";
import { figures } from "./poses.js";

const STAGE_MILLISECONDS = 350; // an answer is shown stage by stage
const MOST_LISTED = 200;
let walking = 0;

export function show(number, step) {
  stopWalking();
  Object.assign(live, { current: number, step });
  showAnswer();
  redraw();
}

export function walk(number) {
  show(number, 0);
  const last = live.tries[number].steps.length - 1;
  walking = setInterval(() => {
    live.step = Math.min(last, live.step + 1);
    if (live.step === last) stopWalking();
    showSteps();
    redraw();
  }, STAGE_MILLISECONDS);
}

export const stopWalking = () => clearInterval(walking);

function showAnswer() {
  const answer = shownTry();
  at("word").className = "";
  if (answer) {
    const word = answer.verdict ? answer.verdict.word : "no verdict";
    at("word").textContent = word[0].toUpperCase() + word.slice(1);
    at("word").className = word.split(" ")[0];
    at("within").textContent = answer.verdict?.within ?? "";
    const sure = answer.sigma ? ` ±${answer.sigma[0].toFixed(2)}° / ${answer.sigma[1].toFixed(1)} cm (1σ).` : "";
    at("reason").textContent = `${answer.verdict ? answer.verdict.text : ""}${sure} Try ${answer.number}, frame ${answer.frame}: ${answer.title}, ${answer.milliseconds} ms.`;
  }
  showSteps();
  at("tries").replaceChildren(...live.tries.toReversed().slice(0, MOST_LISTED).map(listed));
}

function listed(one) {
  const item = document.createElement("li"), button = document.createElement("button"), last = one.steps.at(-1);
  button.textContent = `${one.number}: frame ${one.frame}, ${one.title}: ${one.verdict ? one.verdict.word : "no verdict"}${last.error ? `, ${figures(last.error)} off` : ""}`;
  if (one.number === live.current) button.setAttribute("aria-current", "true");
  button.onclick = () => show(one.number, one.steps.length - 1);
  item.append(button);
  return item;
}

export function showSteps() {
  const answer = shownTry(), { step } = live, judged = step !== 0 && step !== "reference";
  showChoices(answer);
  const rows = answer ? answer.steps : [];
  at("steps").innerHTML = rows.length ? `<tr><th></th>${rows[0].error ? "<th>off by</th>" : ""}<th>moved by</th></tr>` : "";
  for (const [i, one] of rows.entries()) {
    const row = at("steps").insertRow();
    if (i === step) row.setAttribute("aria-current", "true");
    row.insertCell().textContent = i ? `after ${one.name}` : "from";
    if (one.error) row.insertCell().textContent = figures(one.error);
    row.insertCell().textContent = i ? figures(one.moved) : "–";
  }
  // the verdict belongs to the try's result: beside another pose it must not look like a verdict on that
  at("answer").classList.toggle("past", Boolean(answer) && !judged);
  at("take").disabled = !(answer && judged);
}

// The buttons above the image that choose the extrinsic to draw.
function showChoices(answer) {
  const choices = [[0, "Mine"], ...(answer ? answer.steps.slice(1).map((one, i) => [i + 1, `After ${one.name}`]) : [])];
  if (live.state.frame.reference) choices.push(["reference", "Reference"]);
  // buttons with unchanged names are kept: one that is replaced between press and release would miss the click
  const names = choices.map(([, name]) => name), buttons = at("shown").children;
  if (names.join() !== Array.from(buttons, (button) => button.textContent).join())
    at("shown").replaceChildren(...names.map((name) => {
      const button = document.createElement("button");
      button.setAttribute("role", "radio");
      button.textContent = name;
      return button;
    }));
  for (const [i, [value]] of choices.entries()) {
    buttons[i].setAttribute("aria-checked", String(value === live.step));
    buttons[i].tabIndex = value === live.step ? 0 : -1;
    buttons[i].onclick = () => show(live.current, value);
  }
}

// Arrows go through these buttons as through every group of radio buttons, and not on to the next frame.
const BY = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 };
at("shown").addEventListener("keydown", (event) => {
  const buttons = Array.from(at("shown").children), by = BY[event.key];
  if (!by || event.ctrlKey || event.altKey || event.metaKey) return;
  event.preventDefault();
  event.stopPropagation();
  const next = buttons.at((buttons.indexOf(event.target) + by) % buttons.length);
  next.focus();
  next.click();
});
