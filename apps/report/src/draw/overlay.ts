// SPDX-License-Identifier: BSD-3-Clause
// What lies over the graph: numbers of the axes, rings and highlights. On a canvas of its own, so that hovering does not draw the graph anew.
import { axes, type EyeControl } from "./camera";
import { kInk, kMuted, kPaper, kPrior, type Theme } from "./colour";
import { planMarks, type Grid } from "./grid";

export interface Ring {
  x: number;
  y: number;
  colour: string;
  radius: number;
  square?: boolean;
}

export interface Highlight {
  from: [number, number];
  to: [number, number] | null;
  colour: string;
  strong: boolean;
}

const kFont = '11.5px system-ui, "Segoe UI", "Helvetica Neue", Arial, "Liberation Sans", sans-serif';

export class Overlay {
  constructor(readonly canvas: HTMLCanvasElement) {}

  private begin(width: number, height: number): CanvasRenderingContext2D {
    const ratio = window.devicePixelRatio || 1;
    const w = Math.round(width * ratio), h = Math.round(height * ratio);
    if (this.canvas.width !== w || this.canvas.height !== h) {
      this.canvas.width = w;
      this.canvas.height = h;
    }
    const c = this.canvas.getContext("2d")!;
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.clearRect(0, 0, width, height);
    c.font = kFont;
    c.lineJoin = "round";
    return c;
  }

  paint(
    control: EyeControl, theme: Theme, origin: number[], grid: Grid | null,
    toScreen: (p: [number, number, number]) => [number, number] | null, rings: Ring[], highlights: Highlight[],
  ): void {
    const c = this.begin(control.width, control.height);
    for (const ring of rings) this.ring(c, ring, theme);
    for (const highlight of highlights) this.highlight(c, highlight, theme);
    if (grid && control.plan) this.planAxes(c, control, theme, origin, grid.step);
    if (grid && !control.plan) {
      const taken: [number, number][] = [];
      for (const mark of grid.marks) {
        const at = toScreen(mark.at);
        if (at && at[0] > 24 && at[0] < control.width - 24 && !taken.some(([x, y]) => Math.abs(x - at[0]) < 46 && Math.abs(y - at[1]) < 15)) {
          this.text(c, mark.text, at[0], at[1], theme, "center");
          taken.push(at);
        }
      }
    }
    if (!control.plan) this.triad(c, control, theme);
  }

  private text(
    c: CanvasRenderingContext2D, text: string, x: number, y: number, theme: Theme, align: CanvasTextAlign,
  ): void {
    c.textAlign = align;
    c.textBaseline = "middle";
    c.lineWidth = 3.5;
    c.strokeStyle = kPaper[theme];
    c.strokeText(text, x, y);
    c.fillStyle = kMuted[theme];
    c.fillText(text, x, y);
  }

  private planAxes(
    c: CanvasRenderingContext2D, control: EyeControl, theme: Theme, origin: number[], step: number,
  ): void {
    const marks = planMarks(control, origin, step);
    const { width, height } = control;
    for (const mark of marks.x) {
      if (mark.pixel > 44 && mark.pixel < width - 64) this.text(c, mark.text, mark.pixel, height - 12, theme, "center");
    }
    for (const mark of marks.y) {
      if (mark.pixel > 24 && mark.pixel < height - 28) this.text(c, mark.text, 8, mark.pixel, theme, "left");
    }
    this.text(c, "x [m]", width - 10, height - 12, theme, "right");
    this.text(c, "y [m]", 8, 12, theme, "left");
  }

  /** Which way x, y and z go. */
  private triad(c: CanvasRenderingContext2D, control: EyeControl, theme: Theme): void {
    const { right, up, forward } = axes(control.eye.yaw, control.eye.pitch);
    const cx = 40, cy = control.height - 40, reach = 24;
    const order = [0, 1, 2].sort((i, j) => forward[j] - forward[i]);
    c.lineWidth = 1.5;
    for (const d of order) {
      const x = cx + reach * right[d], y = cy - reach * up[d];
      c.strokeStyle = forward[d] > 0.2 ? kMuted[theme] : kInk[theme];
      c.beginPath();
      c.moveTo(cx, cy);
      c.lineTo(x, y);
      c.stroke();
      this.text(c, "xyz"[d], cx + (reach + 9) * right[d], cy - (reach + 9) * up[d], theme, "center");
    }
  }

  private ring(c: CanvasRenderingContext2D, ring: Ring, theme: Theme): void {
    c.beginPath();
    if (ring.square) c.rect(ring.x - ring.radius, ring.y - ring.radius, 2 * ring.radius, 2 * ring.radius);
    else c.arc(ring.x, ring.y, ring.radius, 0, 2 * Math.PI);
    c.lineWidth = 3.5;
    c.strokeStyle = kPaper[theme];
    c.stroke();
    c.lineWidth = 1.75;
    c.strokeStyle = ring.colour || kPrior[theme];
    c.stroke();
  }

  private highlight(c: CanvasRenderingContext2D, what: Highlight, theme: Theme): void {
    const width = what.strong ? 3 : 2.25;
    c.lineCap = "round";
    if (what.to) {
      for (const [w, colour] of [[width + 6, kPaper[theme]], [width + 2.5, kInk[theme]], [width, what.colour]] as const) {
        c.beginPath();
        c.moveTo(...what.from);
        c.lineTo(...what.to);
        c.lineWidth = w;
        c.strokeStyle = colour;
        c.stroke();
      }
    }
    for (const end of what.to ? [what.from, what.to] : [what.from]) {
      c.beginPath();
      c.arc(end[0], end[1], what.strong ? 6.5 : 5, 0, 2 * Math.PI);
      c.fillStyle = kPaper[theme];
      c.fill();
      c.lineWidth = width - 0.5;
      c.strokeStyle = kInk[theme];
      c.stroke();
    }
  }
}
