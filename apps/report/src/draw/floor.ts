// SPDX-License-Identifier: BSD-3-Clause
// What is known of a floor and of the robot on it, on a plain canvas.
import type { Candidate, Decision, Exploration, Moment, Point, Pose } from "../data/exploration";
import { kUnknown, type Cells } from "../data/raster";
import { css, kInk, kLoop, kMuted, kPaper, ramp, rgb, strokes, type Stroke, type Theme } from "./colour";
import { ellipseSegments } from "./ellipses";
import { niceStep } from "./ticks";

export const kFloorLayers = ["map", "scan", "graph", "trajectory", "truth", "ellipse", "candidates", "tree"] as const;
export type FloorLayer = (typeof kFloorLayers)[number];
export type Shown = Record<FloorLayer, boolean>;

const kSigmas = 3;
const kCorners = 48;

/** Of candidates and tree: the least value is best. */
export interface ValueScale {
  best: number;
  worst: number;
}

export function valueScale(decision: Decision | null): ValueScale | null {
  const all: number[] = [];
  for (const candidate of decision?.candidates ?? []) if (candidate.value !== null) all.push(candidate.value);
  const values = decision?.tree?.values;
  for (let i = 0; values && i < values.length; i += 3) if (Number.isFinite(values[i])) all.push(values[i]);
  if (all.length === 0) return null;
  let [best, worst] = [all[0], all[0]];
  for (const value of all) {
    best = Math.min(best, value);
    worst = Math.max(worst, value);
  }
  return { best, worst };
}

/** 0 for the worst … 1 for the best, which the ramp shows most clearly. */
export function merit(scale: ValueScale, value: number | null): number {
  if (value === null || !Number.isFinite(value)) return 0;
  return scale.worst > scale.best ? (scale.worst - value) / (scale.worst - scale.best) : 1;
}

/** How the drawing lies on the canvas: pixels per metre, and the point of the world in its middle. */
export interface View {
  scale: number;
  x: number;
  y: number;
}

export class FloorDrawing {
  view: View = { scale: 20, x: 0, y: 0 };
  private readonly picture = document.createElement("canvas");

  constructor(readonly canvas: HTMLCanvasElement) {}

  private get width(): number {
    return this.canvas.clientWidth || 1;
  }
  private get height(): number {
    return this.canvas.clientHeight || 1;
  }

  /** Shows the whole map, and all poses. */
  fit(exploration: Exploration): void {
    let [left, low, right, high] = [Infinity, Infinity, -Infinity, -Infinity];
    const extend = ([x, y]: Point) => {
      left = Math.min(left, x), right = Math.max(right, x), low = Math.min(low, y), high = Math.max(high, y);
    };
    for (const moment of exploration.moments) {
      extend([moment.estimate[0], moment.estimate[1]]);
      if (moment.truth) extend([moment.truth[0], moment.truth[1]]);
    }
    const cells = exploration.cells(exploration.moments.length - 1);
    for (const [i, j] of [[0, 0], [1, 0], [0, 1], [1, 1]]) if (cells.width > 0) extend(corner(cells, i * cells.width, j * cells.height));
    this.view = {
      x: (left + right) / 2, y: (low + high) / 2,
      scale: Math.min(400, 0.94 * Math.min(this.width / Math.max(right - left, 1), this.height / Math.max(high - low, 1))),
    };
  }

  pan(dx: number, dy: number): void {
    this.view.x -= dx / this.view.scale;
    this.view.y += dy / this.view.scale;
  }

  /** About a point of the canvas [px]; its middle if none is given. */
  zoom(factor: number, px = this.width / 2, py = this.height / 2): void {
    const [x, y] = this.world(px, py);
    this.view.scale = Math.max(0.5, Math.min(2000, this.view.scale * factor));
    this.view.x = x - (px - this.width / 2) / this.view.scale;
    this.view.y = y + (py - this.height / 2) / this.view.scale;
  }

  world(px: number, py: number): Point {
    return [this.view.x + (px - this.width / 2) / this.view.scale, this.view.y - (py - this.height / 2) / this.view.scale];
  }

  private pixel(x: number, y: number): Point {
    return [this.width / 2 + (x - this.view.x) * this.view.scale, this.height / 2 - (y - this.view.y) * this.view.scale];
  }

  draw(exploration: Exploration, k: number, shown: Shown, marked: number, theme: Theme): void {
    const ratio = window.devicePixelRatio || 1;
    this.canvas.width = Math.round(this.width * ratio);
    this.canvas.height = Math.round(this.height * ratio);
    const context = this.canvas.getContext("2d");
    if (!context) return;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = kPaper[theme];
    context.fillRect(0, 0, this.width, this.height);
    context.lineJoin = context.lineCap = "round";
    const moment = exploration.moments[k];
    const decision = exploration.decisionAt(k);
    const [estimate, , truth] = strokes(["estimate", "initial", "truth"]);
    if (shown.map) this.drawMap(context, exploration.cells(k), theme);
    if (shown.scan) this.drawScan(context, moment, theme);
    if (shown.tree && decision?.tree) this.drawTree(context, decision, theme);
    if (shown.graph) this.drawGraph(context, exploration, k, theme);
    const until = exploration.moments.slice(0, k + 1);
    if (shown.trajectory) this.line(context, until.map((m) => point(m.estimate)), estimate, theme);
    if (shown.truth) this.line(context, until.flatMap((m) => (m.truth ? [point(m.truth)] : [])), truth, theme);
    if (shown.candidates && decision) this.drawCandidates(context, decision, marked, theme);
    if (shown.ellipse) this.drawEllipse(context, exploration, k, theme);
    if (shown.truth && moment.truth) this.drawRobot(context, exploration, moment.truth, truth, theme);
    this.drawRobot(context, exploration, moment.estimate, estimate, theme);
    this.drawScale(context, theme);
  }

  private drawMap(context: CanvasRenderingContext2D, cells: Cells, theme: Theme): void {
    if (cells.width === 0) return;
    this.picture.width = cells.width;
    this.picture.height = cells.height;
    const own = this.picture.getContext("2d");
    if (!own) return;
    const image = own.createImageData(cells.width, cells.height);
    const [free, occupied] = theme === "light" ? [255, 30] : [10, 225];
    for (let i = 0; i < cells.values.length; ++i) {
      const value = cells.values[i];
      // The picture's rows go down, those of the map up.
      const at = 4 * ((cells.height - 1 - Math.floor(i / cells.width)) * cells.width + (i % cells.width));
      const grey = value === kUnknown ? 0 : Math.round(free + ((occupied - free) * Math.min(100, value)) / 100);
      image.data.set(value === kUnknown ? unknownColour(theme) : [grey, grey, grey, 255], at);
    }
    own.putImageData(image, 0, 0);
    const { resolution, yaw } = cells.lattice;
    const [x, y] = this.pixel(...corner(cells, 0, cells.height));
    context.save();
    context.imageSmoothingEnabled = false;
    context.translate(x, y);
    context.rotate(-yaw);
    const size = resolution * this.view.scale;
    context.drawImage(this.picture, 0, 0, cells.width * size, cells.height * size);
    context.restore();
  }

  private path(context: CanvasRenderingContext2D, points: Point[]): void {
    context.beginPath();
    points.forEach(([x, y], i) => {
      const at = this.pixel(x, y);
      if (i === 0) context.moveTo(...at);
      else context.lineTo(...at);
    });
  }

  private line(context: CanvasRenderingContext2D, points: Point[], stroke: Stroke, theme: Theme): void {
    context.strokeStyle = stroke[theme];
    context.lineWidth = stroke.width;
    context.setLineDash(stroke.dash);
    this.path(context, points);
    context.stroke();
    context.setLineDash([]);
  }

  private drawScan(context: CanvasRenderingContext2D, moment: Moment, theme: Theme): void {
    if (!moment.scan) return;
    const { ranges, firstAngle, angleStep, maxRange } = moment.scan;
    const [x, y, theta] = moment.estimate;
    const colour = rgb(theme === "light" ? "#009e73" : "#2fc79a");
    const ends: Point[] = [];
    const fan: Point[] = [[x, y]];
    for (let beam = 0; beam < ranges.length; ++beam) {
      if (!(ranges[beam] > 0)) continue;
      const range = Math.min(ranges[beam], maxRange);
      const angle = theta + firstAngle + beam * angleStep;
      const end: Point = [x + range * Math.cos(angle), y + range * Math.sin(angle)];
      fan.push(end);
      if (ranges[beam] < maxRange) ends.push(end);
    }
    this.path(context, fan);
    context.closePath();
    context.fillStyle = css(colour, 0.1);
    context.fill();
    context.fillStyle = css(colour);
    for (const end of ends) {
      const [px, py] = this.pixel(...end);
      context.fillRect(px - 1.25, py - 1.25, 2.5, 2.5);
    }
  }

  private drawGraph(context: CanvasRenderingContext2D, exploration: Exploration, k: number, theme: Theme): void {
    const { poses, edges } = exploration.graph(k);
    context.lineWidth = 1.25;
    for (const loop of [false, true]) {
      context.strokeStyle = loop ? kLoop[theme] : css(rgb(kMuted[theme]), 0.6);
      context.beginPath();
      for (const edge of edges.values()) {
        const a = poses.get(edge.a), b = poses.get(edge.b);
        if (edge.loop !== loop || !a || !b) continue;
        context.moveTo(...this.pixel(a[0], a[1]));
        context.lineTo(...this.pixel(b[0], b[1]));
      }
      context.stroke();
    }
    context.fillStyle = kInk[theme];
    for (const [x, y] of poses.values()) {
      const [px, py] = this.pixel(x, y);
      context.beginPath();
      context.arc(px, py, 2.2, 0, 2 * Math.PI);
      context.fill();
    }
  }

  private drawTree(context: CanvasRenderingContext2D, decision: Decision, theme: Theme): void {
    const scale = valueScale(decision);
    if (!decision.tree || !scale) return;
    const { positions, parents, values } = decision.tree;
    context.lineWidth = 1;
    for (let i = 0; i < parents.length; ++i) {
      const parent = parents[i];
      if (parent < 0) continue;
      context.strokeStyle = css(ramp(theme, merit(scale, values[3 * i])), 0.8);
      context.beginPath();
      context.moveTo(...this.pixel(positions[3 * parent], positions[3 * parent + 1]));
      context.lineTo(...this.pixel(positions[3 * i], positions[3 * i + 1]));
      context.stroke();
    }
  }

  private drawCandidates(context: CanvasRenderingContext2D, decision: Decision, marked: number, theme: Theme): void {
    const scale = valueScale(decision);
    const order = decision.candidates.map((_, i) => i)
      .sort((a, b) => rank(decision, a, marked) - rank(decision, b, marked));
    for (const i of order) {
      const candidate = decision.candidates[i];
      if (candidate.points.length === 0) continue;
      const colour = ramp(theme, scale ? merit(scale, candidate.value) : 1);
      const heavy = i === decision.chosen || i === marked;
      if (heavy) this.stroke(context, candidate, kPaper[theme], 7);
      if (heavy) this.stroke(context, candidate, i === decision.chosen ? kInk[theme] : kMuted[theme], 5);
      this.stroke(context, candidate, css(colour), heavy ? 3 : 2);
      const [px, py] = this.pixel(...candidate.points[candidate.points.length - 1]);
      context.fillStyle = css(colour);
      context.strokeStyle = i === decision.chosen ? kInk[theme] : kPaper[theme];
      context.lineWidth = 1.5;
      context.beginPath();
      context.arc(px, py, heavy ? 5.5 : 4, 0, 2 * Math.PI);
      context.fill();
      context.stroke();
    }
  }

  private stroke(context: CanvasRenderingContext2D, candidate: Candidate, colour: string, width: number): void {
    context.strokeStyle = colour;
    context.lineWidth = width;
    this.path(context, candidate.points);
    context.stroke();
  }

  /** Of three standard deviations, about the newest pose that is kept. */
  private drawEllipse(context: CanvasRenderingContext2D, exploration: Exploration, k: number, theme: Theme): void {
    const { covariance } = exploration.moments[k];
    const newest = [...exploration.graph(k).poses.values()].at(-1);
    if (!covariance || !newest) return;
    const [xx, xy, yy] = covariance;
    const segments = ellipseSegments([newest[0], newest[1], 0], [xx, xy, 0, yy, 0, 0], 0, 2, kSigmas, kCorners);
    context.strokeStyle = theme === "light" ? "#d55e00" : "#ff8a3d";
    context.lineWidth = 1.75;
    context.beginPath();
    for (let i = 0; i < segments.length; i += 6) {
      context.moveTo(...this.pixel(segments[i], segments[i + 1]));
      context.lineTo(...this.pixel(segments[i + 3], segments[i + 4]));
    }
    context.stroke();
  }

  private drawRobot(context: CanvasRenderingContext2D, exploration: Exploration, [x, y, theta]: Pose, stroke: Stroke, theme: Theme): void {
    const radius = Math.max(4, (Number(exploration.header.robot?.radius) || 0.2) * this.view.scale);
    const [px, py] = this.pixel(x, y);
    context.strokeStyle = stroke[theme];
    context.lineWidth = 2;
    context.setLineDash(stroke.dash.length > 0 ? [3, 2] : []);
    context.beginPath();
    context.arc(px, py, radius, 0, 2 * Math.PI);
    context.moveTo(px, py);
    context.lineTo(px + 1.5 * radius * Math.cos(theta), py - 1.5 * radius * Math.sin(theta));
    context.stroke();
    context.setLineDash([]);
  }

  /** A length to compare with, at the lower left. */
  private drawScale(context: CanvasRenderingContext2D, theme: Theme): void {
    const metres = niceStep(80 / this.view.scale);
    const width = metres * this.view.scale, y = this.height - 14;
    context.strokeStyle = context.fillStyle = kInk[theme];
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(14, y - 4);
    context.lineTo(14, y);
    context.lineTo(14 + width, y);
    context.lineTo(14 + width, y - 4);
    context.stroke();
    context.font = '11.5px system-ui, "Segoe UI", "Helvetica Neue", Arial, "Liberation Sans", sans-serif';
    context.fillText(`${metres} m`, 18, y - 6);
  }
}

const point = ([x, y]: Pose): Point => [x, y];

function unknownColour(theme: Theme): [number, number, number, number] {
  return theme === "light" ? [226, 227, 225, 255] : [52, 57, 64, 255];
}

/** A corner of cells in the world. */
function corner({ lattice, x, y }: Cells, column: number, row: number): Point {
  const [u, v] = [(x + column) * lattice.resolution, (y + row) * lattice.resolution];
  const [c, s] = [Math.cos(lattice.yaw), Math.sin(lattice.yaw)];
  return [lattice.origin[0] + c * u - s * v, lattice.origin[1] + s * u + c * v];
}

/** What is drawn later lies above: the marked candidate, the chosen one, the better ones. */
function rank(decision: Decision, i: number, marked: number): number {
  if (i === marked) return Infinity;
  if (i === decision.chosen) return Number.MAX_VALUE;
  return -(decision.candidates[i].value ?? Number.MAX_VALUE);
}
