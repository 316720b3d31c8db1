// The colours of points, and their legend.
const rgba = (r, g, b) => (255 << 24) | (b << 16) | (g << 8) | r;

// A function from a point (its row, depth and pixel) to its colour.
export function colours({ turbo, viridis, near, far, edge, rest, worst }, kind, scan) {
  const table = (values) => Array.from({ length: 256 }, (_, i) => rgba(values[3 * i], values[3 * i + 1], values[3 * i + 2]));
  const turbos = table(turbo), viridises = table(viridis), span = Math.log(far / near);
  if (kind === "intensity") return (i) => viridises[scan.intensity[i]];
  if (kind === "edge") return (i) => (scan.edge[i] ? rgba(...edge) : rgba(...rest));
  if (kind === "error" && scan.truth)
    return (i, _z, u, v) => {
      const distance = Math.hypot(u - scan.truth[2 * i], v - scan.truth[2 * i + 1]);
      return turbos[Math.round(25 + 215 * Math.min(1, (Number.isFinite(distance) ? distance : worst) / worst))];
    };
  return (_i, z) => turbos[Math.round(245 - 235 * Math.min(1, Math.max(0, Math.log(z / near) / span)))];
}

// As HTML.
export function legend({ turbo, viridis, near, far, edge, rest, worst }, kind) {
  const css = (table, i) => `rgb(${table.slice(3 * i, 3 * i + 3).join()})`;
  const ramp = (table, from, to) => `linear-gradient(90deg, ${[0, 1, 2, 3, 4, 5, 6].map((k) => css(table, Math.round(from + ((to - from) * k) / 6))).join()})`;
  const bar = (gradient, low, high) => `${low} <i style="width:160px;background:${gradient}"></i> ${high}`;
  return {
    depth: bar(ramp(turbo, 245, 10), `${near} m`, `${far} m`),
    intensity: bar(ramp(viridis, 0, 255), "weak return", "strong"),
    edge: `<i style="background:rgb(${edge.join()})"></i>depth edges, which should lie on outlines <i style="background:rgb(${rest.join()})"></i>others`,
    error: bar(ramp(turbo, 25, 240), "in place", `${worst} px off or more`),
  }[kind];
}
