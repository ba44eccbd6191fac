// SPDX-License-Identifier: BSD-3-Clause
import { describe, expect, test } from "vitest";
import { axes, between, EyeControl } from "../../src/draw/camera";
import { arcLengths, coarser, drawingOrder, outliers, trajectoryChain, worstEdges } from "../../src/draw/chains";
import { luminance, ramp, residualFraction, residualScale, rgb, strokes, type Theme } from "../../src/draw/colour";
import { confidenceRadius, ellipseSegments, halfAxes } from "../../src/draw/ellipses";
import { nearestEdge, nearestPoint, project, squaredDistance } from "../../src/draw/pick";
import { logTicks, multiples, niceStep, niceTicks, tickLabel } from "../../src/draw/ticks";
import { countsOnce, factorCount, type Edges } from "../../src/data/graph";

describe("ticks", () => {
  test("are 1, 2 or 5 times a power of ten apart", () => {
    expect([0.3, 1, 1.2, 4.9, 51, 7e-5].map(niceStep)).toEqual([0.5, 1, 2, 5, 100, 1e-4]);
    expect(niceStep(NaN)).toBe(1);
  });
  test("lie within the range and on zero exactly", () => {
    expect(multiples(-0.25, 0.31, 0.1).map((x) => x.toFixed(1))).toEqual(["-0.2", "-0.1", "0.0", "0.1", "0.2", "0.3"]);
    expect(Object.is(multiples(-1, 1, 1)[1], 0)).toBe(true);
    expect(niceTicks(0, 95, 5)).toEqual([0, 20, 40, 60, 80]);
  });
  test("have as many digits as their step", () => {
    expect([tickLabel(0.30000000000000004, 0.1), tickLabel(-200, 100), tickLabel(1.25, 0.05)]).toEqual(["0.3", "−200", "1.25"]);
  });
  test("of a logarithmic axis are powers of ten, with 2 and 5 where those are too few", () => {
    expect(logTicks(0.5, 2000)).toEqual([1, 10, 100, 1000]);
    expect(logTicks(1.5, 8)).toEqual([2, 5]);
    expect(logTicks(1e-12, 1e12).length).toBeLessThanOrEqual(9);
    expect(logTicks(0, 10)).toEqual([]);
  });
});

describe("colours", () => {
  test.each<[Theme, number]>([["light", -1], ["dark", 1]])("of residuals in the %s theme change lightness one way only", (theme, sign) => {
    const all = Array.from({ length: 41 }, (_, k) => luminance(ramp(theme, k / 40)));
    for (let k = 1; k < all.length; ++k) expect(sign * (all[k] - all[k - 1])).toBeGreaterThan(0);
  });
  test("of the worst residual stand out from paper", () => {
    const contrast = (a: string, b: [number, number, number]) => {
      const [x, y] = [luminance(rgb(a)), luminance(b)].sort((p, q) => q - p);
      return (x + 0.05) / (y + 0.05);
    };
    expect(contrast("#fcfcfb", ramp("light", 1))).toBeGreaterThan(7);
    expect(contrast("#14171b", ramp("dark", 1))).toBeGreaterThan(7);
  });
  test("run from the 5th percentile to the largest on a logarithmic scale", () => {
    const chi2 = [...Array.from({ length: 99 }, () => 1), 1e4, NaN, 0];
    const scale = residualScale(chi2)!;
    expect(scale).toEqual({ low: 1, high: 1e4 });
    expect([0, 1, 100, 1e4, 1e9, NaN].map((x) => residualFraction(scale, x))).toEqual([0, 0, 0.5, 1, 1, 0]);
    expect(residualScale([0, NaN])).toBeNull();
    expect(residualScale([3])).toEqual({ low: 3, high: 100 });
    expect(residualScale([300])).toEqual({ low: 30, high: 300 });
  });
  test("of a graph in which nothing is wrong are all pale", () => {
    const scale = residualScale([0.001, 0.01, 0.02, 0.2])!;
    expect(residualFraction(scale, 0.2)).toBeLessThan(0.6);
  });
  test("and dashes differ between all estimates of a graph", () => {
    const all = strokes(["estimate", "initial", "truth", "peer", "peer", "estimate", "peer"]);
    expect(new Set(all.map((s) => s.light)).size).toBe(all.length);
    expect(new Set(all.map((s) => s.dash.join())).size).toBe(all.length);
  });
});

describe("picking", () => {
  test("projects to pixels from the top left, and refuses what is behind the eye", () => {
    const control = new EyeControl(false);
    control.width = 200;
    control.height = 100;
    control.eye = { target: [0, 0, 0], yaw: 0, pitch: 0, distance: 10 };
    const camera = control.camera();
    const matrix = camera.projectionMatrix.clone().multiply(camera.matrixWorldInverse).elements;
    const out = new Float32Array(9);
    project(Float32Array.from([0, 0, 0, 0, -20, 0, 0, 0, control.metresPerPixel * 10]), matrix, 200, 100, out);
    expect(out[0]).toBeCloseTo(100, 3);
    expect(out[1]).toBeCloseTo(50, 3);
    expect(out[3]).toBeNaN();
    expect(out[7]).toBeCloseTo(40, 2);
  });
  test("finds the nearest point, and of two at one place the one in front", () => {
    const screen = Float32Array.from([10, 10, 0.5, 14, 10, 0.1, NaN, NaN, NaN, 10, 10, 0.2]);
    expect(nearestPoint(screen, 4, 10.1, 10, 5, () => true).index).toBe(3);
    expect(nearestPoint(screen, 4, 10.1, 10, 5, (i) => i === 1).index).toBe(1);
    expect(nearestPoint(screen, 1, 40, 10, 5, () => true).index).toBe(-1);
  });
  test("measures distances to segments, not to lines", () => {
    expect(squaredDistance(5, 3, 0, 0, 10, 0)).toBe(9);
    expect(squaredDistance(13, 4, 0, 0, 10, 0)).toBe(25);
    expect(squaredDistance(3, 4, 0, 0, 0, 0)).toBe(25);
  });
  test("finds the nearest edge, and of two that coincide the worse", () => {
    const screen = Float32Array.from([0, 0, 0, 100, 0, 0, 100, 50, 0, NaN, NaN, NaN]);
    const a = Int32Array.from([0, 0, 1, 0, 3]);
    const b = Int32Array.from([1, 1, 2, -1, 0]);
    expect(nearestEdge(screen, a, b, 5, 50, 2, 5, () => true, [1, 7, 100, 0, 0]).index).toBe(1);
    expect(nearestEdge(screen, a, b, 5, 98, 30, 5, () => true).index).toBe(2);
    expect(nearestEdge(screen, a, b, 5, 50, 20, 5, () => true).index).toBe(-1);
    expect(nearestEdge(screen, a, b, 1, 98, 30, 5, () => true).index).toBe(-1);
  });
});

function edgesOf(rows: [number, number, number][]): Edges {
  return {
    count: rows.length, a: Int32Array.from(rows, (r) => r[0]), b: Int32Array.from(rows, (r) => r[1]), class: Uint8Array.from(rows, (r) => r[2]),
    types: [], type: new Uint8Array(rows.length), factor: null, columns: [],
  };
}

describe("edges", () => {
  test("are counted by the factors that they are of", () => {
    const edges = edgesOf([[0, 1, 0], [0, 2, 0], [0, 5, 2], [1, 2, 0]]);
    expect(factorCount(edges)).toBe(4);
    edges.factor = Int32Array.from([0, 0, 0, 1]);
    expect(factorCount(edges)).toBe(2);
    expect([0, 1, 2, 3].map((e) => countsOnce(edges, e))).toEqual([true, false, true, true]);
  });
});

describe("drawing orders", () => {
  test("follow the trajectory even where edges point backwards or come mixed", () => {
    const chain = trajectoryChain(edgesOf([[2, 1, 0], [0, 3, 1], [0, 1, 0], [3, 2, 4], [0, -1, 3]]));
    expect([...chain.a]).toEqual([0, 1, 2]);
    expect([...chain.b]).toEqual([1, 2, 3]);
    expect([...chain.edge]).toEqual([2, 0, 3]);
  });
  test("coarser ones join edges that follow each other and never bridge a gap", () => {
    const chain = trajectoryChain(edgesOf([[0, 1, 0], [1, 2, 0], [2, 3, 0], [5, 6, 0], [6, 7, 0]]));
    const coarse = coarser(chain, 2);
    expect([...coarse.a]).toEqual([0, 2, 5]);
    expect([...coarse.b]).toEqual([2, 3, 7]);
  });
  test("lengths along the trajectory add up and begin anew after a gap", () => {
    const chain = trajectoryChain(edgesOf([[0, 1, 0], [1, 2, 0], [3, 4, 0]]));
    const xyz = Float32Array.from([0, 0, 0, 3, 4, 0, 3, 4, 2, 0, 0, 0, 0, 1, 0]);
    expect([...arcLengths(chain, xyz)]).toEqual([0, 5, 5, 7, 0, 1]);
  });
  test("end with the worst, and lose none", () => {
    const members = Int32Array.from({ length: 1000 }, (_, k) => k);
    const chi2 = members.map((k) => (k * 7919) % 1009);
    const order = drawingOrder(members, chi2, 20);
    expect([...order].sort((x, y) => x - y)).toEqual([...members]);
    const tail = [...order.slice(-20)].map((e) => chi2[e]);
    expect(tail).toEqual([...chi2].sort((x, y) => x - y).slice(-20));
    expect([...drawingOrder(members, null, 20)]).toEqual([...drawingOrder(members, null, 20)]);
  });
  test("outliers are few, and none where all is well", () => {
    const chi2 = Array.from({ length: 1000 }, (_, k) => 1 + (k % 10));
    expect(outliers(chi2, 5, 10, () => true)).toEqual([]);
    chi2[500] = 4000;
    chi2[7] = 60;
    expect(outliers(chi2, 5, 10, () => true)).toEqual([500, 7]);
    expect(outliers(chi2, 5, 10, (e) => e !== 500)).toEqual([7]);
    expect(outliers([], 5, 10, () => true)).toEqual([]);
  });
  test("the worst edges come by falling chi2, without NaN, and a factor once", () => {
    const chi2 = [1, NaN, 9, 4, 9, 2];
    expect(worstEdges(chi2, 3, () => true)).toEqual([2, 4, 3]);
    expect(worstEdges(chi2, 3, () => true, Int32Array.from([0, 1, 2, 3, 2, 4]))).toEqual([2, 3, 5]);
    expect(worstEdges(chi2, 3, (e) => e < 2)).toEqual([0]);
  });
});

describe("ellipses", () => {
  test("hold what they say, in two dimensions and in three", () => {
    expect(confidenceRadius(0.95, 2)).toBeCloseTo(2.4477, 3);
    expect(confidenceRadius(0.95, 3)).toBeCloseTo(2.7955, 3);
    expect(confidenceRadius(0.6827, 3)).toBeCloseTo(1.8779, 3);
  });
  test("half axes times themselves give the covariance back, the longest first", () => {
    const upper = [4, 1.2, -0.3, 2, 0.5, 1];
    const a = halfAxes(upper)!;
    const entry = (i: number, j: number) => a.reduce((sum, axis) => sum + axis[i] * axis[j], 0);
    const back = [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
    back.forEach((x, k) => expect(x).toBeCloseTo(upper[k], 10));
    const lengths = a.map((axis) => Math.hypot(...axis));
    expect(lengths).toEqual([...lengths].sort((x, y) => y - x));
  });
  test("that are not there or not positive are not drawn", () => {
    expect(halfAxes([NaN, 0, 0, 1, 0, 1])).toBeNull();
    expect(halfAxes([1, 2, 0, 1, 0, 1])).toBeNull();
    expect(ellipseSegments([0, 0, 0], [NaN, 0, 0, 1, 0, 1], 0, 2, 1, 8)).toEqual([]);
  });
  test("in a plan lie in the plane", () => {
    const points = ellipseSegments([1, 2, 0], [4, 0, 0, 1, 0, 0], 0, 2, 1, 16);
    expect(points.length).toBe(16 * 6);
    for (let k = 0; k < points.length; k += 3) {
      expect(points[k + 2]).toBeCloseTo(0, 12);
      expect(((points[k] - 1) / 2) ** 2 + (points[k + 1] - 2) ** 2).toBeCloseTo(1, 6);
    }
  });
});

describe("the eye", () => {
  const control = (plan: boolean) => {
    const all = new EyeControl(plan);
    all.width = 300;
    all.height = 200;
    return all;
  };
  test("has axes that are orthonormal and right-handed", () => {
    const { right, up, forward } = axes(0.7, -0.4);
    const dot = (a: number[], b: number[]) => a.reduce((sum, x, d) => sum + x * b[d], 0);
    expect(dot(right, up)).toBeCloseTo(0);
    expect(dot(up, forward)).toBeCloseTo(0);
    expect(dot(forward, forward)).toBeCloseTo(1);
    expect(right[1] * up[2] - right[2] * up[1]).toBeCloseTo(-forward[0]);
  });
  test.each([true, false])("keeps what is under the pointer in place while zooming (plan: %s)", (plan) => {
    const c = control(plan);
    c.eye = { target: [5, 6, 0], yaw: 0, pitch: Math.PI / 2, distance: 10 };
    const world = (x: number, y: number) => [c.eye.target[0] + (x - 150) * c.metresPerPixel, c.eye.target[1] + (100 - y) * c.metresPerPixel];
    const before = world(40, 30);
    c.zoom(0.5, 40, 30);
    const after = world(40, 30);
    expect(after[0]).toBeCloseTo(before[0]);
    expect(after[1]).toBeCloseTo(before[1]);
  });
  test.each([true, false])("fits everything into the picture (plan: %s)", (plan) => {
    const c = control(plan);
    const cloud = Float32Array.from([-10, -1, 0, 10, 1, plan ? 0 : 7, 3, -1, plan ? 0 : -4, NaN, NaN, NaN]);
    c.eye = c.fitting([cloud], 0.3 * Number(!plan), plan ? Math.PI / 2 : 0.4);
    const camera = c.camera();
    const out = new Float32Array(12);
    project(cloud, camera.projectionMatrix.clone().multiply(camera.matrixWorldInverse).elements, 300, 200, out);
    for (let i = 0; i < 9; i += 3) {
      expect(out[i]).toBeGreaterThan(0);
      expect(out[i]).toBeLessThan(300);
      expect(out[i + 1]).toBeGreaterThan(0);
      expect(out[i + 1]).toBeLessThan(200);
    }
  });
  test("flies the short way round and arrives", () => {
    const from = { target: [0, 0, 0] as [number, number, number], yaw: 3, pitch: 0, distance: 1 };
    const to = { target: [1, 2, 3] as [number, number, number], yaw: -3, pitch: 1, distance: 100 };
    expect(between(from, to, 0.5).yaw).toBeCloseTo(Math.PI);
    expect(between(from, to, 0.5).distance).toBeCloseTo(10);
    expect(between(from, to, 1).target).toEqual([1, 2, 3]);
  });
});
