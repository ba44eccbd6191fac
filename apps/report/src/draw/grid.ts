// SPDX-License-Identifier: BSD-3-Clause
// Grid and axes in metres.
import { axes, type Box, type EyeControl } from "./camera";
import { multiples, niceStep, tickLabel } from "./ticks";

export interface Mark {
  text: string;
  at: [number, number, number];
}

export interface Grid {
  step: number;
  /** Pairs of points x y z. */
  lines: Float32Array;
  marks: Mark[];
}

const kPixelsApart = 96;

/** Multiples of `step` in the world's coordinates, given in those of the graph. */
function lattice(low: number, high: number, origin: number, step: number): number[] {
  return multiples(low + origin, high + origin, step).map((value) => value - origin);
}

/** Over all that a plan shows. Its numbers stand at the edges of the picture: `planMarks`. */
export function planGrid(control: EyeControl, origin: number[]): Grid {
  const step = niceStep(control.metresPerPixel * kPixelsApart);
  const [x, y] = control.eye.target;
  const w = (control.metresPerPixel * control.width) / 2, h = (control.metresPerPixel * control.height) / 2;
  const lines: number[] = [];
  for (const gx of lattice(x - w, x + w, origin[0], step)) lines.push(gx, y - h, 0, gx, y + h, 0);
  for (const gy of lattice(y - h, y + h, origin[1], step)) lines.push(x - w, gy, 0, x + w, gy, 0);
  return { step, lines: Float32Array.from(lines), marks: [] };
}

/** Pixels along the lower and the left edge of a plan, and what stands there. */
export function planMarks(control: EyeControl, origin: number[], step: number) {
  const scale = control.metresPerPixel;
  const [x, y] = control.eye.target;
  const w = (scale * control.width) / 2, h = (scale * control.height) / 2;
  const label = (value: number) => tickLabel(Math.abs(value) < step * 1e-6 ? 0 : value, step);
  return {
    x: lattice(x - w, x + w, origin[0], step).map((g) => ({ pixel: (g - x + w) / scale, text: label(g + origin[0]) })),
    y: lattice(y - h, y + h, origin[1], step).map((g) => ({ pixel: (y + h - g) / scale, text: label(g + origin[1]) })),
  };
}

/** The ground under a graph in space, and a scale of heights at one corner of it. */
export function spaceGrid(
  control: EyeControl, box: Box, origin: number[], onScreen: (p: [number, number, number]) => boolean,
): Grid {
  const extent = Math.max(box.max[0] - box.min[0], box.max[1] - box.min[1], 1e-3);
  const height = box.max[2] - box.min[2];
  const step = Math.max(niceStep(control.metresPerPixel * kPixelsApart), niceStep(extent / 40));
  const around = 24 * step;
  const low = [0, 1].map((d) => Math.max(box.min[d] - 0.5 * step, control.eye.target[d] - around));
  const high = [0, 1].map((d) => Math.min(box.max[d] + 0.5 * step, control.eye.target[d] + around));
  const xs = lattice(low[0], high[0], origin[0], step);
  const ys = lattice(low[1], high[1], origin[1], step);
  const floor = box.min[2];
  const lines: number[] = [];
  const marks: Mark[] = [];
  if (xs.length < 2 || ys.length < 2) return { step, lines: new Float32Array(), marks };
  const [x0, x1, y0, y1] = [xs[0], xs[xs.length - 1], ys[0], ys[ys.length - 1]];
  for (const x of xs) lines.push(x, y0, floor, x, y1, floor);
  for (const y of ys) lines.push(x0, y, floor, x1, y, floor);

  // Numbers stand along the sides that are nearer to the eye, outside of the ground.
  const { forward, right } = axes(control.eye.yaw, 0);
  const nearY = forward[1] > 0 ? y0 - 0.35 * step : y1 + 0.35 * step;
  const nearX = forward[0] > 0 ? x0 - 0.35 * step : x1 + 0.35 * step;
  const tidy = (value: number) => tickLabel(Math.abs(value) < step * 1e-6 ? 0 : value, step);
  const unit = (text: string, k: number, all: number[]) => (k === all.length - 1 ? `${text} m` : text);
  xs.forEach((x, k) => marks.push({ text: unit(tidy(x + origin[0]), k, xs), at: [x, nearY, floor] }));
  ys.forEach((y, k) => marks.push({ text: unit(tidy(y + origin[1]), k, ys), at: [nearX, y, floor] }));

  const zStep = Math.max(niceStep(control.metresPerPixel * kPixelsApart), niceStep(height / 12));
  const zs = lattice(floor, box.max[2] + 0.5 * zStep, origin[2], zStep);
  // From above a scale of heights is a point.
  if (height > 0.02 * extent && zs.length > 1 && Math.abs(control.eye.pitch) < 1.3) {
    // The leftmost corner on the screen has nothing in front of it; if that is out of sight, the next.
    const leftness = (c: number[]) => c[0] * right[0] + c[1] * right[1];
    const corners = [[x0, y0], [x0, y1], [x1, y0], [x1, y1]].sort((c, d) => leftness(c) - leftness(d));
    const leftmost = corners.find(([x, y]) => onScreen([x, y, floor]) && onScreen([x, y, zs[zs.length - 1]])) ?? corners[0];
    const [cx, cy] = leftmost;
    const reach = 0.12 * step;
    lines.push(cx, cy, floor, cx, cy, zs[zs.length - 1]);
    zs.forEach((z, k) => {
      lines.push(cx - reach * right[0], cy - reach * right[1], z, cx, cy, z);
      const text = tickLabel(Math.abs(z + origin[2]) < zStep * 1e-6 ? 0 : z + origin[2], zStep);
      marks.push({ text: unit(text, k, zs), at: [cx - 0.4 * step * right[0], cy - 0.4 * step * right[1], z] });
    });
  }
  return { step, lines: Float32Array.from(lines), marks };
}
