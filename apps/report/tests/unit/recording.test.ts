// SPDX-License-Identifier: BSD-3-Clause
import { expect, test } from "vitest";
import { Recording } from "../../src/data/recording";

const n = 5;

/** Frame k moves variable k mod n to x = k. */
function moving(frames: number) {
  return {
    frames: Array.from({ length: frames }, (_, k) =>
      k === 0 ? { positions: new Array(2 * n).fill(0) } : { changed: [k % n], positions: [k, 0] }),
  };
}

test("a frame is what changed on top of what was before, in whatever order frames are asked for", async () => {
  const recording = await Recording.decode(moving(100), 2, n, 0, "r");
  const expected = (k: number) => Array.from({ length: n }, (_, i) => {
    let last = 0;
    for (let j = 1; j <= k; ++j) if (j % n === i) last = j;
    return last;
  });
  for (const k of [0, 99, 40, 41, 3, 98, 64, 0]) {
    const xyz = recording.positions(k);
    expect(Array.from({ length: n }, (_, i) => xyz[3 * i])).toEqual(expected(k));
  }
});

test("variables that have not arrived are nowhere", async () => {
  const recording = await Recording.decode({
    kind: "time",
    frames: [{ variables: 1, edges: 0, positions: [1, 1] }, { variables: 3, edges: 2, positions: [1, 1, 2, 2, 3, 3] }],
  }, 2, n, 4, "r");
  expect(recording.positions(0)[3]).toBeNaN();
  expect(recording.positions(1)[6]).toBe(3);
  expect(recording.positions(1)[9]).toBeNaN();
  expect(recording.positions(0)[6]).toBeNaN();
  expect(recording.frames[1].edges).toBe(2);
});

test("a recording without frames is refused", async () => {
  await expect(Recording.decode({ frames: [] }, 2, n, 0, "r")).rejects.toThrow("r: no frames");
});
