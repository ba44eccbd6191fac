// SPDX-License-Identifier: BSD-3-Clause
import "uplot/dist/uPlot.min.css";
import "./style.css";
import type { ReportJson } from "./data/contract";
import { DataError } from "./data/decode";
import { Exploration } from "./data/exploration";
import { decodeGraph, type Graph } from "./data/graph";
import { linesOf } from "./data/live";
import { App } from "./ui/app";
import { el } from "./ui/dom";

const kVersion = 1;

function read(): ReportJson {
  const text = document.getElementById("cairn-data")?.textContent?.trim() ?? "";
  if (text === "" || text.startsWith("@")) throw new DataError("This page holds no data: cairn view and cairn bench --html fill it.");
  let report: ReportJson;
  try {
    report = JSON.parse(text) as ReportJson;
  } catch {
    throw new DataError("The data in this page is not JSON.");
  }
  if (report.format !== "cairn-report") throw new DataError("The data in this page is not a report of cairn.");
  if (report.version !== kVersion) {
    throw new DataError(`The data in this page has version ${String(report.version)}, and the page knows version ${kVersion} only.`);
  }
  return report;
}

/** A run that goes on: shown from its first motion, and followed. */
async function follow(report: ReportJson, root: HTMLElement): Promise<void> {
  const exploration = report.explorations![0];
  let app: App | null = null;
  for await (const lines of linesOf(exploration.live!)) {
    if (app) {
      await app.grow(lines);
      continue;
    }
    exploration.lines.push(...lines);
    if (!exploration.lines.some((line) => line.step !== undefined)) continue;
    app = new App(report, [], [await Exploration.decode(exploration, 0)]);
    root.replaceChildren(app.build());
    document.documentElement.dataset.ready = "true";
  }
  if (!app) throw new DataError("The run has ended before the page was loaded.");
  document.documentElement.dataset.ended = "true";
}

async function start(): Promise<void> {
  const root = document.getElementById("app")!;
  root.replaceChildren(el("p", { class: "loading", role: "status" }, "Reading …"));
  try {
    const report = read();
    if (report.explorations?.[0]?.live !== undefined) {
      await follow(report, root);
      return;
    }
    const graphs: Graph[] = [];
    for (const [k, graph] of (report.graphs ?? []).entries()) graphs.push(await decodeGraph(graph, k));
    const explorations: Exploration[] = [];
    for (const [k, exploration] of (report.explorations ?? []).entries()) explorations.push(await Exploration.decode(exploration, k));
    if (graphs.length + explorations.length === 0 && !report.bench) throw new DataError("There is neither a graph nor a comparison in this page.");
    document.getElementById("cairn-data")?.replaceChildren();  // decoded: no need to hold it twice
    root.replaceChildren(new App(report, graphs, explorations).build());
    document.documentElement.dataset.ready = "true";
  } catch (error) {
    if (!(error instanceof DataError)) console.error(error);
    root.replaceChildren(el("div", { class: "scroll" }, el("div", { class: "page narrow", role: "alert" },
      el("h1", {}, "This page cannot be shown"), el("p", {}, (error as Error).message))));
  }
}

void start();
