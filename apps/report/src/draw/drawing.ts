// SPDX-License-Identifier: BSD-3-Clause
// One graph, as objects of three.js, and how much of it is drawn at a time.
import { Matrix4, Scene, type Object3D, type Points, type LineSegments, type Material } from "three";
import { EdgeClass, type Graph } from "../data/graph";
import type { Box, EyeControl } from "./camera";
import { arcLengths, coarser, drawingOrder, membersOf, outliers, trajectoryChain, type Chain } from "./chains";
import {
  kGridLine, kInk, kLandmarkEdge, kLoop, kOtherEdge, kPaper, ramp, residualFraction, residualScale, rgb, strokes,
  type ResidualScale, type Rgb, type Stroke,
} from "./colour";
import { confidenceRadius, ellipseSegments } from "./ellipses";
import type { Grid } from "./grid";
import { axesLayer, EdgeBuffers, EdgeLayer, PlainLines, pointLayer, StateTexture } from "./layers";
import type { ViewState } from "./state";

const kWorst = 2000;             // edges that are drawn in order of their residual, after all others
const kOutlier = 5;              // times the 99th percentile of chi2
const kMostOutliers = 200;
const kMostEllipses = 3000;
const kPosesApart = 4;           // nearer to each other on the screen, poses are not drawn as dots [px]
const kEdgeLayers = [
  { class: EdgeClass.other, stroke: kOtherEdge, alpha: 0.5 },
  { class: EdgeClass.landmark, stroke: kLandmarkEdge, alpha: 0.4 },
  { class: EdgeClass.loop, stroke: kLoop, alpha: 0.55 },
];
/** Trajectories are also kept with so many edges made one. */
const kStrides = [1, 4, 16, 64];

interface TrajectoryLayers {
  byStride: EdgeLayer[];
  texture: StateTexture;
}

/** How many lines a frame may have; Infinity: everything, in full width. */
export interface Budget {
  lines: number;
  thick: boolean;
}

/** What stands back while residuals are looked at. */
function faint(colour: Rgb, paper: Rgb): Rgb {
  return colour.map((c, d) => 0.35 * c + 0.65 * paper[d]) as Rgb;
}

export class Drawing {
  readonly scene = new Scene();
  readonly strokes: Stroke[];
  readonly chain: Chain;
  scale: ResidualScale | null = null;
  /** Ellipses that are drawn and that there are. */
  ellipseCount = { drawn: 0, all: 0 };

  private readonly shared = {
    viewProjection: { value: new Matrix4() },
    viewport: { value: [1, 1] },
    depthRange: { value: [0, 0] },
    fadeMost: { value: 0.65 },
    paper: { value: [1, 1, 1] },
    stops: { value: [0, 1, 2, 3, 4].flatMap((k) => ramp("light", k / 4)) },
    pixelsPerMetre: { value: 1 },
    edgesShown: { value: 2 ** 31 - 1 },
  };
  private readonly trajectories: TrajectoryLayers[];
  private readonly chainBuffers: EdgeBuffers[];
  private edgeLayers: EdgeLayer[] = [];
  private orderedBy: Float32Array | null | undefined;
  private valuedBy: Float32Array | null | undefined;
  private scaledBy: Float32Array | null | undefined;
  private outlierLayer: EdgeLayer | null = null;
  private outliersOf: { chi2: Float32Array | null; classes: string } = { chi2: null, classes: "" };
  private readonly frames: [StateTexture, StateTexture];
  private framesHeld: [number, number, number] = [-1, -1, -1];
  private focusUniforms: Record<string, { value: unknown }> = {
    from: { value: null }, to: { value: null }, blend: { value: 0 },
  };
  private readonly poses: Points;
  private readonly landmarks: Points;
  private axes: LineSegments | null = null;
  private readonly orientation: StateTexture;
  private orientedBy: Float32Array | null = null;
  private readonly ellipses: PlainLines;
  private ellipsesMade = "";
  private readonly grid: PlainLines;
  private readonly pointUniforms = [
    { size: { value: 4 }, colour: { value: [0, 0, 0] }, diamond: { value: false }, rimmed: { value: false } },
    { size: { value: 7 }, colour: { value: [0, 0, 0] }, diamond: { value: true }, rimmed: { value: true } },
  ];
  private readonly axisLength: number;
  private readonly axisColours = { value: new Array<number>(9).fill(0) };

  constructor(readonly graph: Graph, readonly box: Box) {
    const n = graph.variables.count;
    this.strokes = strokes(graph.estimates.map((estimate) => estimate.role));
    this.chain = trajectoryChain(graph.edges);
    this.chainBuffers = kStrides.filter((s) => s === 1 || this.chain.a.length / s > 500)
      .map((s) => (s === 1 ? this.chain : coarser(this.chain, s)))
      .map((chain) => new EdgeBuffers(chain.a, chain.b, chain.edge, n));
    this.frames = [new StateTexture(n), new StateTexture(n)];
    this.orientation = new StateTexture(n);
    this.trajectories = graph.estimates.map((_, k) => this.trajectoryLayers(k));
    const role = (wanted: string) => Int32Array.from({ length: n }, (_, i) => i)
      .filter((i) => graph.variables.types[graph.variables.type[i]]?.role === wanted);
    const plain = { paper: this.shared.paper, viewProjection: this.shared.viewProjection };
    const pointShared = { ...this.shared, ...this.focusUniforms };
    this.poses = pointLayer(role("pose"), pointShared, this.pointUniforms[0]);
    this.landmarks = pointLayer(role("landmark"), pointShared, this.pointUniforms[1]);
    this.poses.renderOrder = this.landmarks.renderOrder = 5;
    this.ellipses = new PlainLines({ ...plain, colour: { value: [0, 0, 0] }, alpha: { value: 0.5 } });
    this.grid = new PlainLines({ ...plain, colour: { value: [0, 0, 0] }, alpha: { value: 1 } });
    (this.grid.object.material as Material).depthTest = graph.dimension === 3;
    this.grid.object.renderOrder = -10;
    this.axisLength = 0.6 * this.typicalStep();
    this.scene.add(this.poses, this.landmarks, this.ellipses.object, this.grid.object);
  }

  /** Median length of a trajectory's edges [m]. */
  private typicalStep(): number {
    const xyz = this.graph.estimates[0]?.positions ?? this.graph.recordings[0].positions(0);
    const lengths: number[] = [];
    const stride = Math.max(1, Math.floor(this.chain.a.length / 2000));
    for (let k = 0; k < this.chain.a.length; k += stride) {
      const i = 3 * this.chain.a[k], j = 3 * this.chain.b[k];
      const d = Math.hypot(xyz[i] - xyz[j], xyz[i + 1] - xyz[j + 1], xyz[i + 2] - xyz[j + 2]);
      if (d > 0) lengths.push(d);
    }
    lengths.sort((a, b) => a - b);
    return lengths[lengths.length >> 1] ?? Math.hypot(...this.box.max.map((x, d) => x - this.box.min[d])) / 50;
  }

  private trajectoryLayers(k: number): TrajectoryLayers {
    const estimate = this.graph.estimates[k];
    const stroke = this.strokes[k];
    const texture = new StateTexture(this.graph.variables.count).setPositions(estimate.positions);
    const own = {
      from: { value: texture.texture }, to: { value: texture.texture }, blend: { value: 0 },
      colour: { value: [0, 0, 0] }, width: { value: [1, 1] }, alpha: { value: 1 }, byResidual: { value: false },
      dash: { value: [0, 0, 0, 0] },
    };
    const dashed = stroke.dash.length > 0;
    const byStride = this.chainBuffers.map((buffers, s) => {
      const arcs = dashed && s === 0 ? arcLengths(this.chain, estimate.positions) : null;
      const layer = new EdgeLayer(buffers, this.shared, own, arcs, "opaque").order(2);
      this.scene.add(...layer.objects);
      return layer;
    });
    return { byStride, texture };
  }

  /** Loop closures and the like, in the order of the residuals of the estimate in focus. */
  private orderEdges(chi2: Float32Array | null): void {
    if (this.orderedBy === chi2) return;
    this.orderedBy = chi2;
    for (const layer of this.edgeLayers) {
      this.scene.remove(...layer.objects);
      layer.dispose();
    }
    const { edges, variables } = this.graph;
    this.edgeLayers = kEdgeLayers.map((what, k) => {
      const order = drawingOrder(membersOf(edges, [what.class]), chi2, kWorst);
      const buffers = new EdgeBuffers(order.map((e) => edges.a[e]), order.map((e) => edges.b[e]), order, variables.count);
      const own = {
        colour: { value: [0, 0, 0] }, width: { value: [1, 1] }, alpha: { value: what.alpha },
        byResidual: { value: false }, dash: { value: [0, 0, 0, 0] },
      };
      const layer = new EdgeLayer(buffers, { ...this.shared, ...this.focusUniforms }, own, null, "blended").order(3 + 0.1 * k);
      this.scene.add(...layer.objects);
      return layer;
    });
    this.valuedBy = undefined;
  }

  /** Over all edges, so only when they change. One scale for a whole recording, so that residuals are seen to fall. */
  private rescale(chi2: Float32Array | null): void {
    if (this.scaledBy === chi2) return;
    this.scaledBy = chi2;
    this.scale = chi2 ? residualScale(chi2) : null;
    this.valuedBy = undefined;
  }

  private setValues(chi2: Float32Array | null): void {
    if (this.valuedBy === chi2) return;
    this.valuedBy = chi2;
    const scale = this.scale;
    const fraction = (e: number) => (scale && chi2 ? residualFraction(scale, chi2[e]) : 0);
    for (const buffers of [...this.chainBuffers, ...this.edgeLayers.map((layer) => layer.buffers)]) {
      buffers.setValues(fraction);
    }
  }

  /** x y z of the estimate in focus, or of the recording's frame. */
  positions(state: ViewState, estimate = state.focus): Float32Array {
    const recording = this.graph.recordings[state.recording];
    if (recording && estimate === state.focus) return recording.positions(Math.round(state.frame));
    return this.graph.estimates[estimate]?.positions ?? new Float32Array(3 * this.graph.variables.count).fill(NaN);
  }

  chi2(state: ViewState): Float32Array | null {
    const frame = this.graph.recordings[state.recording]?.frames[Math.round(state.frame)];
    return frame?.edgeChi2 ?? this.graph.estimates[state.focus]?.edgeChi2 ?? null;
  }

  edgesShown(state: ViewState): number {
    const frame = this.graph.recordings[state.recording]?.frames[Math.round(state.frame)];
    return frame ? frame.edges : this.graph.edges.count;
  }

  /** Puts the state into uniforms and visibilities. `ratio`: pixels of the canvas for one of the page. */
  update(state: ViewState, control: EyeControl, grid: Grid | null, budget: Budget, ratio: number): void {
    const { theme } = state;
    const focused = this.graph.estimates[state.focus];
    this.rescale(focused?.edgeChi2 ?? this.chi2(state));
    this.orderEdges(focused?.edgeChi2 ?? null);
    if (state.byResidual) this.setValues(this.chi2(state));
    const camera = control.camera();
    this.shared.viewProjection.value.multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    this.shared.viewport.value = [control.width * ratio, control.height * ratio];
    this.shared.paper.value = rgb(kPaper[theme]);
    this.shared.stops.value = [0, 1, 2, 3, 4].flatMap((k) => ramp(theme, k / 4));
    this.shared.edgesShown.value = this.edgesShown(state);
    this.shared.pixelsPerMetre.value = ratio * 2 ** Math.round(Math.log2(1 / control.metresPerPixel));
    const size = Math.hypot(...this.box.max.map((x, d) => x - this.box.min[d]));
    this.shared.depthRange.value = control.plan ? [0, 0]
      : [Math.max(0, control.eye.distance - 0.3 * size), control.eye.distance + 0.6 * size];
    this.setFocus(state);
    this.setTrajectories(state, budget, ratio);
    this.setEdges(state, budget, ratio);
    this.setOutliers(state, ratio);
    this.setPoints(state, control, budget, ratio);
    this.setAxes(state, budget);
    this.setEllipses(state);
    const gridColour = (this.grid.object.material as unknown as { uniforms: { colour: { value: unknown } } }).uniforms;
    gridColour.colour.value = rgb(kGridLine[theme]);
    this.grid.object.visible = grid !== null;
    if (grid) this.grid.set(grid.lines);
  }

  private setFocus(state: ViewState): void {
    const recording = this.graph.recordings[state.recording];
    const u = this.focusUniforms;
    if (!recording) {
      const texture = this.trajectories[state.focus]?.texture.texture ?? null;
      u.from.value = u.to.value = texture;
      u.blend.value = 0;
      return;
    }
    const first = Math.floor(state.frame);
    const second = Math.min(recording.frames.length - 1, Math.ceil(state.frame));
    if (this.framesHeld[0] === state.recording && this.framesHeld[2] === first && first !== second) {
      this.frames.reverse();  // a step on: what came next is what is
      this.framesHeld = [state.recording, first, -1];
    }
    if (this.framesHeld[0] !== state.recording || this.framesHeld[1] !== first) {
      this.frames[0].setPositions(recording.positions(first));
    }
    if (this.framesHeld[0] !== state.recording || this.framesHeld[2] !== second) {
      this.frames[1].setPositions(recording.positions(second));
    }
    this.framesHeld = [state.recording, first, second];
    u.from.value = this.frames[0].texture;
    u.to.value = this.frames[1].texture;
    u.blend.value = state.frame - first;
  }

  private setTrajectories(state: ViewState, budget: Budget, ratio: number): void {
    const lines = this.graph.edges.class;
    const odometry = state.classes[EdgeClass.odometry] || (this.chain.edge.length > 0 && lines[this.chain.edge[0]] === EdgeClass.path);
    const visible = state.shown.filter(Boolean).length || 1;
    const share = (budget.lines * 0.5) / visible;
    let level = this.chainBuffers.findIndex((buffers) => buffers.count <= share);
    if (level < 0) level = this.chainBuffers.length - 1;
    this.trajectories.forEach((trajectory, k) => {
      const inFocus = k === state.focus;
      const recorded = inFocus && state.recording >= 0;
      const stroke = this.strokes[k];
      trajectory.byStride.forEach((layer, s) => {
        const shown = odometry && (state.shown[k] || recorded) && s === level;
        layer.show(!shown ? "hidden" : budget.thick ? "thick" : "thin");
        const u = layer.uniforms;
        u.from.value = recorded ? this.focusUniforms.from.value : trajectory.texture.texture;
        u.to.value = recorded ? this.focusUniforms.to.value : trajectory.texture.texture;
        u.blend.value = recorded ? this.focusUniforms.blend.value : 0;
        u.colour.value = state.byResidual && !inFocus ? faint(rgb(stroke[state.theme]), rgb(kPaper[state.theme])) : rgb(stroke[state.theme]);
        u.byResidual.value = state.byResidual && inFocus;
        const worst = Math.max(stroke.width, 4);
        u.width.value = budget.thick ? [stroke.width * ratio, worst * ratio] : [0, 0];
        const dash = recorded ? [] : stroke.dash;
        u.dash.value = s > 0 ? [0, 0, 0, 0] : [0, 1, 2, 3].map((d) => (dash[d] ?? 0));
        // The truth is thin and dashed: a good estimate would hide it.
        layer.order(this.graph.estimates[k].role === "truth" ? 2.75 : inFocus ? 2.5 : 2);
      });
    });
  }

  private setEdges(state: ViewState, budget: Budget, ratio: number): void {
    const visible = state.shown[state.focus] || state.recording >= 0;
    const total = this.edgeLayers.reduce((sum, layer, k) =>
      sum + (state.classes[kEdgeLayers[k].class] ? layer.buffers.count : 0), 0);
    const fraction = Math.min(1, (budget.lines * 0.5) / Math.max(1, total));
    // Wide lines for everything cost little up to here; beyond, hair lines show more.
    const wide = budget.thick && total <= 60000;
    this.edgeLayers.forEach((layer, k) => {
      const what = kEdgeLayers[k];
      const n = layer.buffers.count;
      const count = fraction < 1 ? Math.ceil(n * fraction) : n;
      const shown = visible && state.classes[what.class];
      layer.show(!shown ? "hidden" : wide ? "thick" : "thin", count);
      const u = layer.uniforms;
      u.colour.value = rgb(what.stroke[state.theme]);
      u.byResidual.value = state.byResidual;
      u.width.value = wide ? [what.stroke.width * ratio, 4.5 * ratio] : [0, 0];
      const crowded = total > 100000 && fraction >= 1;
      u.alpha.value = state.byResidual ? 0.9 : crowded ? 0.6 * what.alpha : what.alpha;
    });
  }

  /** Among hundreds of thousands of edges a wrong one is behind others: those that stand far out are drawn over everything. */
  private setOutliers(state: ViewState, ratio: number): void {
    const chi2 = state.byResidual ? this.chi2(state) : null;
    const classes = state.classes.join();
    if (chi2 && (this.outliersOf.chi2 !== chi2 || this.outliersOf.classes !== classes)) {
      this.outliersOf = { chi2, classes };
      if (this.outlierLayer) {
        this.scene.remove(...this.outlierLayer.objects);
        this.outlierLayer.dispose();
      }
      const { edges, variables } = this.graph;
      const worst = outliers(chi2, kOutlier, kMostOutliers, (e) => edges.b[e] >= 0 && state.classes[edges.class[e]]);
      const order = Int32Array.from(worst.reverse());
      const buffers = new EdgeBuffers(order.map((e) => edges.a[e]), order.map((e) => edges.b[e]), order, variables.count);
      const own = {
        colour: { value: [0, 0, 0] }, width: { value: [1, 1] }, alpha: { value: 1 }, byResidual: { value: true },
        dash: { value: [0, 0, 0, 0] },
      };
      this.outlierLayer = new EdgeLayer(buffers, { ...this.shared, ...this.focusUniforms }, own, null, "through").order(6);
      const scale = this.scale;
      if (scale) buffers.setValues((e) => residualFraction(scale, chi2[e]));
      this.scene.add(...this.outlierLayer.objects);
    }
    if (!this.outlierLayer) return;
    const visible = chi2 !== null && (state.shown[state.focus] || state.recording >= 0);
    this.outlierLayer.show(visible ? "thick" : "hidden");
    this.outlierLayer.uniforms.width.value = [1.5 * ratio, 5 * ratio];
  }

  private setPoints(state: ViewState, control: EyeControl, budget: Budget, ratio: number): void {
    const visible = state.shown[state.focus] || state.recording >= 0;
    const [pose, landmark] = this.pointUniforms;
    const stroke = this.strokes[state.focus] ?? this.strokes[0];
    // Poses are dots between 2 and 6 pixels, by how far apart they are on the screen.
    const apart = this.axisLength / 0.6 / control.metresPerPixel;
    const dot = Math.max(2, Math.min(6, 0.3 * apart));
    pose.size.value = ratio * dot;
    pose.rimmed.value = dot > 4.5;
    const colour = rgb(stroke ? stroke[state.theme] : kInk[state.theme]);
    pose.colour.value = state.byResidual ? faint(colour, rgb(kPaper[state.theme])) : colour;
    landmark.size.value = ratio * Math.max(4, Math.min(9, 4 + apart * 0.2));
    landmark.colour.value = rgb(kLandmarkEdge[state.theme]);
    const n = this.poses.geometry.getAttribute("variable").count;
    this.poses.visible = visible && state.poses && n > 0 && n <= budget.lines && apart > kPosesApart;
    this.landmarks.visible = visible && state.landmarks && this.landmarks.geometry.getAttribute("variable").count > 0;
  }

  private setAxes(state: ViewState, budget: Budget): void {
    const turns = this.graph.estimates[state.focus]?.orientation ?? null;
    const wanted = state.headings && turns !== null && state.recording < 0 && state.shown[state.focus];
    if (this.axes) this.axes.visible = false;
    if (!wanted) return;
    if (!this.axes) {
      const own = {
        orientation: { value: this.orientation.texture }, reach: { value: this.axisLength },
        axisColours: this.axisColours, alpha: { value: 1 }, dash: { value: [0, 0, 0, 0] },
      };
      const members = this.poses.geometry.getAttribute("variable").array as Int32Array;
      this.axes = axesLayer(members, this.graph.dimension === 2 ? 1 : 3, { ...this.shared, ...this.focusUniforms }, own);
      this.axes.renderOrder = 4;
      this.scene.add(this.axes);
    }
    if (this.orientedBy !== turns) this.orientation.setOrientations((this.orientedBy = turns));
    const dark = state.theme === "dark";
    const spatial = dark ? ["#ff8a3d", "#2fc79a", "#56b4e9"] : ["#d55e00", "#009e73", "#0072b2"];
    const plain = [kInk[state.theme], kInk[state.theme], kInk[state.theme]];
    this.axisColours.value = (this.graph.dimension === 2 ? plain : spatial).flatMap(rgb);
    this.axes.visible = this.axes.geometry.getIndex()!.count / 2 <= budget.lines;
  }

  private setEllipses(state: ViewState): void {
    const covariance = this.graph.estimates[state.focus]?.covariance ?? null;
    const visible = covariance !== null && state.ellipses && state.recording < 0 && state.shown[state.focus];
    this.ellipses.object.visible = visible;
    if (!visible || !covariance) return;
    const u = (this.ellipses.object.material as unknown as { uniforms: { colour: { value: unknown } } }).uniforms;
    const colour = rgb(this.strokes[state.focus][state.theme]);
    u.colour.value = state.byResidual ? faint(colour, rgb(kPaper[state.theme])) : colour;
    const made = [state.focus, state.probability, state.magnify].join();
    if (made === this.ellipsesMade) return;
    this.ellipsesMade = made;
    const all = covariance.variable.length;
    const every = Math.ceil(all / kMostEllipses);
    const radius = state.magnify * confidenceRadius(state.probability, this.graph.dimension);
    const xyz = this.graph.estimates[state.focus].positions;
    const points: number[] = [];
    let drawn = 0;
    for (let k = 0; k < all; k += every) {
      const centre = xyz.subarray(3 * covariance.variable[k], 3 * covariance.variable[k] + 3);
      const segments = ellipseSegments(centre, covariance.upper, 6 * k, this.graph.dimension, radius, 28);
      for (const x of segments) points.push(x);
      drawn += segments.length > 0 ? 1 : 0;
    }
    this.ellipseCount = { drawn, all };
    this.ellipses.set(Float32Array.from(points));
  }

  dispose(): void {
    const layers = [...this.trajectories.flatMap((t) => t.byStride), ...this.edgeLayers];
    if (this.outlierLayer) layers.push(this.outlierLayer);
    for (const layer of layers) layer.dispose();
    for (const texture of [...this.frames, this.orientation, ...this.trajectories.map((t) => t.texture)]) texture.dispose();
    for (const object of [this.poses, this.landmarks, this.axes] as (Object3D | null)[]) {
      (object as Points | null)?.geometry.dispose();
      ((object as Points | null)?.material as Material | undefined)?.dispose();
    }
    this.ellipses.dispose();
    this.grid.dispose();
  }
}
