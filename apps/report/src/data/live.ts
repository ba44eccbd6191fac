// SPDX-License-Identifier: BSD-3-Clause
// The lines of a run that goes on, from the program that runs it: docs/explore.md.
import type { ExplorationLineJson } from "./contract";
import { DataError } from "./decode";

const kTries = 3;
const kPause = 500;  // [ms]

const pause = (ms: number): Promise<void> => new Promise((done) => setTimeout(done, ms));

function parsed(text: string): ExplorationLineJson[] {
  try {
    return text.split("\n").filter((line) => line !== "").map((line) => JSON.parse(line) as ExplorationLineJson);
  } catch {
    throw new DataError("What the program sent is no line of a recording.");
  }
}

/**
 * Lines as they come, several at a time, until the end of the run or of the program. The server answers as soon as there are some, or
 * with nothing after a while. The first line of a recording, its header, is not among them.
 */
export async function* linesOf(url: string, get: typeof fetch = fetch, wait = pause): AsyncGenerator<ExplorationLineJson[]> {
  let next = 1;
  for (let tries = 0; tries < kTries;) {
    let text: string;
    try {
      const answer = await get(`${url}?from=${next}`, { cache: "no-store" });
      if (!answer.ok) throw new Error(answer.statusText);
      text = await answer.text();
      tries = 0;
    } catch {
      ++tries;
      await wait(kPause);
      continue;
    }
    const lines = parsed(text);
    next += lines.length;
    if (lines.length > 0) yield lines;
    if (lines.some((line) => line.end !== undefined)) return;
    await wait(kPause);  // the page draws what it has, instead of every line by itself
  }
}
