// Rigid transforms, 4x4 row by row.
function multiply(a, b) {
  const c = new Array(16).fill(0);
  for (let i = 0; i < 4; i++) for (let j = 0; j < 4; j++) for (let k = 0; k < 4; k++) c[4 * i + j] += a[4 * i + k] * b[4 * k + j];
  return c;
}

// The extrinsic of a pose of the sliders, relative to a guess.
export function extrinsicOf([roll, pitch, yaw, x, y, z], guess) {
  const [a, b, c] = [pitch, yaw, roll].map((angle) => (angle * Math.PI) / 180);
  const [ca, sa, cb, sb, cc, sc] = [Math.cos(a), Math.sin(a), Math.cos(b), Math.sin(b), Math.cos(c), Math.sin(c)];
  const change = [
    cb * cc, -cb * sc, sb, x,
    ca * sc + sa * sb * cc, ca * cc - sa * sb * sc, -sa * cb, y,
    sa * sc - ca * sb * cc, sa * cc + ca * sb * sc, ca * cb, z,
    0, 0, 0, 1,
  ];
  return multiply(change, guess);
}

// Degrees and centimetres between two extrinsics; null if one is unknown.
export function off(one, other) {
  if (!other) return null;
  let trace = 0;
  for (let i = 0; i < 3; i++) for (let k = 0; k < 3; k++) trace += one[4 * i + k] * other[4 * i + k];
  const turned = (Math.acos(Math.min(1, Math.max(-1, (trace - 1) / 2))) * 180) / Math.PI;
  return [turned, 100 * Math.hypot(one[3] - other[3], one[7] - other[7], one[11] - other[11])];
}

export const figures = (error) => (error ? `${error[0].toFixed(2)}°, ${error[1].toFixed(1)} cm` : "");
