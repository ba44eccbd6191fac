// SPDX-License-Identifier: BSD-3-Clause
// The map: canvas, tools over it, panel beside it, recording under it.
import { factorCount, type Graph } from "../data/graph";
import { listen } from "../draw/gestures";
import { Stage } from "../draw/stage";
import type { Hit, ViewState } from "../draw/state";
import { el, iconButton } from "./dom";
import { facts, factsElement } from "./inspect";
import { Legend } from "./legend";
import { Playback } from "./playback";
import { onTheme, theme } from "./theme";

const kManyPoses = 20000;

function initialState(graph: Graph): ViewState {
  const focus = Math.max(0, graph.estimates.findIndex((estimate) => estimate.role === "estimate"));
  const roles = graph.estimates.map((estimate) => estimate.role);
  return {
    theme: theme(),
    // The first guess may be far off; it is there to be switched on.
    shown: roles.map((role, k) => k === focus || role === "truth" || role === "peer" || (role === "initial" && roles.length === 1)),
    focus,
    classes: [true, true, true, true, true, true],
    byResidual: false,
    poses: graph.variables.count <= kManyPoses,
    landmarks: true,
    headings: false,
    ellipses: graph.estimates[focus]?.covariance !== null,
    probability: 0.95,
    magnify: 1,
    grid: true,
    recording: graph.estimates.length === 0 ? 0 : -1,
    frame: 0,
  };
}

export class MapView {
  readonly element = el("div", { class: "map" });
  readonly stage: Stage;
  private readonly states = new Map<Graph, ViewState>();
  private state: ViewState | null = null;
  private readonly legend: Legend;
  private readonly playback: Playback;
  private readonly tooltip = el("div", { class: "tooltip", hidden: true });
  private readonly card = el("div", { class: "card", role: "status", hidden: true });
  private readonly notice = el("p", { class: "notice", hidden: true });
  private readonly views = el("div", { class: "tools", role: "group", "aria-label": "View" });
  private pointer: { x: number; y: number } | null = null;
  private hoverRequested = false;

  constructor() {
    const host = el("div", { class: "canvas-host" });
    this.stage = new Stage(host);
    const canvas = this.stage.canvas;
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "application");
    canvas.setAttribute("aria-roledescription", "graph");
    this.legend = new Legend(this.stage, { changed: () => this.changed(), select: (hit) => this.select(hit, true) });
    this.playback = new Playback((moving) => {
      if (moving) this.stage.moved();
      this.changed();
    });
    host.append(this.views, this.tooltip, this.card, this.notice);
    this.element.append(el("div", { class: "map-main" }, host, this.playback.element), this.legend.element);
    listen(this.stage, {
      hover: (x, y, inside) => this.hover(inside ? { x, y } : null),
      click: (x, y) => this.select(this.stage.hit(x, y), false),
    });
    this.stage.onFrame = () => this.afterFrame();
    canvas.addEventListener("keydown", (event) => this.key(event));
    onTheme((now) => {
      if (!this.state || !this.stage.graph) return;
      for (const state of this.states.values()) state.theme = now;
      this.legend.build(this.stage.graph, this.state);
      this.stage.invalidate();
    });
  }

  show(graph: Graph): void {
    if (this.stage.graph === graph) return this.stage.invalidate();
    const state = this.states.get(graph) ?? initialState(graph);
    state.theme = theme();
    this.states.set(graph, state);
    this.state = state;
    this.stage.show(graph, state);
    this.legend.build(graph, state);
    this.playback.build(graph, state);
    this.tools(graph);
    this.card.hidden = this.tooltip.hidden = true;
    const keys = graph.dimension === 2 ? "Arrow keys move" : "Arrow keys turn, with shift move";
    this.stage.canvas.setAttribute("aria-label",
      `${graph.name}: ${graph.variables.count} variables and ${factorCount(graph.edges)} edges in ${graph.dimension}D. ${keys}, plus and minus zoom, F shows all.`);
  }

  private tools(graph: Graph): void {
    const zoom = (factor: number) => {
      this.stage.control.zoom(factor);
      this.stage.moved();
    };
    const direction = (label: string, title: string, yaw: number, pitch: number) =>
      el("button", { type: "button", class: "button", title, onclick: () => this.stage.fit(yaw, pitch) }, label);
    this.views.replaceChildren(
      iconButton("fit", "Show all (F)", () => this.stage.fit()),
      iconButton("plus", "Nearer (+)", () => zoom(1 / 1.4)),
      iconButton("minus", "Farther (−)", () => zoom(1.4)),
      ...(graph.dimension === 3 ? [
        direction("Top", "From above", 0, Math.PI / 2), direction("Front", "Along y", 0, 0),
        direction("Side", "Along −x", Math.PI / 2, 0), direction("Space", "From aslant", -0.6, 0.5)] : []),
      iconButton("picture", "Save the picture as PNG", () => void this.save()),
      iconButton("panel", "Legend and switches", () => {
        this.legend.element.hidden = !this.legend.element.hidden;
      }, { class: "icon-button" }));
  }

  private async save(): Promise<void> {
    const blob = await this.stage.picture();
    if (!blob) return;
    const url = URL.createObjectURL(blob);
    const name = (this.stage.graph?.name ?? "graph").replace(/[^\w.-]+/g, "_").slice(0, 80) || "graph";
    const link = el("a", { href: url, download: `${name}.png` });
    link.click();
    window.setTimeout(() => URL.revokeObjectURL(url), 10000);
  }

  private changed(): void {
    this.playback.refresh();
    this.stage.invalidate();
    this.showCard();
  }

  private key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "f" || event.key === "F") this.stage.fit();
    else if (event.key === "Escape") this.select(null, false);
    else if (event.key === " ") this.playback.toggle();
    else if (event.key === "[" || event.key === ",") this.playback.step(-1);
    else if (event.key === "]" || event.key === ".") this.playback.step(1);
    else return;
    event.preventDefault();
  }

  private afterFrame(): void {
    const count = this.stage.current?.ellipseCount;
    const partly = count && this.state?.ellipses && count.drawn > 0 && count.drawn < count.all - 1;
    this.notice.hidden = !partly;
    if (partly) this.notice.textContent = `${count.drawn} of ${count.all} ellipses drawn, evenly chosen`;
  }

  // Pointing ------------------------------------------------------------------------------------------

  private hover(at: { x: number; y: number } | null): void {
    this.pointer = at;
    if (this.hoverRequested) return;
    this.hoverRequested = true;
    requestAnimationFrame(() => {
      this.hoverRequested = false;
      const hit = this.pointer ? this.stage.hit(this.pointer.x, this.pointer.y) : null;
      if (hit || this.stage.hovered) this.stage.hover(hit);
      this.stage.canvas.classList.toggle("over", hit !== null);
      this.showTooltip(hit);
    });
  }

  private showTooltip(hit: Hit | null): void {
    const drawing = this.stage.current;
    this.tooltip.hidden = !hit || !this.pointer || !drawing || !this.state;
    if (this.tooltip.hidden || !hit || !drawing || !this.state || !this.pointer) return;
    this.tooltip.replaceChildren(factsElement(facts(drawing, this.state, hit)));
    const { width, height } = this.stage.control;
    const box = this.tooltip.getBoundingClientRect();
    const { x, y } = this.pointer;
    const left = x + 16 + box.width > width ? x - 16 - box.width : x + 16;
    const top = y + 16 + box.height > height ? y - 16 - box.height : y + 16;
    this.tooltip.style.transform = `translate(${Math.max(4, left)}px, ${Math.max(4, top)}px)`;
  }

  private select(hit: Hit | null, fly: boolean): void {
    if (hit && fly && this.state && !this.state.shown[hit.estimate] && this.state.recording < 0) {
      this.state.shown[hit.estimate] = true;
      this.legend.build(this.stage.graph!, this.state);
      this.stage.invalidate();
    }
    this.stage.select(hit, fly);
    this.showCard();
  }

  private showCard(): void {
    const hit = this.stage.selected;
    const drawing = this.stage.current;
    this.card.hidden = !hit;
    if (!hit || !drawing || !this.state) return;
    this.card.replaceChildren(
      iconButton("close", "No longer mark it (Esc)", () => this.select(null, false), { class: "icon-button small" }),
      factsElement(facts(drawing, this.state, hit)));
  }
}
