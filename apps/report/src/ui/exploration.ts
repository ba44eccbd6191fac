// SPDX-License-Identifier: BSD-3-Clause
// A robot that explores: its map with a slider through the run, and what it decided.
import type { Decision, Exploration, Moment } from "../data/exploration";
import { css, kInk, kLoop, kMuted, ramp, strokes, type Stroke } from "../draw/colour";
import { FloorDrawing, kFloorLayers, merit, valueScale, type FloorLayer, type Shown } from "../draw/floor";
import { checkbox, choice, el, freshId, icon, iconButton, svg } from "./dom";
import { count, kNone, metres, number, plural } from "./format";
import { lineSample, shapeSample } from "./swatch";
import { onTheme, theme } from "./theme";

const kMomentsASecond = 8;
const kSpeeds: [number, string][] = [[0.5, "½ ×"], [1, "1 ×"], [4, "4 ×"], [16, "16 ×"]];
const kListed = 12;

const kLayerNames: Record<FloorLayer, string> = {
  map: "Map", scan: "Scan", graph: "Graph and loop closures", trajectory: "Trajectory as estimated", truth: "True trajectory",
  ellipse: "3σ ellipse of the position", candidates: "Candidates", tree: "Tree of paths",
};

function layerSample(layer: FloorLayer): SVGSVGElement | null {
  const [estimate, , truth] = strokes(["estimate", "initial", "truth"]);
  const plain = (light: string, dark: string): Stroke => ({ light, dark, width: 2, dash: [] });
  switch (layer) {
    case "map": return shapeSample("square", kInk[theme()]);
    case "scan": return shapeSample("circle", theme() === "light" ? "#009e73" : "#2fc79a");
    case "graph": return lineSample({ ...kLoop, dash: [] });
    case "trajectory": return lineSample(estimate);
    case "truth": return lineSample(truth);
    case "ellipse": return shapeSample("ring", theme() === "light" ? "#d55e00" : "#ff8a3d");
    case "candidates": return lineSample(plain(css(ramp("light", 0.6)), css(ramp("dark", 0.6))));
    case "tree": return lineSample(plain(kMuted.light, kMuted.dark));
  }
}

/** How far the estimate is from the truth [m]. */
function error(moment: Moment): number | null {
  return moment.truth ? Math.hypot(moment.estimate[0] - moment.truth[0], moment.estimate[1] - moment.truth[1]) : null;
}

export class ExplorationView {
  readonly element = el("div", { class: "map" });
  private exploration: Exploration | null = null;
  private at = 0;
  private marked = -1;
  private playing = false;
  private position = 0;
  private last = 0;
  private speed = 1;
  private requested = false;
  private fitted = false;
  /** By hand: then the view stays where it is while the run goes on. */
  private placed = false;
  private layersThere = "";
  private readonly shown = Object.fromEntries(kFloorLayers.map((layer) => [layer, true])) as Shown;
  private readonly canvas = el("canvas", { class: "floor graph-like", tabindex: 0, role: "application", "aria-roledescription": "map" });
  private readonly drawing = new FloorDrawing(this.canvas);
  private readonly host = el("div", { class: "canvas-host" }, this.canvas);
  private readonly slider = el("input", { type: "range", min: 0, step: 1, "aria-label": "Motion of the run" });
  private readonly text = el("output", { class: "frame-text" });
  private readonly curve = svg("svg", { class: "curve", preserveAspectRatio: "none", "aria-hidden": "true" });
  private readonly playButton = iconButton("play", "Play", () => this.toggle(), { class: "icon-button prominent" });
  private readonly now = el("section", {});
  private readonly decision = el("section", {});
  private readonly layers = el("section", {});

  constructor() {
    this.host.append(el("div", { class: "tools", role: "group", "aria-label": "View" },
      iconButton("plus", "Nearer (+)", () => this.zoom(1.25)), iconButton("minus", "Farther (−)", () => this.zoom(0.8)),
      iconButton("fit", "Show all (F)", () => this.fit())));
    const bar = el("div", { class: "playback active", role: "group", "aria-label": "Recording" },
      this.playButton, iconButton("back", "One motion back", () => this.step(-1)), iconButton("forward", "One motion on", () => this.step(1)),
      el("div", { class: "track" }, this.curve, this.slider), this.text,
      iconButton("back", "Decision before", () => this.toDecision(-1)), iconButton("forward", "Next decision", () => this.toDecision(1)),
      choice("Speed", kSpeeds, 1, (speed) => (this.speed = speed)));
    const panel = el("aside", { class: "panel", "aria-label": "State, decision and switches" }, this.now, this.decision, this.layers);
    this.element.append(el("div", { class: "map-main" }, this.host, bar), panel);
    this.slider.addEventListener("input", () => {
      this.playing = false;
      this.go(Number(this.slider.value));
    });
    this.listen();
    new ResizeObserver(() => {
      if (!this.fitted && this.canvas.clientWidth > 0) this.fit();
      this.draw();
    }).observe(this.host);
    onTheme(() => {
      this.buildLayers();
      this.refresh();
    });
  }

  show(exploration: Exploration): void {
    this.exploration = exploration;
    this.playing = false;
    this.fitted = false;
    this.slider.max = String(exploration.moments.length - 1);
    this.canvas.setAttribute("aria-label", `${exploration.name}: map and trajectory of a robot. Arrow keys move, plus and minus zoom, F shows all.`);
    this.outline();
    this.buildLayers();
    this.go(exploration.moments.length - 1);
    if (this.canvas.clientWidth > 0) this.fit();
  }

  /** The run has gone on; who sees its end goes on, too. */
  grow(): void {
    const { exploration } = this;
    if (!exploration) return;
    const sawEnd = this.at === Number(this.slider.max) && !this.playing;
    this.slider.max = String(exploration.moments.length - 1);
    this.outline();
    if (JSON.stringify(this.there(exploration)) !== this.layersThere) this.buildLayers();
    if (sawEnd) this.go(exploration.moments.length - 1);
    else this.refresh();
    if (!this.placed && this.canvas.clientWidth > 0) this.fit();
  }

  /** Shows the moment of a decision. */
  open(decision: Decision): void {
    this.playing = false;
    this.go(decision.at);
  }

  private listen(): void {
    let from: { x: number; y: number } | null = null;
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      from = { x: event.clientX, y: event.clientY };
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (!from) return;
      this.placed = true;
      this.drawing.pan(event.clientX - from.x, event.clientY - from.y);
      from = { x: event.clientX, y: event.clientY };
      this.draw();
    });
    for (const end of ["pointerup", "pointercancel"]) this.canvas.addEventListener(end, () => (from = null));
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.placed = true;
      const box = this.canvas.getBoundingClientRect();
      const lines = event.deltaMode === 1 ? 16 : event.deltaMode === 2 ? 100 : 1;
      this.drawing.zoom(Math.exp(-Math.max(-0.5, Math.min(0.5, event.deltaY * lines * 0.0015))), event.clientX - box.left, event.clientY - box.top);
      this.draw();
    }, { passive: false });
    this.canvas.addEventListener("keydown", (event) => this.key(event));
  }

  private key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const arrows: Record<string, [number, number]> = { ArrowLeft: [40, 0], ArrowRight: [-40, 0], ArrowUp: [0, 40], ArrowDown: [0, -40] };
    if (event.key in arrows || event.key === "+" || event.key === "=" || event.key === "-") this.placed = true;
    if (event.key in arrows) this.drawing.pan(...arrows[event.key]);
    else if (event.key === "+" || event.key === "=") this.drawing.zoom(1.2);
    else if (event.key === "-") this.drawing.zoom(1 / 1.2);
    else if (event.key === "f" || event.key === "F") this.fit();
    else if (event.key === "[") this.step(-1);
    else if (event.key === "]") this.step(1);
    else if (event.key === " ") this.toggle();
    else return;
    event.preventDefault();
    this.draw();
  }

  private zoom(factor: number): void {
    this.placed = true;
    this.drawing.zoom(factor);
    this.draw();
  }

  private fit(): void {
    if (!this.exploration) return;
    this.fitted = true;
    this.placed = false;
    this.drawing.fit(this.exploration);
    this.draw();
  }

  // Time --------------------------------------------------------------------------------------------

  private go(k: number): void {
    if (!this.exploration) return;
    this.at = Math.max(0, Math.min(this.exploration.moments.length - 1, Math.round(k)));
    this.position = this.at;
    this.marked = -1;
    this.slider.value = String(this.at);
    this.refresh();
  }

  private step(by: number): void {
    this.playing = false;
    this.go(this.at + by);
  }

  private toDecision(by: number): void {
    const all = this.exploration?.decisions ?? [];
    const next = by > 0 ? all.find((d) => d.at > this.at) : all.filter((d) => d.at < this.at).at(-1);
    if (next) this.open(next);
  }

  private toggle(): void {
    if (!this.exploration) return;
    this.playing = !this.playing;
    if (this.playing) {
      if (this.at >= this.exploration.moments.length - 1) this.go(0);
      this.last = performance.now();
      requestAnimationFrame((now) => this.advance(now));
    }
    this.refresh();
  }

  private advance(now: number): void {
    if (!this.playing || !this.exploration) return;
    const position = this.position + (Math.max(0, now - this.last) / 1000) * kMomentsASecond * this.speed;
    this.last = now;
    if (position >= this.exploration.moments.length - 1) this.playing = false;
    if (Math.floor(position) !== this.at || !this.playing) this.go(Math.floor(position));
    this.position = position;
    if (this.playing) requestAnimationFrame((later) => this.advance(later));
  }

  /** The known area behind the slider. */
  private outline(): void {
    const areas = this.exploration!.moments.map((moment) => moment.coverage);
    const most = Math.max(...areas.map((area) => area ?? 0));
    this.curve.setAttribute("viewBox", `0 0 ${Math.max(1, areas.length - 1)} 1`);
    this.curve.replaceChildren();
    if (!(most > 0) || areas.length < 2) return;
    const points = areas.map((area, k) => `${k} ${(0.95 - (0.9 * (area ?? 0)) / most).toFixed(4)}`);
    this.curve.append(svg("path", { d: `M${points.join("L")}`, "vector-effect": "non-scaling-stroke" }));
  }

  // What is shown -----------------------------------------------------------------------------------

  private draw(): void {
    if (this.requested) return;
    this.requested = true;
    requestAnimationFrame(() => {
      this.requested = false;
      if (!this.exploration || this.canvas.clientWidth === 0) return;
      this.drawing.draw(this.exploration, this.at, this.shown, this.marked, theme());
      this.canvas.dataset.moment = String(this.at);
    });
  }

  private refresh(): void {
    const { exploration } = this;
    if (!exploration) return;
    const moment = exploration.moments[this.at];
    this.text.textContent = `${moment.label} · ${moment.distance.toFixed(1)} m`;
    this.slider.setAttribute("aria-valuetext", this.text.textContent);
    this.playButton.replaceChildren(icon(this.playing ? "pause" : "play"));
    this.playButton.title = this.playing ? "Pause" : "Play";
    this.playButton.setAttribute("aria-label", this.playButton.title);
    this.buildState(exploration, moment);
    this.buildDecision(exploration);
    this.draw();
  }

  private buildState(exploration: Exploration, moment: Moment): void {
    const off = error(moment);
    const rows: [string, string][] = [
      ["driven", `${moment.distance.toFixed(1)} m`], ["known", `${number(moment.coverage, 4)} m²`],
      ["map entropy", `${number(moment.mapEntropy, 4)} nats·m²`], ["trajectory entropy", `${number(moment.trajectoryEntropy, 4)} nats`],
      ["poses kept", count(moment.kept)], ["loop closures", count(moment.loops)], ["collisions", count(moment.collisions)],
      ["position error", off === null ? kNone : `${metres(off)} m`],
    ];
    const children: Node[] = [el("h2", {}, moment.label), el("dl", { class: "facts" }, ...rows.flatMap(([name, text]) => [el("dt", {}, name), el("dd", {}, text)]))];
    if (moment.label === "end") children.push(el("p", { class: "hint" }, `${exploration.end}: ${exploration.why}`));
    else if (!exploration.complete && this.at === exploration.moments.length - 1) children.push(el("p", { class: "hint" }, "The recording ends here: the run was killed, or goes on."));
    this.now.replaceChildren(...children);
  }

  private buildDecision(exploration: Exploration): void {
    const decision = exploration.decisionAt(this.at);
    if (!decision) return this.decision.replaceChildren(el("h2", {}, "Decision"), el("p", { class: "hint" }, "None yet."));
    const scale = valueScale(decision);
    const order = decision.candidates.map((_, i) => i)
      .sort((a, b) => (decision.candidates[a].value ?? Infinity) - (decision.candidates[b].value ?? Infinity));
    const listed = order.slice(0, kListed);
    if (decision.chosen >= 0 && !listed.includes(decision.chosen) && decision.chosen < decision.candidates.length) listed.push(decision.chosen);
    const rows = listed.map((i) => {
      const candidate = decision.candidates[i];
      const colour = css(ramp(theme(), scale ? merit(scale, candidate.value) : 1));
      const { change } = candidate;
      const expected = change ? `: trajectory ${number(change.trajectory, 4)} nats, map ${number(change.map, 4)} nats·m², α ${number(change.alpha, 4)}` : "";
      const about = `${candidate.what}${expected}`;
      const button = el("button", {
        type: "button", class: "worst", title: about, "aria-pressed": String(i === this.marked),
        onclick: () => {
          this.marked = this.marked === i ? -1 : i;
          for (const other of this.decision.querySelectorAll("button.worst")) other.setAttribute("aria-pressed", String(other === button && this.marked === i));
          this.draw();
        },
      }, shapeSample("circle", colour), el("span", { class: "name" }, candidate.what || `candidate ${i + 1}`),
        el("span", { class: "kind" }, i === decision.chosen ? "chosen" : ""), el("span", { class: "figure" }, number(candidate.value, 4)));
      return el("li", {}, button);
    });
    const number_ = exploration.decisions.indexOf(decision) + 1;
    const more = decision.candidates.length - listed.length;
    this.decision.replaceChildren(
      el("h2", {}, `Decision ${number_} of ${exploration.decisions.length}`), el("p", { class: "why" }, decision.why),
      ...decision.notes.map((note) => el("p", { class: "hint" }, note)),
      el("ul", { class: "candidates", "aria-label": "Candidates, best first" }, ...rows),
      ...(more > 0 ? [el("p", { class: "hint" }, `and ${count(more)} more`)] : []),
      ...(decision.tree ? [el("p", { class: "hint" }, `tree of ${plural(decision.tree.parents.length, "pose")}`)] : []),
      ...(scale ? [el("p", { class: "hint" }, `values from ${number(scale.best, 4)} (best, strongest colour) to ${number(scale.worst, 4)}`)] : []));
  }

  private there(exploration: Exploration): Partial<Record<FloorLayer, boolean>> {
    return {
      truth: exploration.moments.some((m) => m.truth), tree: exploration.decisions.some((d) => d.tree),
      scan: exploration.moments.some((m) => m.scan), ellipse: exploration.moments.some((m) => m.covariance),
    };
  }

  private buildLayers(): void {
    const { exploration } = this;
    if (!exploration) return;
    const there = this.there(exploration);
    this.layersThere = JSON.stringify(there);
    const id = freshId("section");
    this.layers.setAttribute("aria-labelledby", id);
    this.layers.replaceChildren(el("h2", { id }, "Shown"), el("ul", { class: "rows" }, ...kFloorLayers.filter((layer) => there[layer] !== false).map((layer) =>
      el("li", {}, el("label", {}, checkbox(this.shown[layer], (on) => {
        this.shown[layer] = on;
        this.draw();
      }), layerSample(layer), el("span", { class: "name" }, kLayerNames[layer]))))));
  }
}

