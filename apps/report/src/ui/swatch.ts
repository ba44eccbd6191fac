// SPDX-License-Identifier: BSD-3-Clause
import { css, ramp, type ResidualScale, type Stroke } from "../draw/colour";
import { logTicks } from "../draw/ticks";
import { svg } from "./dom";
import { logLabel } from "./format";
import { theme } from "./theme";

/** A piece of the line as it is drawn. */
export function lineSample(stroke: Stroke): SVGSVGElement {
  return svg("svg", { class: "sample", viewBox: "0 0 28 10", width: 28, height: 10, "aria-hidden": "true" },
    svg("line", {
      x1: 1, y1: 5, x2: 27, y2: 5, stroke: stroke[theme()], "stroke-width": Math.max(1.25, stroke.width),
      "stroke-dasharray": stroke.dash.length ? stroke.dash.map((d) => d * 0.8).join(" ") : null,
    }));
}

export function shapeSample(shape: "circle" | "ring" | "square" | "diamond", colour: string): SVGSVGElement {
  const hollow = shape === "ring" || shape === "square";
  const paint = { fill: hollow ? "none" : colour, stroke: hollow ? colour : "none", "stroke-width": 1.75 };
  const shapes = {
    circle: () => svg("circle", { cx: 14, cy: 5, r: 3, ...paint }),
    ring: () => svg("circle", { cx: 14, cy: 5, r: 3.6, ...paint }),
    square: () => svg("rect", { x: 10.6, y: 1.6, width: 6.8, height: 6.8, ...paint }),
    diamond: () => svg("path", { d: "M14 0.8L18.2 5L14 9.2L9.8 5z", ...paint }),
  };
  return svg("svg", { class: "sample", viewBox: "0 0 28 10", width: 28, height: 10, "aria-hidden": "true" }, shapes[shape]());
}

/** Colours of residuals with their numbers. */
export function colourBar(scale: ResidualScale, width: number): SVGSVGElement {
  const pieces = 48;
  const bar = svg("svg", {
    class: "colour-bar", viewBox: `0 0 ${width} 30`, width, height: 30, role: "img",
    "aria-label": `Colours from chi2 ${logLabel(scale.low)} to ${logLabel(scale.high)}, logarithmic`,
  });
  for (let k = 0; k < pieces; ++k) {
    const x = (k * width) / pieces;
    bar.append(svg("rect", { x, y: 0, width: width / pieces + 0.5, height: 9, fill: css(ramp(theme(), (k + 0.5) / pieces)) }));
  }
  let free = -Infinity;
  for (const tick of logTicks(scale.low, scale.high)) {
    const x = (Math.log(tick / scale.low) / Math.log(scale.high / scale.low)) * width;
    bar.append(svg("line", { x1: x, x2: x, y1: 9, y2: 13, stroke: "currentColor", "stroke-width": 1 }));
    if (x < free) continue;
    const anchor = x < 12 ? "start" : x > width - 14 ? "end" : "middle";
    bar.append(svg("text", { x, y: 25, "text-anchor": anchor, "font-size": 10.5, fill: "currentColor" }, logLabel(tick)));
    free = x + 40;
  }
  return bar;
}
