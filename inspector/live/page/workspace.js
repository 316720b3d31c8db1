// The state of the page, shared by all its parts.
export const at = (id) => document.getElementById(id);

export const live = {
  hello: null, state: null, // as sent by the server
  pose: [0, 0, 0, 0, 0, 0], // of the sliders, from the guess: degrees, metres
  held: null, // the pose being set, until the server has it: other messages must not move the sliders
  tries: [], current: -1, // the tries, and the one that is shown
  step: 0, // of the shown try: 0 the pose of the sliders, then after each stage; or "reference"
  ring: null, // the point that was clicked, in the LiDAR frame, and the position of its frame
  timing: { draws: 0, draw: 0, answer: 0 }, // milliseconds of the last draw and the last answer
  get shown() { return [this.current, this.step]; },
};
window.live = live;

export const shownTry = () => live.tries[live.current];
