// SPDX-License-Identifier: BSD-3-Clause
// The page: what it holds, in tabs.
import type { ExplorationLineJson, ReportJson } from "../data/contract";
import type { Exploration } from "../data/exploration";
import { factorCount, type Graph } from "../data/graph";
import { aboutView } from "./about";
import { benchView } from "./bench";
import { choice, el, freshId, iconButton, svg } from "./dom";
import { ExplorationView } from "./exploration";
import { curvesView, decisionsView } from "./exploration_pages";
import { plural } from "./format";
import { MapView } from "./map";
import { runsView } from "./runs";
import { toggleTheme } from "./theme";

interface Tab {
  name: string;
  button: HTMLButtonElement;
  panel: HTMLElement;
}

const kExplorationTabs = ["Exploration", "Curves", "Decisions"];

/** Three stones on each other. */
function mark(): SVGSVGElement {
  return svg("svg", { class: "mark", viewBox: "0 0 24 24", "aria-hidden": "true" },
    svg("ellipse", { cx: 12, cy: 19, rx: 9.5, ry: 3.6 }),
    svg("ellipse", { cx: 12.6, cy: 12.3, rx: 6.6, ry: 2.8 }),
    svg("ellipse", { cx: 11.6, cy: 6.6, rx: 3.9, ry: 2.3 }));
}

export class App {
  private readonly tabs: Tab[] = [];
  private readonly tabList = el("div", { class: "tabs", role: "tablist", "aria-label": "Parts of the page" });
  private readonly main = el("main", {});
  private map: MapView | null = null;
  private readonly runs = el("div", { class: "scroll" });
  private title: HTMLElement = el("span", {});
  private readonly counts = el("span", { class: "counts" });
  private readonly explored = new ExplorationView();
  private readonly curves = el("div", { class: "scroll" });
  private readonly decisions = el("div", { class: "scroll" });
  private explorationTitle: HTMLElement = el("span", {});
  /** Curves and decisions lack what came since they were made. */
  private stale = false;

  constructor(private readonly report: ReportJson, private readonly graphs: Graph[], private readonly explorations: Exploration[]) {}

  build(): HTMLElement {
    const { report, graphs } = this;
    let renderer = "";
    if (graphs.length > 0) {
      try {
        this.map = new MapView();
        renderer = this.map.stage.software ? `${this.map.stage.rendererName} (in software)` : this.map.stage.rendererName;
        this.add("Map", this.map.element);
      } catch (error) {
        this.add("Map", el("div", { class: "scroll" }, el("p", { class: "warning" }, `No map: ${(error as Error).message}.`)));
      }
      if (graphs.some((graph) => runsView(graph) !== null)) this.add("Runs", this.runs);
    }
    this.addExplorations();
    if (report.bench) this.add("Comparison", el("div", { class: "scroll" }, benchView(report.bench)));
    this.add("About", el("div", { class: "scroll" }, aboutView(report, graphs, this.explorations, renderer)));
    const names = graphs.map((graph, k) => [k, graph.name] as [number, string]);
    this.title = graphs.length > 1
      ? choice("Graph", names, 0, (k) => this.show(graphs[k]))
      : el("span", { class: "title" }, graphs[0]?.name ?? "");
    const header = el("header", {},
      el("span", { class: "brand" }, mark(), "cairn"), this.title, this.explorationTitle, this.counts, this.tabList,
      iconButton("moon", "Light or dark", toggleTheme));
    if (graphs.length > 0) this.show(graphs[0]);
    this.open(report.kind === "bench" ? "Comparison" : this.tabs[0].name);
    document.title = [report.title, "cairn"].filter(Boolean).join(" – ");
    const page = el("div", { class: "app" }, header, this.main);
    return page;
  }

  private addExplorations(): void {
    const { explorations } = this;
    if (explorations.length === 0) return;
    this.add(kExplorationTabs[0], this.explored.element);
    this.add(kExplorationTabs[1], this.curves);
    this.add(kExplorationTabs[2], this.decisions);
    const names = explorations.map((exploration, k) => [k, exploration.name] as [number, string]);
    this.explorationTitle = explorations.length > 1
      ? choice("Run of a robot", names, 0, (k) => this.explore(explorations[k]))
      : el("span", { class: "title" }, explorations[0].name);
    this.explore(explorations[0]);
  }

  private explore(exploration: Exploration): void {
    this.explored.show(exploration);
    this.fill(exploration);
  }

  /** More of a run that goes on, the only one of the page. */
  async grow(lines: ExplorationLineJson[]): Promise<void> {
    const exploration = this.explorations[0];
    await exploration.append(lines);
    this.explored.grow();
    this.stale = true;
    this.refill();
  }

  /** What is not seen can wait. */
  private refill(): void {
    const seen = this.tabs.some((tab) => !tab.panel.hidden && kExplorationTabs.indexOf(tab.name) > 0);
    if (!this.stale || !seen) return;
    this.stale = false;
    this.fill(this.explorations[0]);
  }

  private fill(exploration: Exploration): void {
    this.curves.replaceChildren(curvesView(exploration));
    this.decisions.replaceChildren(decisionsView(exploration, (decision) => {
      this.open(kExplorationTabs[0]);
      this.explored.open(decision);
    }));
  }

  private add(name: string, content: HTMLElement): void {
    const id = freshId("tab");
    const button = el("button", { type: "button", role: "tab", id, "aria-controls": `${id}-panel`, onclick: () => this.open(name) }, name);
    button.addEventListener("keydown", (event) => {
      const by = event.key === "ArrowRight" ? 1 : event.key === "ArrowLeft" ? -1 : 0;
      if (by === 0) return;
      const next = this.tabs[(this.tabs.findIndex((tab) => tab.name === name) + by + this.tabs.length) % this.tabs.length];
      this.open(next.name);
      next.button.focus();
    });
    const panel = el("div", { role: "tabpanel", id: `${id}-panel`, "aria-labelledby": id, class: "tab-panel" }, content);
    this.tabs.push({ name, button, panel });
    this.tabList.append(button);
    this.main.append(panel);
  }

  private open(name: string): void {
    const wanted = this.tabs.some((tab) => tab.name === name) ? name : this.tabs[0].name;
    for (const tab of this.tabs) {
      const on = tab.name === wanted;
      tab.panel.hidden = !on;
      tab.button.setAttribute("aria-selected", String(on));
      tab.button.tabIndex = on ? 0 : -1;
    }
    // Which graph it is says nothing about a comparison of many.
    const ofOneGraph = wanted === "Map" || wanted === "Runs";
    this.title.hidden = this.counts.hidden = !ofOneGraph;
    this.explorationTitle.hidden = !kExplorationTabs.includes(wanted);
    this.refill();
  }

  private show(graph: Graph): void {
    this.map?.show(graph);
    const what = graph.edges.class.some((c) => c !== 4) ? "edge" : "pair";
    this.counts.textContent = `${plural(graph.variables.count, "variable")}, ${plural(factorCount(graph.edges), what)}`;
    this.runs.replaceChildren(runsView(graph) ?? el("div", { class: "page" }, el("p", { class: "lead" }, "Nothing was run on this graph.")));
  }
}
