// SPDX-License-Identifier: BSD-3-Clause
import { describe, expect, test } from "vitest";
import type { ExplorationJson, ExplorationLineJson } from "../../src/data/contract";
import { Exploration } from "../../src/data/exploration";
import { kUnchanged, kUnknown } from "../../src/data/raster";
import { merit, valueScale } from "../../src/draw/floor";

const motion = (step: number, more: Partial<ExplorationLineJson> = {}): ExplorationLineJson => ({ step, distance: step, estimate: [step, 0, 0], ...more });
const run = (lines: ExplorationLineJson[]): ExplorationJson => ({ name: "run", complete: false, lines });

/** Step k sets the cell (k mod 7 − 3, k mod 5) to k mod 101, and moves pose k mod 4; the map grows to all sides. */
function changing(steps: number): ExplorationJson {
  return run(Array.from({ length: steps }, (_, k) => motion(k, {
    map: {
      ...(k === 0 ? { resolution: 0.5, origin: [10, 20] } : {}), x: (k % 7) - 3, y: k % 5, width: 2, height: 1,
      cells: [k % 101, kUnchanged],
    },
    poses: [[k % 4, k, -k, 0]],
    edges: k % 3 === 0 ? [[k, 0, 1, 1]] : undefined,
    removed_edges: k % 3 === 1 ? [k - 1] : undefined,
  })));
}

describe("an exploration", () => {
  test("that goes on is what one that was read at once is", async () => {
    const whole = changing(120);
    const lines = [...whole.lines, { end: "limit", why: "120 motions are made" } as ExplorationLineJson];
    const grown = await Exploration.decode({ ...whole, lines: lines.slice(0, 5) }, 0);
    for (let k = 5; k < lines.length; k += 7) {
      grown.cells(grown.moments.length - 1);  // what has been looked at must not be kept
      grown.graph(grown.moments.length - 1);
      expect(grown.complete).toBe(false);
      await grown.append(lines.slice(k, k + 7));
    }
    const read = await Exploration.decode({ ...whole, lines }, 0);
    expect(grown.complete).toBe(true);
    expect(grown.why).toBe(read.why);
    expect(grown.moments).toEqual(read.moments);
    for (const k of [0, 120, 40, 64, 7]) {
      expect(grown.cells(k)).toEqual(read.cells(k));
      expect(grown.graph(k)).toEqual(read.graph(k));
    }
  });

  test("is at every moment what its lines add up to, in whatever order moments are asked for", async () => {
    const exploration = await Exploration.decode(changing(120), 0);
    for (const k of [0, 119, 64, 65, 31, 32, 33, 3, 118, 0]) {
      const cells = exploration.cells(k);
      const expected = new Map<string, number>();
      for (let i = 0; i <= k; ++i) expected.set(`${(i % 7) - 3} ${i % 5}`, i % 101);
      for (let i = 0; i < cells.values.length; ++i) {
        const place = `${cells.x + (i % cells.width)} ${cells.y + Math.floor(i / cells.width)}`;
        expect(cells.values[i]).toBe(expected.get(place) ?? kUnknown);
      }
      expect(cells.lattice).toEqual({ resolution: 0.5, origin: [10, 20], yaw: 0 });
      const { poses, edges } = exploration.graph(k);
      for (let id = 0; id < 4 && id <= k; ++id) expect(poses.get(id)?.[0]).toBe(k - ((k - id) % 4));
      expect([...edges.keys()]).toEqual(k % 3 === 0 ? [k] : []);
    }
  });

  test("has a decision from the moment at which it was made", async () => {
    const decision = (n: number): ExplorationLineJson => ({ decision: n, kind: "drive", why: `${n}`, chosen: 0, candidates: [{ value: null, what: "a" }, { value: 2, points: [[0, 0], [1, 1]] }, { value: 4 }] });
    const exploration = await Exploration.decode(run([motion(0), decision(0), motion(1), motion(2), decision(1), { end: "limit", why: "so" }]), 0);
    expect([0, 1, 2, 3].map((k) => exploration.decisionAt(k)?.why)).toEqual(["0", "0", "1", "1"]);
    expect(exploration.moments.map((m) => m.label)).toEqual(["start", "motion 1", "motion 2", "end"]);
    expect(exploration.moments[3].estimate).toEqual([2, 0, 0]);
    const scale = valueScale(exploration.decisions[0])!;
    expect(scale).toEqual({ best: 2, worst: 4 });
    expect([2, 3, 4, null].map((v) => merit(scale, v))).toEqual([1, 0.5, 0, 0]);
  });

  test("draws trees and scans from 16-bit steps", async () => {
    const ranges = { type: "u16" as const, count: 3, min: [1], max: [3], base64: Buffer.from(Uint16Array.of(0, 65534, 65535).buffer).toString("base64") };
    const exploration = await Exploration.decode(run([
      motion(0, { scan: { first_angle: -1, angle_step: 0.5, max_range: 2, ranges } }),
      { decision: 0, kind: "drive", candidates: [], chosen: 0, tree: { count: 2, positions: [0, 0, 1, 2], parents: [-1, 0], values: [5, 6] } },
    ]), 0);
    expect([...exploration.moments[0].scan!.ranges]).toEqual([1, 3, NaN]);
    expect([...exploration.decisions[0].tree!.positions]).toEqual([0, 0, 0, 1, 2, 0]);
    expect(valueScale(exploration.decisions[0])).toEqual({ best: 5, worst: 6 });
  });

  test("that is damaged is refused with its line", async () => {
    const refused = (lines: ExplorationLineJson[]) => expect(Exploration.decode(run(lines), 0)).rejects;
    await refused([]).toThrow("exploration 1: not even the start");
    await refused([motion(0, { estimate: [1] })]).toThrow("line 2, estimate: no pose");
    await refused([motion(0), motion(1, { map: { x: 0, y: 0, width: 1, height: 1, cells: [1] } })]).toThrow("without a resolution");
    await refused([motion(0, { map: { resolution: 1, x: 0, y: 0, width: 2, height: 1, cells: [1] } })]).toThrow("line 2, map, cells");
    await refused([motion(0, { map: { resolution: 1, x: 0, y: 0, width: 2e5, height: 2e5, cells: [1] } })]).toThrow();
    await refused([motion(0, { poses: [[1, 2]] })]).toThrow("line 2, poses");
    await refused([{ decision: 0 }]).toThrow("before the start");
    await refused([motion(0), { decision: 0, tree: { count: 1, positions: [0, 0], parents: [3], values: [1] } }]).toThrow("parents");
  });
});
