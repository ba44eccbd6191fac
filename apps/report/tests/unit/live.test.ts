// SPDX-License-Identifier: BSD-3-Clause
import { describe, expect, test } from "vitest";
import type { ExplorationLineJson } from "../../src/data/contract";
import { linesOf } from "../../src/data/live";

const line = (step: number): ExplorationLineJson => ({ step, distance: step, estimate: [step, 0, 0] });
const text = (lines: unknown[]): string => lines.map((one) => `${JSON.stringify(one)}\n`).join("");

/** Answers one after the other; null: the connection is lost. */
function server(answers: (string | null)[]) {
  const asked: string[] = [];
  const get = (async (url: string) => {
    asked.push(url);
    const answer = answers.shift();
    if (answer === null || answer === undefined) throw new TypeError("no connection");
    return new Response(answer);
  }) as unknown as typeof fetch;
  return { asked, get };
}

async function all(get: typeof fetch): Promise<ExplorationLineJson[][]> {
  const batches: ExplorationLineJson[][] = [];
  for await (const batch of linesOf("lines", get, () => Promise.resolve())) batches.push(batch);
  return batches;
}

describe("a run that goes on", () => {
  test("is asked for from where it is known, up to its end", async () => {
    const { asked, get } = server([text([line(0), line(1)]), "", text([line(2), { end: "limit" }]), text([line(9)])]);
    expect(await all(get)).toEqual([[line(0), line(1)], [line(2), { end: "limit" }]]);
    expect(asked).toEqual(["lines?from=1", "lines?from=3", "lines?from=3"]);
  });

  test("is asked for again where the connection is lost, and left where it stays so", async () => {
    const { asked, get } = server([text([line(0)]), null, null, text([line(1)]), null, null, null, text([line(2)])]);
    expect((await all(get)).flat()).toEqual([line(0), line(1)]);
    expect(asked.length).toBe(7);
  });

  test("is refused where it is something else", async () => {
    await expect(all(server(["<html>"]).get)).rejects.toThrow("no line of a recording");
  });
});
