// SPDX-License-Identifier: BSD-3-Clause
// Colours of docs/report.md, which `cairn plot` takes too.
import type { Role } from "../data/contract";

export type Theme = "light" | "dark";
export type Rgb = [number, number, number];

export function rgb(hex: string): Rgb {
  const value = parseInt(hex.slice(1), 16);
  return [(value >> 16) / 255, ((value >> 8) & 255) / 255, (value & 255) / 255];
}

export function css(colour: Rgb, alpha = 1): string {
  const [r, g, b] = colour.map((c) => Math.round(255 * c));
  return alpha >= 1 ? `rgb(${r} ${g} ${b})` : `rgb(${r} ${g} ${b} / ${alpha})`;
}

export const kPaper = { light: "#fcfcfb", dark: "#14171b" };
export const kInk = { light: "#1a1d21", dark: "#e8eaed" };
export const kMuted = { light: "#5d636b", dark: "#9aa1a9" };
export const kGridLine = { light: "#e4e5e3", dark: "#2b3138" };

/** Width [px], and dashes and gaps in turn [px]; no dashes: solid. */
export interface Stroke {
  light: string;
  dark: string;
  width: number;
  dash: number[];
}

const kRoles: Record<Exclude<Role, "peer">, Stroke> = {
  estimate: { light: "#0072b2", dark: "#56b4e9", width: 2, dash: [] },
  initial: { light: "#8a8f98", dark: "#8a919c", width: 1.25, dash: [1.5, 3] },
  truth: { light: "#1a1d21", dark: "#f2f4f7", width: 1, dash: [6, 4] },
};

const kPeers: Stroke[] = [
  { light: "#d55e00", dark: "#ff8a3d", width: 1.75, dash: [6, 3] },
  { light: "#009e73", dark: "#2fc79a", width: 1.75, dash: [2, 2] },
  { light: "#cc79a7", dark: "#e6a3c8", width: 1.75, dash: [8, 3, 2, 3] },
  { light: "#56b4e9", dark: "#9ad4f5", width: 1.75, dash: [12, 4] },
  { light: "#b8860b", dark: "#e0b83c", width: 1.75, dash: [4, 2, 1, 2] },
];

/** How each of a graph's estimates is drawn: the first of a role as the role says, the others as peers in turn. */
export function strokes(roles: Role[]): Stroke[] {
  const taken = new Set<Role>();
  let peers = 0;
  return roles.map((role) => {
    if (role === "peer" || taken.has(role)) return kPeers[peers++ % kPeers.length];
    taken.add(role);
    return kRoles[role];
  });
}

/** A series of a chart: the estimate's stroke, then peers. */
export function series(k: number): Stroke {
  return k === 0 ? kRoles.estimate : kPeers[(k - 1) % kPeers.length];
}

export const kLoop: Stroke = { light: "#c98200", dark: "#e69f00", width: 1, dash: [4, 2] };
export const kLandmarkEdge: Stroke = { light: "#009e73", dark: "#2fc79a", width: 0.75, dash: [] };
export const kOtherEdge: Stroke = { light: "#7a7f87", dark: "#8a919c", width: 0.75, dash: [] };
export const kPrior: Stroke = { light: "#cc79a7", dark: "#e6a3c8", width: 1.5, dash: [] };

const kRamps: Record<Theme, Rgb[]> = {
  light: ["#d5d8dc", "#f0c987", "#e58a2c", "#b8430e", "#5c0a12"].map(rgb),
  dark: ["#3a424d", "#7a4a5e", "#c2552f", "#f09a2e", "#ffe9a8"].map(rgb),
};

/** Least (0) to worst (1) residual. Lightness is monotone: grey print and colour-blind readers see the order. */
export function ramp(theme: Theme, t: number): Rgb {
  const stops = kRamps[theme];
  const x = Math.min(1, Math.max(0, Number.isFinite(t) ? t : 0)) * (stops.length - 1);
  const k = Math.min(stops.length - 2, Math.floor(x));
  return stops[k].map((c, d) => c + (x - k) * (stops[k + 1][d] - c)) as Rgb;
}

/** Relative luminance of sRGB (WCAG 2). */
export function luminance(colour: Rgb): number {
  const [r, g, b] = colour.map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}

/** Logarithmic scale of chi2 from the 5th percentile to the largest, at least to what noise cannot make of an edge. */
export interface ResidualScale {
  low: number;
  high: number;
}

/** Far above what noise makes of an edge: 99.9 % of chi2 with 3 to 6 degrees of freedom is 16 to 22. */
const kSuspicious = 100;

export function residualScale(chi2: ArrayLike<number>): ResidualScale | null {
  const all: number[] = [];
  for (let k = 0; k < chi2.length; ++k) if (chi2[k] > 0 && Number.isFinite(chi2[k])) all.push(chi2[k]);
  if (all.length === 0) return null;
  const sorted = Float64Array.from(all).sort();
  const high = Math.max(sorted[sorted.length - 1], kSuspicious);
  // At most twelve decades: residuals that are zero but for rounding say nothing.
  const low = Math.max(sorted[Math.floor(0.05 * (sorted.length - 1))], high * 1e-12);
  return { low: low < high ? low : high / 10, high };
}

/** 0 … 1 for low … high; 0 for what is not positive or not there. */
export function residualFraction(scale: ResidualScale, chi2: number): number {
  if (!(chi2 > scale.low)) return 0;
  return Math.min(1, Math.log(chi2 / scale.low) / Math.log(scale.high / scale.low));
}
