// SPDX-License-Identifier: BSD-3-Clause
// Horizontal bars with their spread.
import { series } from "../draw/colour";
import { niceTicks } from "../draw/ticks";
import { el, svg } from "./dom";
import { onTheme, theme } from "./theme";

export interface Bar {
  name: string;
  value: number;
  low?: number;
  high?: number;
  text: string;
}

const kRow = 28, kTop = 4, kAxis = 36;
const kFont = '12.5px system-ui, "Segoe UI", "Helvetica Neue", Arial, "Liberation Sans", sans-serif';

let ruler: CanvasRenderingContext2D | null = null;
function textWidth(text: string): number {
  ruler ??= document.createElement("canvas").getContext("2d");
  if (!ruler) return 7 * text.length;
  ruler.font = kFont;
  return ruler.measureText(text).width;
}

/** As much of the text as fits. */
function fitted(text: string, width: number): string {
  if (textWidth(text) <= width) return text;
  let n = text.length;
  while (n > 1 && textWidth(`${text.slice(0, n)}…`) > width) --n;
  return `${text.slice(0, n)}…`;
}

function draw(bars: Bar[], unit: string, label: string, width: number): SVGSVGElement {
  const most = Math.max(...bars.map((bar) => Math.max(bar.value, bar.high ?? 0)), 1e-12);
  const left = Math.min(0.52 * width, Math.max(...bars.map((bar) => textWidth(bar.name))) + 14);
  const right = width - Math.max(...bars.map((bar) => textWidth(bar.text))) - 16;
  const x = (value: number) => left + (value / most) * (right - left);
  const height = kTop + bars.length * kRow;
  const picture = svg("svg", { class: "bars", width, height: height + kAxis, viewBox: `0 0 ${width} ${height + kAxis}`, role: "img", "aria-label": label });
  for (const tick of niceTicks(0, most, Math.max(2, (right - left) / 70))) {
    picture.append(svg("line", { class: "grid-line", x1: x(tick), x2: x(tick), y1: kTop, y2: height }));
    picture.append(svg("text", { class: "tick", x: x(tick), y: height + 15, "text-anchor": "middle" }, String(Number(tick.toPrecision(6)))));
  }
  picture.append(svg("text", { class: "tick", x: (left + right) / 2, y: height + 32, "text-anchor": "middle" }, unit));
  bars.forEach((bar, k) => {
    const y = kTop + k * kRow;
    const middle = y + kRow / 2;
    const name = svg("text", { class: "bar-name", x: left - 10, y: middle + 4, "text-anchor": "end" }, fitted(bar.name, left - 12));
    name.append(svg("title", {}, bar.name));
    picture.append(name);
    picture.append(svg("rect", { x: left, y: y + 6, width: Math.max(1, x(bar.value) - left), height: kRow - 12, fill: series(k)[theme()], rx: 1.5 }));
    if (bar.low !== undefined && bar.high !== undefined && bar.high > bar.low) {
      const d = `M${x(bar.low)} ${middle}H${x(bar.high)}M${x(bar.low)} ${middle - 4}v8M${x(bar.high)} ${middle - 4}v8`;
      picture.append(svg("path", { class: "whisker-halo", d }), svg("path", { class: "whisker", d }));
    }
    picture.append(svg("text", { class: "bar-text", x: Math.max(x(bar.value), x(bar.high ?? 0)) + 8, y: middle + 4 }, bar.text));
  });
  picture.append(svg("line", { class: "base-line", x1: left, x2: left, y1: kTop, y2: height }));
  return picture;
}

export function barChart(title: string, caption: string, unit: string, bars: Bar[]): HTMLElement {
  const host = el("div", { class: "bars-host" });
  const spoken = `${title}. ${caption} ${bars.map((bar) => `${bar.name}: ${bar.text}`).join("; ")}`;
  let width = 0;
  const make = () => width > 0 && host.replaceChildren(draw(bars, unit, spoken, width));
  new ResizeObserver(() => {
    if (host.clientWidth === width) return;
    width = host.clientWidth;
    make();
  }).observe(host);
  onTheme(make);
  return el("figure", { class: "chart" },
    el("figcaption", {}, el("strong", {}, title), el("span", {}, caption)), host);
}
