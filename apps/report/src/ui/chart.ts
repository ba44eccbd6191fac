// SPDX-License-Identifier: BSD-3-Clause
// A line chart: uPlot, with a legend of text and keyboard-reachable switches of its own.
import uPlot from "uplot";
import { css, kGridLine, kInk, kMuted, rgb, series as seriesStroke, type Stroke } from "../draw/colour";
import { logTicks } from "../draw/ticks";
import { checkbox, el } from "./dom";
import { kNone, logLabel, number } from "./format";
import { lineSample } from "./swatch";
import { onTheme, theme } from "./theme";

export interface Line {
  name: string;
  x: number[];
  y: (number | null)[];
  stroke?: Stroke;
}

export interface ChartSpec {
  title: string;
  /** What is shown, in a sentence. */
  caption: string;
  xLabel: string;
  yLabel: string;
  logarithmic: boolean;
  /** A linear axis of y that need not begin at zero. */
  tight?: boolean;
  lines: Line[];
  xText?: (x: number) => string;
  height?: number;
}

const kFont = '11.5px system-ui, "Segoe UI", "Helvetica Neue", Arial, "Liberation Sans", sans-serif';

/** All x in one rising list, and each line's y at them: null where the line has none. */
export function align(lines: Line[], logarithmic: boolean): (number | null)[][] {
  const xs = [...new Set(lines.flatMap((line) => line.x))].filter(Number.isFinite).sort((a, b) => a - b);
  const row = new Map(xs.map((x, k) => [x, k]));
  const columns = lines.map((line) => {
    const column = new Array<number | null>(xs.length).fill(null);
    line.x.forEach((x, k) => {
      const y = line.y[k];
      const at = row.get(x);
      if (at !== undefined && y !== null && Number.isFinite(y) && (!logarithmic || y > 0)) column[at] = y;
    });
    return column;
  });
  return [xs, ...columns];
}

/** A logarithmic axis that leaves some room, and spans at least half a decade. */
export function logRange(low: number, high: number): [number, number] {
  if (!(low > 0) || !(high > 0)) return [0.1, 10];
  const room = Math.max(0.04 * Math.log10(high / low), 0.04);
  const missing = Math.max(0, 0.5 - Math.log10(high / low)) / 2;
  return [low / 10 ** (room + missing), high * 10 ** (room + missing)];
}

/** A linear axis that leaves some room, also round a constant. */
export function tightRange(low: number, high: number): [number, number] {
  if (!Number.isFinite(low) || !Number.isFinite(high)) return [0, 1];
  const room = high > low ? 0.05 * (high - low) : Math.max(0.5, 0.05 * Math.abs(high));
  return [low - room, high + room];
}

export function lineChart(spec: ChartSpec): HTMLElement {
  const host = el("div", { class: "chart-canvas" });
  const strokes = spec.lines.map((line, k) => line.stroke ?? seriesStroke(k));
  const values = spec.lines.map(() => el("span", { class: "figure" }));
  const where = el("span", { class: "hint" });
  const visible = spec.lines.map(() => true);
  let plot: uPlot | null = null;
  const legend = el("ul", { class: "chart-legend" });
  const fillLegend = () => legend.replaceChildren(...spec.lines.map((line, k) => {
    const box = checkbox(visible[k], (on) => {
      visible[k] = on;
      plot?.setSeries(k + 1, { show: on });
    });
    return el("li", {}, el("label", {}, box, lineSample(strokes[k]), el("span", { class: "name" }, line.name)), values[k]);
  }));
  const data = align(spec.lines, spec.logarithmic);
  const showValues = (index: number | null | undefined) => {
    const at = index ?? -1;
    where.textContent = at >= 0 ? `${spec.xLabel}: ${(spec.xText ?? ((x) => number(x, 4)))(data[0][at] as number)}` : "";
    values.forEach((value, k) => (value.textContent = at >= 0 ? (data[k + 1][at] === null ? kNone : number(data[k + 1][at], 6)) : ""));
  };

  const make = () => {
    plot?.destroy();
    const width = host.clientWidth;
    if (width === 0) return;
    const now = theme();
    const axis = (label: string): uPlot.Axis => ({
      label, font: kFont, labelFont: kFont, stroke: kMuted[now], labelSize: 18, labelGap: 0,
      grid: { stroke: kGridLine[now], width: 1 }, ticks: { stroke: kGridLine[now], width: 1, size: 5 },
    });
    plot = new uPlot({
      width, height: spec.height ?? 280,
      legend: { show: false },
      cursor: { points: { size: 7 }, drag: { x: true, y: false } },
      scales: {
        x: { time: false },
        y: spec.logarithmic ? { distr: 3, range: (_, low, high) => logRange(low, high) }
          : { range: (_, low, high) => (spec.tight ? tightRange(low, high) : [Math.min(0, low), high > 0 ? high * 1.05 : 1]) },
      },
      axes: [
        { ...axis(spec.xLabel), size: 30 },
        spec.logarithmic ? {
          ...axis(spec.yLabel), size: 46,
          splits: (_, __, low, high) => logTicks(low, high),
          values: (_, splits) => splits.map(logLabel),
          filter: (_, splits) => splits,
        } : { ...axis(spec.yLabel), size: 46, values: (_, splits) => splits.map((y) => number(y, 3)) },
      ],
      series: [{}, ...spec.lines.map((_, k) => ({
        stroke: css(rgb(strokes[k][now])), width: Math.max(1.5, strokes[k].width), dash: strokes[k].dash, spanGaps: true,
        points: { show: data[0].length <= 60, size: 5, fill: css(rgb(strokes[k][now])) }, show: visible[k],
      }))],
      hooks: { setCursor: [(u) => showValues(u.cursor.idx)] },
    }, data as uPlot.AlignedData, host);
    const canvas = host.querySelector("canvas");
    canvas?.setAttribute("role", "img");
    canvas?.setAttribute("aria-label", `${spec.title}. ${spec.caption}`);
    host.style.color = kInk[now];
  };
  new ResizeObserver(() => {
    if (plot && plot.width === host.clientWidth) return;
    if (plot && host.clientWidth > 0) plot.setSize({ width: host.clientWidth, height: spec.height ?? 280 });
    else make();
  }).observe(host);
  onTheme(() => {
    fillLegend();
    make();
  });
  fillLegend();
  return el("figure", { class: "chart" },
    el("figcaption", {}, el("strong", {}, spec.title), el("span", {}, spec.caption)), host,
    el("div", { class: "chart-foot" }, legend, where));
}
