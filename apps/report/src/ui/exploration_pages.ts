// SPDX-License-Identifier: BSD-3-Clause
// How an exploration went: its curves, and all its decisions.
import type { Decision, Exploration, Moment } from "../data/exploration";
import { lineChart } from "./chart";
import { el } from "./dom";
import { count, kNone, number, plural } from "./format";
import { table } from "./table";

type Curve = [title: string, caption: string, yLabel: string, value: (moment: Moment) => number | null];

const kCurves: Curve[] = [
  ["Entropy of the map", "over all cells of the grid, unknown ones too: compare differences", "[nats·m²]", (m) => m.mapEntropy],
  ["Entropy of the trajectory", "mean over the poses that are kept", "[nats]", (m) => m.trajectoryEntropy],
  ["Known area", "free and occupied cells", "[m²]", (m) => m.coverage],
  ["Error of the position", "distance between estimate and truth, at that time", "[m]",
    (m) => (m.truth ? Math.hypot(m.estimate[0] - m.truth[0], m.estimate[1] - m.truth[1]) : null)],
  ["Loop closures", "in the graph", "loop closures", (m) => m.loops],
];

export function curvesView(exploration: Exploration): HTMLElement {
  const charts = kCurves.flatMap(([title, caption, yLabel, value]) => {
    const y = exploration.moments.map(value);
    if (y.every((v) => v === null)) return [];
    return [lineChart({
      title, caption, xLabel: "driven [m]", yLabel, logarithmic: false, tight: true,
      lines: [{ name: exploration.name, x: exploration.moments.map((m) => m.distance), y }],
    })];
  });
  return el("div", { class: "page" }, el("h1", {}, exploration.name), el("p", { class: "lead" }, summary(exploration)), el("div", { class: "charts" }, ...charts));
}

function summary(exploration: Exploration): string {
  const last = exploration.moments[exploration.moments.length - 1];
  const ended = exploration.end ? `${exploration.end}: ${exploration.why}` : "no end was recorded";
  return `${last.distance.toFixed(1)} m in ${plural(last.step, "motion")} and ${plural(exploration.decisions.length, "decision")}; ${ended}`;
}

export function decisionsView(exploration: Exploration, open: (decision: Decision) => void): HTMLElement {
  const rows = exploration.decisions.map((decision, k) => {
    const chosen = decision.candidates[decision.chosen];
    const finite = decision.candidates.filter((c) => c.value !== null).length;
    return [
      count(k + 1), `${exploration.moments[decision.at].distance.toFixed(1)} m`, decision.kind, decision.why, count(finite),
      chosen ? number(chosen.value, 4) : kNone, chosen ? number(chosen.length, 4) : kNone,
    ];
  });
  const element = table("Decisions", [
    { title: "decision" }, { title: "driven" }, { title: "", left: true }, { title: "why", left: true },
    { title: "candidates" }, { title: "value", about: "of the one that was chosen: the least is best" }, { title: "length [m]" },
  ], rows);
  element.classList.add("decisions");
  element.querySelectorAll("tbody tr").forEach((row, k) => {
    row.addEventListener("click", () => open(exploration.decisions[k]));
  });
  return el("div", { class: "page" }, el("h1", {}, "Decisions"), el("p", { class: "lead" }, summary(exploration)), element,
    exploration.notes.length > 0 ? el("ul", { class: "notes" }, ...exploration.notes.map((note) => el("li", {}, note))) : null);
}
