// SPDX-License-Identifier: BSD-3-Clause
// The panel beside the map: what is shown, and what is worst.
import { countsOnce, EdgeClass, kEdgeClassNames, type Graph } from "../data/graph";
import { worstEdges } from "../draw/chains";
import { css, kLandmarkEdge, kLoop, kOtherEdge, kPrior, ramp, residualFraction, residualScale, type Stroke } from "../draw/colour";
import type { Stage } from "../draw/stage";
import type { Hit, ViewState } from "../draw/state";
import { checkbox, choice, el, freshId, segments } from "./dom";
import { count, number } from "./format";
import { edgeName } from "./inspect";
import { colourBar, lineSample, shapeSample } from "./swatch";
import { theme } from "./theme";

export interface LegendActions {
  /** The state was changed. */
  changed(): void;
  select(hit: Hit): void;
}

const kEdgeStrokes: Stroke[] = [];
kEdgeStrokes[EdgeClass.loop] = kLoop;
kEdgeStrokes[EdgeClass.landmark] = kLandmarkEdge;
kEdgeStrokes[EdgeClass.other] = kOtherEdge;

function section(title: string, ...children: (Node | null)[]): HTMLElement {
  const id = freshId("section");
  return el("section", { "aria-labelledby": id }, el("h2", { id }, title), ...children);
}

export class Legend {
  readonly element = el("aside", { class: "panel", "aria-label": "Legend and switches" });

  constructor(private readonly stage: Stage, private readonly actions: LegendActions) {}

  /** Builds it anew: for another graph, theme or focus. */
  build(graph: Graph, state: ViewState): void {
    const scroll = this.element.scrollTop;
    this.element.replaceChildren(
      this.find(graph, state),
      this.estimates(graph, state),
      this.edges(graph, state),
      ...(this.worst(graph, state) ?? []),
      this.display(graph, state),
    );
    this.element.scrollTop = scroll;
  }

  private find(graph: Graph, state: ViewState): HTMLElement {
    const answer = el("p", { class: "hint", role: "status" });
    const input = el("input", {
      type: "search", placeholder: "id, or two ids", "aria-label": "Find a variable by its id, or an edge by two", spellcheck: "false",
      autocomplete: "off", name: "find",
    });
    const search = (event: Event) => {
      event.preventDefault();
      const found = findHit(graph, state, input.value);
      answer.textContent = typeof found === "string" ? found : "";
      if (typeof found !== "string") this.actions.select(found);
    };
    return el("form", { class: "find", role: "search", onsubmit: search },
      input, el("button", { type: "submit", class: "button" }, "Find"), answer);
  }

  private estimates(graph: Graph, state: ViewState): HTMLElement {
    const strokes = this.stage.current!.strokes;
    const several = graph.estimates.length > 1;
    const name = freshId("focus");
    const rows = graph.estimates.map((estimate, k) => {
      const box = checkbox(state.shown[k], (on) => {
        state.shown[k] = on;
        this.actions.changed();
      });
      const radio = el("input", {
        type: "radio", name, "data-estimate": k, title: "Edges, poses and residuals of this one", "aria-label": `Edges and residuals of ${estimate.name}`,
      });
      radio.checked = k === state.focus;
      radio.addEventListener("change", () => {
        state.focus = k;
        state.shown[k] = true;
        state.recording = -1;
        this.build(graph, state);
        this.actions.changed();
        // It was built anew; who came by keyboard goes on from there.
        this.element.querySelector<HTMLInputElement>(`input[data-estimate="${k}"]`)?.focus();
      });
      const chi2 = estimate.chi2 ?? (estimate.run >= 0 ? graph.runs[estimate.run]?.chi2?.final : null);
      return el("li", {},
        el("label", { title: estimate.file || estimate.name }, box, lineSample(strokes[k]), el("span", { class: "name" }, estimate.name)),
        el("span", { class: "figure" }, chi2 === null || chi2 === undefined ? "" : number(chi2, 5)),
        several ? radio : null);
    });
    const id = freshId("section");
    const heading = el("div", { class: several ? "columns three" : "columns" }, el("h2", { id }, several ? "Estimates" : "Estimate"),
      el("span", { "aria-hidden": "true" }, "χ²"),
      several ? el("span", { "aria-hidden": "true", title: "Whose edges, poses and residuals are drawn" }, "edges") : null);
    return el("section", { "aria-labelledby": id }, heading, el("ul", { class: several ? "rows three" : "rows" }, ...rows));
  }

  private edges(graph: Graph, state: ViewState): HTMLElement {
    const counts = new Array<number>(kEdgeClassNames.length).fill(0);
    graph.edges.class.forEach((c, e) => { if (countsOnce(graph.edges, e)) ++counts[c]; });
    const focusStroke = this.stage.current!.strokes[state.focus] ?? this.stage.current!.strokes[0];
    const rows = counts.map((n, c) => {
      if (n === 0) return null;
      const sample = c === EdgeClass.prior ? shapeSample("ring", kPrior[theme()])
        : lineSample(kEdgeStrokes[c] ?? focusStroke);
      const box = checkbox(state.classes[c], (on) => {
        state.classes[c] = on;
        this.actions.changed();
      });
      return el("li", {},
        el("label", {}, box, sample, el("span", { class: "name" }, kEdgeClassNames[c])),
        el("span", { class: "figure" }, count(n)));
    });
    const scale = residualScale(graph.estimates[state.focus]?.edgeChi2 ?? []);
    const bar = scale ? el("div", { class: "colour-scale" }, colourBar(scale, 256),
      el("p", { class: "hint" }, "χ² of each edge (squared whitened residual, no unit), logarithmic")) : null;
    if (bar) bar.hidden = !state.byResidual;
    const colouring = scale ? el("div", { class: "line" }, el("span", {}, "Colour by"),
      segments("Colour edges by", [["class", "class"], ["residual", "residual"]], state.byResidual ? "residual" : "class", (value) => {
        state.byResidual = value === "residual";
        bar!.hidden = !state.byResidual;
        this.actions.changed();
      })) : null;
    return section("Edges", el("ul", { class: "rows" }, ...rows), colouring, bar);
  }

  /** The ten edges with the largest residuals. */
  private worst(graph: Graph, state: ViewState): HTMLElement[] | null {
    const chi2 = graph.estimates[state.focus]?.edgeChi2;
    const scale = chi2 ? residualScale(chi2) : null;
    if (!chi2 || !scale) return null;
    const worst = worstEdges(chi2, 10, () => true, graph.edges.factor).filter((e) => chi2[e] > 0);
    if (worst.length === 0) return null;
    const items = worst.map((e) => {
      const kind = kEdgeClassNames[graph.edges.class[e]];
      const colour = css(ramp(theme(), residualFraction(scale, chi2[e])));
      const button = el("button", {
        type: "button", class: "worst", "data-edge": e,
        title: `${graph.edges.types[graph.edges.type[e]]?.name ?? ""} ${edgeName(graph, e)}: go there`,
        onclick: () => this.actions.select({ kind: "edge", index: e, estimate: state.focus }),
      }, el("span", { class: "name" }, edgeName(graph, e)), el("span", { class: "kind" }, kind),
        el("span", { class: "figure" }, number(chi2[e], 4)));
      const mark = lineSample({ light: colour, dark: colour, width: 5, dash: [] });
      button.prepend(mark);
      return el("li", {}, button);
    });
    return [section("Largest residuals", el("ol", { class: "worst-list" }, ...items))];
  }

  private display(graph: Graph, state: ViewState): HTMLElement {
    const rows: HTMLElement[] = [];
    const toggle = (label: string, value: boolean, set: (on: boolean) => void, extra: Node | null = null) => {
      const box = checkbox(value, (on) => {
        set(on);
        this.actions.changed();
      });
      rows.push(el("li", {}, el("label", {}, box, el("span", { class: "name" }, label)), extra));
    };
    const roles = graph.variables.types.map((type) => type.role);
    toggle("Poses as dots", state.poses, (on) => (state.poses = on));
    if (roles.includes("landmark")) toggle("Landmarks", state.landmarks, (on) => (state.landmarks = on), shapeSample("diamond", kLandmarkEdge[theme()]));
    if (graph.estimates[state.focus]?.orientation) {
      toggle(graph.dimension === 2 ? "Headings" : "Axes of poses (x y z)", state.headings, (on) => (state.headings = on));
    }
    if (graph.estimates[state.focus]?.covariance) {
      const change = (set: () => void) => {
        set();
        this.actions.changed();
      };
      toggle(graph.dimension === 2 ? "Covariance ellipses" : "Covariance ellipsoids", state.ellipses, (on) => (state.ellipses = on));
      rows.push(el("li", { class: "sub" },
        choice("Probability that an ellipse holds", [[0.6827, "68 %"], [0.95, "95 %"], [0.9973, "99.7 %"]], state.probability,
          (p) => change(() => (state.probability = p))),
        choice("How much larger ellipses are drawn", [1, 3, 10, 30, 100].map((m) => [m, m === 1 ? "true size" : `${m} × larger`] as [number, string]),
          state.magnify, (m) => change(() => (state.magnify = m)))));
    }
    toggle("Grid and axes, in metres", state.grid, (on) => (state.grid = on));
    return section("Show", el("ul", { class: "rows" }, ...rows));
  }
}

/** "17" is a variable, "3 17" or "3 → 17" an edge; else a sentence that says what is wrong. */
export function findHit(graph: Graph, state: ViewState, text: string): Hit | string {
  const wanted = text.trim();
  if (!wanted) return "An id finds a variable, two ids an edge.";
  const whole = graph.variables.ids.find(wanted);
  if (whole >= 0) return { kind: "variable", index: whole, estimate: state.focus };
  const parts = wanted.split(/\s*(?:→|->|,|\s)\s*/).filter(Boolean);
  if (parts.length !== 2) return `There is no variable “${wanted}”.`;
  const [i, j] = parts.map((part) => graph.variables.ids.find(part));
  if (i < 0 || j < 0) return `There is no variable “${i < 0 ? parts[0] : parts[1]}”.`;
  const { a, b } = graph.edges;
  for (let e = 0; e < a.length; ++e) {
    if ((a[e] === i && b[e] === j) || (a[e] === j && b[e] === i)) return { kind: "edge", index: e, estimate: state.focus };
  }
  return `No edge joins ${parts[0]} and ${parts[1]}.`;
}
