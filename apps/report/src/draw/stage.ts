// SPDX-License-Identifier: BSD-3-Clause
// The canvas: draws when something changed, coarser while it moves, and knows what is under the pointer.
import { SRGBColorSpace, WebGLRenderer } from "three";
import { EdgeClass, type Graph } from "../data/graph";
import { between, boundingBox, EyeControl, type Eye } from "./camera";
import { css, kInk, kPaper, kPrior, ramp, residualFraction } from "./colour";
import { Drawing, type Budget } from "./drawing";
import { planGrid, spaceGrid, type Grid } from "./grid";
import { Overlay, type Highlight, type Ring } from "./overlay";
import { nearestEdge, nearestPoint, project } from "./pick";
import type { Hit, ViewState } from "./state";

const kSettle = 160;          // [ms] without motion until everything is drawn
const kFrame = 1000 / 30;     // what a frame may take while moving [ms]
const kFewest = 6000;         // lines

/** Without a graphics card: everything is drawn by the processor. */
function drawsInSoftware(): { software: boolean; name: string } {
  const probe = document.createElement("canvas").getContext("webgl2");
  if (!probe) throw new Error("this browser offers no WebGL 2, which the picture needs");
  const info = probe.getExtension("WEBGL_debug_renderer_info");
  const name = String(probe.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : probe.RENDERER));
  probe.getExtension("WEBGL_lose_context")?.loseContext();
  return { software: /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name), name };
}

export class Stage {
  readonly canvas = document.createElement("canvas");
  readonly software: boolean;
  readonly rendererName: string;
  control = new EyeControl(true);
  state: ViewState | null = null;
  hovered: Hit | null = null;
  selected: Hit | null = null;
  onFrame: () => void = () => {};
  private readonly overlay = new Overlay(document.createElement("canvas"));
  private readonly renderer: WebGLRenderer;
  private drawing: Drawing | null = null;
  private grid: Grid | null = null;
  private requested = false;
  private lastMotion = -Infinity;
  private lastFrame = 0;
  private settleTimer = 0;
  private budget: number;
  private flight: { from: Eye; to: Eye; start: number; duration: number } | null = null;
  private screens = new Map<number, Float32Array>();
  private draws = 0;

  constructor(private readonly host: HTMLElement) {
    const { software, name } = drawsInSoftware();
    this.software = software;
    this.rendererName = name;
    this.budget = software ? 40000 : Infinity;
    this.renderer = new WebGLRenderer({ canvas: this.canvas, antialias: !software, powerPreference: "high-performance" });
    this.renderer.outputColorSpace = SRGBColorSpace;
    this.canvas.className = "graph";
    this.overlay.canvas.className = "overlay";
    this.overlay.canvas.setAttribute("aria-hidden", "true");
    host.append(this.canvas, this.overlay.canvas);
    new ResizeObserver(() => this.resize()).observe(host);
    this.canvas.addEventListener("webglcontextrestored", () => this.invalidate());
  }

  get graph(): Graph | null {
    return this.drawing?.graph ?? null;
  }
  get current(): Drawing | null {
    return this.drawing;
  }

  show(graph: Graph, state: ViewState): void {
    this.drawing?.dispose();
    this.hovered = this.selected = null;
    const first = graph.estimates[state.focus]?.positions;
    const clouds = first ? [first] : [];
    for (const recording of first ? [] : graph.recordings) clouds.push(recording.positions(recording.frames.length - 1));
    const box = boundingBox(clouds);
    this.drawing = new Drawing(graph, box);
    this.state = state;
    this.control = new EyeControl(graph.dimension === 2);
    this.resize();
    const [yaw, pitch] = graph.dimension === 2 ? [0, Math.PI / 2] : [-0.6, 0.5];
    this.control.setSize(box);
    this.control.eye = this.control.fitting(clouds, yaw, pitch);
    this.invalidate();
  }

  /** All positions that are shown. */
  private clouds(): Float32Array[] {
    const { drawing, state } = this;
    if (!drawing || !state) return [];
    const clouds = drawing.graph.estimates.filter((_, k) => state.shown[k] && k !== state.focus).map((e) => e.positions);
    if (state.shown[state.focus] || state.recording >= 0) clouds.push(drawing.positions(state));
    return clouds;
  }

  fit(yaw?: number, pitch?: number): void {
    this.flyTo(this.control.fitting(this.clouds(), yaw, pitch));
  }

  flyTo(eye: Eye): void {
    const still = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.flight = { from: this.control.eye, to: eye, start: performance.now(), duration: still ? 1 : 450 };
    this.moved();
  }

  private resize(): void {
    const { clientWidth: w, clientHeight: h } = this.host;
    if (w === 0 || h === 0) return;
    this.control.width = w;
    this.control.height = h;
    this.invalidate();
  }

  /** The view changed and may go on changing. */
  moved(): void {
    this.lastMotion = performance.now();
    this.invalidate();
  }

  invalidate(): void {
    if (this.requested) return;
    this.requested = true;
    this.canvas.dataset.still = "false";
    requestAnimationFrame((now) => {
      this.requested = false;
      this.frame(now);
    });
  }

  private frame(now: number): void {
    const { drawing, state } = this;
    if (!drawing || !state || this.host.clientWidth === 0) {
      this.canvas.dataset.still = "true";
      return;
    }
    this.fly(now);
    const moving = performance.now() - this.lastMotion < kSettle;
    if (moving) this.learn(now);
    else this.lastFrame = 0;
    const ratio = this.pixelRatio(moving);
    this.draw(moving ? { lines: this.budget, thick: !this.software } : { lines: Infinity, thick: true }, ratio);
    this.screens.clear();
    this.paintOverlay();
    this.canvas.dataset.draws = String(++this.draws);
    this.canvas.dataset.still = String(!moving && !this.requested);
    this.onFrame();
    window.clearTimeout(this.settleTimer);
    if (moving) this.settleTimer = window.setTimeout(() => this.invalidate(), kSettle + 10);
  }

  private fly(now: number): void {
    if (!this.flight) return;
    const { from, to, start, duration } = this.flight;
    const t = Math.min(1, (now - start) / duration);
    this.control.eye = between(from, to, Math.max(0, t));
    if (t < 1) this.moved();
    else this.flight = null;
  }

  /** As many lines as the last frames had time for. */
  private learn(now: number): void {
    const took = this.lastFrame > 0 ? now - this.lastFrame : 0;
    this.lastFrame = now;
    if (took <= 0 || took > 1000) return;
    const all = (this.drawing?.graph.edges.count ?? 0) * 4;
    // Down at once and up slowly, so that the picture does not pump.
    if (took > kFrame * 1.05) this.budget = Math.max(kFewest, Math.min(this.budget, all) * 0.75);
    else if (took < kFrame * 0.75) this.budget = Math.min(all, this.budget * 1.04);
  }

  private pixelRatio(moving: boolean): number {
    const device = window.devicePixelRatio || 1;
    if (!this.software) return Math.min(device, 2);
    // Without a graphics card lines are not smoothed: a still picture is drawn twice as large instead.
    return moving ? Math.min(device, 1) : 2;
  }

  private draw(budget: Budget, ratio: number): void {
    const { drawing, state, control } = this;
    if (!drawing || !state) return;
    const origin = drawing.graph.origin;
    this.grid = !state.grid ? null : control.plan ? planGrid(control, origin) : spaceGrid(control, drawing.box, origin, this.seen());
    drawing.update(state, control, this.grid, budget, ratio);
    if (this.renderer.getPixelRatio() !== ratio) this.renderer.setPixelRatio(ratio);
    const w = Math.round(control.width * ratio), h = Math.round(control.height * ratio);
    if (this.canvas.width !== w || this.canvas.height !== h) this.renderer.setSize(control.width, control.height, false);
    this.renderer.setClearColor(kPaper[state.theme]);
    this.renderer.render(drawing.scene, control.camera());
  }

  /** Whether a point is well within the picture. */
  private seen(): (p: [number, number, number]) => boolean {
    const matrix = this.viewProjection();
    const { width, height } = this.control;
    const out = new Float32Array(3);
    return (p) => {
      project(Float32Array.from(p), matrix, width, height, out);
      return out[0] > 40 && out[0] < width - 40 && out[1] > 20 && out[1] < height - 20;
    };
  }

  // What is where -------------------------------------------------------------------------------------

  private viewProjection(): number[] {
    const camera = this.control.camera();
    return camera.projectionMatrix.clone().multiply(camera.matrixWorldInverse).elements;
  }

  private screen(estimate: number): Float32Array {
    let screen = this.screens.get(estimate);
    if (!screen && this.drawing && this.state) {
      const xyz = this.drawing.positions(this.state, estimate);
      screen = new Float32Array(xyz.length);
      project(xyz, this.viewProjection(), this.control.width, this.control.height, screen);
      this.screens.set(estimate, screen);
    }
    return screen ?? new Float32Array();
  }

  at(variable: number, estimate = this.state?.focus ?? 0): [number, number] | null {
    const screen = this.screen(estimate);
    const x = screen[3 * variable], y = screen[3 * variable + 1];
    return Number.isFinite(x + y) ? [x, y] : null;
  }

  /** What is at a pixel of the canvas. */
  hit(x: number, y: number): Hit | null {
    const { drawing, state } = this;
    if (!drawing || !state) return null;
    const { edges, variables } = drawing.graph;
    const visible = drawing.graph.estimates.map((_, k) => k).filter((k) => state.shown[k] || (k === state.focus && state.recording >= 0));
    if (visible.length === 0 && state.recording >= 0) visible.push(state.focus);
    visible.sort((k) => (k === state.focus ? -1 : 1));
    let best: { hit: Hit; distance: number } | null = null;
    for (const estimate of visible) {
      const point = nearestPoint(this.screen(estimate), variables.count, x, y, 7, () => true);
      if (point.index >= 0 && (!best || point.distance < best.distance - 0.5)) {
        best = { hit: { kind: "variable", index: point.index, estimate }, distance: point.distance };
      }
    }
    // Where poses lie close together an edge must be reachable too: it wins when it is nearer by far.
    const count = drawing.edgesShown(state);
    const chi2 = drawing.chi2(state);
    for (const estimate of visible) {
      const inFocus = estimate === state.focus;
      const shown = (e: number) => state.classes[edges.class[e]] &&
        (inFocus || edges.class[e] === EdgeClass.odometry || edges.class[e] === EdgeClass.path);
      const edge = nearestEdge(this.screen(estimate), edges.a, edges.b, count, x, y, 5, shown, inFocus ? chi2 : null);
      const distance = edge.distance + 3;
      if (edge.index >= 0 && (!best || distance < best.distance)) {
        best = { hit: { kind: "edge", index: edge.index, estimate }, distance };
      }
    }
    return best?.hit ?? null;
  }

  hover(hit: Hit | null): void {
    this.hovered = hit;
    this.canvas.dataset.hovered = hit ? `${hit.kind} ${hit.index}` : "";
    this.paintOverlay();
  }

  /** Goes to a variable or an edge and marks it. */
  select(hit: Hit | null, fly: boolean): void {
    this.selected = hit;
    if (hit && fly) {
      const box = boundingBox([this.pointsOf(hit)]);
      const size = Math.hypot(...box.max.map((x, d) => x - box.min[d]));
      const eye = this.control.fitting([this.pointsOf(hit)]);
      const all = this.drawing ? Math.hypot(...this.drawing.box.max.map((x, d) => x - this.drawing!.box.min[d])) : 1;
      // Not so near that nothing else is left in the picture.
      eye.distance = Math.max(eye.distance * 1.6, 2.2 * size, hit.kind === "variable" ? 0.12 * all : 0.18 * all);
      this.flyTo(eye);
    }
    this.paintOverlay();
  }

  private pointsOf(hit: Hit): Float32Array {
    const xyz = this.drawing!.positions(this.state!, hit.estimate);
    const { a, b } = this.drawing!.graph.edges;
    const ends = hit.kind === "variable" ? [hit.index] : [a[hit.index], b[hit.index]].filter((i) => i >= 0);
    return Float32Array.from(ends.flatMap((i) => [...xyz.subarray(3 * i, 3 * i + 3)]));
  }

  // Over the picture -----------------------------------------------------------------------------------

  paintOverlay(): void {
    const { drawing, state, control } = this;
    if (!drawing || !state) return;
    const matrix = this.viewProjection();
    const one = new Float32Array(3);
    const toScreen = (p: [number, number, number]): [number, number] | null => {
      project(Float32Array.from(p), matrix, control.width, control.height, one);
      return Number.isFinite(one[0]) ? [one[0], one[1]] : null;
    };
    const moving = performance.now() - this.lastMotion < kSettle;
    const rings = moving && drawing.graph.variables.count > 20000 ? [] : this.rings();
    this.overlay.paint(control, state.theme, drawing.graph.origin, this.grid, toScreen, rings, this.highlights());
  }

  /** Priors as rings, held variables as squares. */
  private rings(): Ring[] {
    const { drawing, state } = this;
    if (!drawing || !state || !(state.shown[state.focus] || state.recording >= 0)) return [];
    const { edges, variables } = drawing.graph;
    const rings: Ring[] = [];
    const colour = kPrior[state.theme];
    if (state.classes[EdgeClass.prior]) {
      for (let e = 0; e < edges.count && rings.length < 500; ++e) {
        if (edges.class[e] !== EdgeClass.prior) continue;
        const at = this.at(edges.a[e]);
        if (at) rings.push({ x: at[0], y: at[1], colour, radius: 6 });
      }
    }
    for (const variable of variables.fixed) {
      const at = variable < variables.count ? this.at(variable) : null;
      if (at && rings.length < 1000) rings.push({ x: at[0], y: at[1], colour: kInk[state.theme], radius: 5.5, square: true });
    }
    return rings;
  }

  private highlights(): Highlight[] {
    const { drawing, state } = this;
    if (!drawing || !state) return [];
    const all: Highlight[] = [];
    for (const hit of [this.selected, this.hovered]) {
      if (!hit) continue;
      const strong = hit === this.selected;
      const { a, b } = drawing.graph.edges;
      const from = this.at(hit.kind === "variable" ? hit.index : a[hit.index], hit.estimate);
      const end = hit.kind === "edge" && b[hit.index] >= 0 ? this.at(b[hit.index], hit.estimate) : null;
      const chi2 = state.byResidual && hit.kind === "edge" && hit.estimate === state.focus ? drawing.chi2(state) : null;
      const colour = chi2 && drawing.scale
        ? css(ramp(state.theme, residualFraction(drawing.scale, chi2[hit.index]))) : kInk[state.theme];
      if (from) all.push({ from, to: end, colour, strong });
    }
    return all;
  }

  /** The picture as a PNG, with all that lies over it. */
  picture(): Promise<Blob | null> {
    this.lastMotion = -Infinity;
    this.draw({ lines: Infinity, thick: true }, 2);
    const out = document.createElement("canvas");
    out.width = this.canvas.width;
    out.height = this.canvas.height;
    const c = out.getContext("2d")!;
    c.drawImage(this.canvas, 0, 0);
    this.paintOverlay();
    c.drawImage(this.overlay.canvas, 0, 0, out.width, out.height);
    this.invalidate();
    return new Promise((resolve) => out.toBlob(resolve, "image/png"));
  }
}
