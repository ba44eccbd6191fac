// SPDX-License-Identifier: BSD-3-Clause
// What is under the pointer. All positions are projected once for each view; a pointer's move then goes over plain arrays,
// which for 100,000 poses and 300,000 edges takes two or three milliseconds: less than a pass that draws ids into a buffer
// takes in software, and no structure to keep up to date.

/** Column-major 4 × 4 applied to x y z; writes x y in pixels from the top left and depth in -1 … 1. NaN: behind or not there. */
export function project(
  positions: Float32Array, matrix: ArrayLike<number>, width: number, height: number, out: Float32Array,
): void {
  const m = matrix;
  for (let i = 0; i < positions.length; i += 3) {
    const x = positions[i], y = positions[i + 1], z = positions[i + 2];
    const w = m[3] * x + m[7] * y + m[11] * z + m[15];
    if (!(w > 1e-9)) {
      out[i] = out[i + 1] = out[i + 2] = NaN;
      continue;
    }
    out[i] = (0.5 + (0.5 * (m[0] * x + m[4] * y + m[8] * z + m[12])) / w) * width;
    out[i + 1] = (0.5 - (0.5 * (m[1] * x + m[5] * y + m[9] * z + m[13])) / w) * height;
    out[i + 2] = (m[2] * x + m[6] * y + m[10] * z + m[14]) / w;
  }
}

/** Nearest of the first `count` points within `radius` pixels, the nearer to the eye among equals; -1: none. */
export function nearestPoint(
  screen: Float32Array, count: number, x: number, y: number, radius: number, shown: (i: number) => boolean,
): { index: number; distance: number } {
  let index = -1;
  let best = radius * radius;
  let depth = Infinity;
  for (let i = 0; i < count; ++i) {
    const dx = screen[3 * i] - x;
    const dy = screen[3 * i + 1] - y;
    const d = dx * dx + dy * dy;
    if (!(d <= best)) continue;  // false for NaN too
    if (d > best - 0.25 && index >= 0 && screen[3 * i + 2] >= depth) continue;
    if (!shown(i)) continue;
    index = i;
    best = d;
    depth = screen[3 * i + 2];
  }
  return { index, distance: Math.sqrt(best) };
}

/** Squared distance from a point to a segment. */
export function squaredDistance(
  x: number, y: number, ax: number, ay: number, bx: number, by: number,
): number {
  const ux = bx - ax, uy = by - ay;
  const length = ux * ux + uy * uy;
  let t = length > 0 ? ((x - ax) * ux + (y - ay) * uy) / length : 0;
  t = t < 0 ? 0 : t > 1 ? 1 : t;
  const dx = ax + t * ux - x, dy = ay + t * uy - y;
  return dx * dx + dy * dy;
}

/** Nearest edge within `radius` pixels; of two equally near, the one with the larger `weight`. -1: none. */
export function nearestEdge(
  screen: Float32Array, a: Int32Array, b: Int32Array, count: number, x: number, y: number, radius: number,
  shown: (e: number) => boolean, weight?: ArrayLike<number> | null,
): { index: number; distance: number } {
  let index = -1;
  let best = radius * radius;
  for (let e = 0; e < count; ++e) {
    if (b[e] < 0) continue;
    const i = 3 * a[e], j = 3 * b[e];
    const ax = screen[i], ay = screen[i + 1], bx = screen[j], by = screen[j + 1];
    // Quick refusal by the box of the segment; also refuses NaN.
    if (!((ax < bx ? ax : bx) <= x + radius && (ax > bx ? ax : bx) >= x - radius)) continue;
    if (!((ay < by ? ay : by) <= y + radius && (ay > by ? ay : by) >= y - radius)) continue;
    const d = squaredDistance(x, y, ax, ay, bx, by);
    if (!(d <= best) || !shown(e)) continue;
    if (index >= 0 && d > best - 0.25 && weight && !(weight[e] > weight[index])) continue;
    index = e;
    best = d;
  }
  return { index, distance: Math.sqrt(best) };
}
