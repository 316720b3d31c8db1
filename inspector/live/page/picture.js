// The image with the points of the scan over it, drawn here so that they follow the sliders at once.
import { at, live, shownTry } from "./workspace.js";
import { colours } from "./colours.js";
import { extrinsicOf, figures, off } from "./poses.js";

const NEAREST = 0.1; // metres before the camera
const MOST_COVERED = 0.35; // share of the image that points cover at first, at most: below more of them it cannot be seen
const RETRY_MILLISECONDS = 2000; // milliseconds until an image that did not arrive is requested again
const canvas = at("canvas"), context = canvas.getContext("2d");
let scan = null, image = null, loaded = -1;
let buffer = null, pixels = null, depths = null, layer = null, due = false, sized = false;

// Fetch the current frame, unless it is loaded.
export async function showFrame() {
  const { position, reference, camera } = live.state.frame;
  if (loaded === position) return redraw();
  loaded = position;
  let bitmap, bytes;
  try {
    [bitmap, bytes] = await Promise.all([
      fetched(`picture.jpg?${position}`).then((answer) => answer.blob()).then(createImageBitmap),
      fetched(`points.bin?${position}`).then((answer) => answer.arrayBuffer()),
    ]);
  } catch {
    if (loaded === position) setTimeout(retry, RETRY_MILLISECONDS);
    return;
  }
  if (loaded !== position) return;
  image = bitmap;
  scan = unpack(bytes);
  if (reference) {
    scan.truth = new Float32Array(2 * scan.count).fill(NaN);
    for (let i = 0; i < scan.count; i++) {
      const seen = project(reference, i, camera);
      if (seen) scan.truth.set(seen.slice(0, 2), 2 * i);
    }
  }
  fit();
  redraw();
}

export const forgetFrame = () => {
  loaded = -1;
};

async function fetched(path) {
  const answer = await fetch(path);
  if (!answer.ok) throw new Error(`${path}: ${answer.status}`);
  return answer;
}

function retry() {
  forgetFrame();
  showFrame();
}

function unpack(bytes) {
  const count = new Uint32Array(bytes, 0, 1)[0];
  return {
    count,
    xyz: new Float32Array(bytes, 4, 3 * count),
    intensity: new Uint8Array(bytes, 4 + 12 * count, count),
    edge: new Uint8Array(bytes, 4 + 13 * count, count),
    truth: null, // pixels under the reference
  };
}

// Make the canvas as large as possible.
export function fit() {
  const [width, height] = live.state.frame.size;
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

export function redraw() {
  if (due) return;
  due = true;
  requestAnimationFrame(() => {
    due = false;
    const began = performance.now();
    draw();
    live.timing.draw = performance.now() - began;
    live.timing.draws += 1;
  });
}

// The extrinsic that is drawn.
function shownExtrinsic() {
  const { state, step, pose } = live, steps = shownTry()?.steps ?? [];
  if (step === "reference") return state.frame.reference;
  if (step === 0 || !steps[step]) return extrinsicOf(pose, state.frame.guess);
  return steps[step].extrinsic;
}

const project = (m, i, camera) => seenAt(m, scan.xyz[3 * i], scan.xyz[3 * i + 1], scan.xyz[3 * i + 2], camera);

// The pixel and the depth at which an extrinsic shows a point; null if it is behind the camera.
function seenAt(m, x, y, z, [fx, fy, cx, cy]) {
  const depth = m[8] * x + m[9] * y + m[10] * z + m[11];
  if (depth < NEAREST) return null;
  return [(fx * (m[0] * x + m[1] * y + m[2] * z + m[3])) / depth + cx, (fy * (m[4] * x + m[5] * y + m[6] * z + m[7])) / depth + cy, depth];
}

function draw() {
  if (!scan || !image || !pixels) return;
  const m = shownExtrinsic(), { camera, size: [full] } = live.state.frame, { width, height } = canvas;
  const scale = width / full, size = Number(at("size").value) * Math.max(1, Math.round(width / 1000)), half = size >> 1;
  const colour = colours(live.hello.palettes, at("color").value, scan);
  pixels.fill(0);
  depths.fill(Infinity);
  let drawn = 0;
  for (let i = 0; i < scan.count; i++) {
    const seen = project(m, i, camera);
    if (!seen) continue;
    const left = Math.round((seen[0] + 0.5) * scale) - half, top = Math.round((seen[1] + 0.5) * scale) - half;
    if (left < 0 || top < 0 || left + size > width || top + size > height) continue;
    drawn += 1;
    const paint = colour(i, seen[2], seen[0], seen[1]), depth = seen[2];
    for (let y = top; y < top + size; y++)
      for (let place = y * width + left, end = place + size; place < end; place++)
        if (depth < depths[place]) {
          depths[place] = depth;
          pixels[place] = paint;
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
  ring(m, camera, scale);
  caption(m);
  if (!sized && drawn * size * size > MOST_COVERED * width * height) {
    at("size").value = at("size").min;
    redraw();
  }
  sized = true;
}

// A ring about the point whose search windows the viewer shows.
function ring(m, camera, scale) {
  const { ring, state } = live, seen = ring?.position === state.frame.position && seenAt(m, ...ring.point, camera);
  if (!seen) return;
  for (const [color, width] of [["#000", 6], ["#ff00c8", 3]]) {
    context.beginPath();
    context.arc((seen[0] + 0.5) * scale, (seen[1] + 0.5) * scale, canvas.width / 90, 0, 2 * Math.PI);
    Object.assign(context, { strokeStyle: color, lineWidth: (width * canvas.width) / 1000 });
    context.stroke();
  }
}

function caption(m) {
  const { step, state } = live, known = shownTry()?.steps[step];
  const name = step === "reference" ? "reference" : step === 0 || !known ? "mine" : known.name;
  const error = step === "reference" ? null : off(m, state.frame.reference);
  at("caption").textContent = error ? `${name}: ${figures(error)} off` : name;
}

// The pixel of the camera's image under the pointer.
export function pixelUnder(event) {
  const box = canvas.getBoundingClientRect(), [width, height] = live.state.frame.size;
  return [((event.clientX - box.left) / box.width) * width - 0.5, ((event.clientY - box.top) / box.height) * height - 0.5];
}
