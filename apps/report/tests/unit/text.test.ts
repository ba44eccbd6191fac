// SPDX-License-Identifier: BSD-3-Clause
import { describe, expect, test } from "vitest";
import { bytes, count, graphNames, logLabel, number, seconds, shortNames } from "../../src/ui/format";
import { chi2Line, elapsed } from "../../src/ui/series";

describe("numbers as people read them", () => {
  test("keep their significant digits and need no exponent where plain will do", () => {
    expect([0, 137.91295, 5230, -0.001234, 1.2e8, 1e-10].map((x) => number(x, 4))).toEqual(["0", "137.9", "5230", "−0.001234", "1.20\u200a×\u200a10⁸", "10⁻¹⁰"]);
    expect([null, undefined, NaN].map((x) => number(x))).toEqual(["–", "–", "–"]);
  });
  test("have the unit that fits", () => {
    expect([2e-6, 0.0243, 1.5, 200].map(seconds)).toEqual(["2.00 µs", "24.3 ms", "1.50 s", "3 min 20 s"]);
    expect([512, 60e6, 3 * 2 ** 30, 0].map(bytes)).toEqual(["512 B", "57.2 MiB", "3.00 GiB", "–"]);
    expect(count(1234567)).toBe("1\u202f234\u202f567");
    expect([1e-3, 0.01, 100, 2e5].map(logLabel)).toEqual(["10⁻³", "0.01", "100", "2×10⁵"]);
  });
});

test("files are called by their names alone where these differ", () => {
  expect(shortNames(["/a/b/x.g2o", "c/y.g2o", "@torus"])).toEqual(["x.g2o", "y.g2o", "@torus"]);
  expect(shortNames(["a/x.g2o", "b/x.g2o"])).toEqual(["a/x.g2o", "b/x.g2o"]);
});

test("graphs are called by the name that a report gives, else by their files", () => {
  expect(graphNames([{ file: "/a/x.g2o", name: "city" }, { file: "/b/y.g2o" }])).toEqual(["city", "y.g2o"]);
});

describe("iterations", () => {
  const iterations = [{ chi2: 10, seconds: 0.5 }, { chi2: null, seconds: 0.25 }, { chi2: 2, seconds: null, time: 9 }];
  test("add up in time, unless they say when they ended", () => {
    expect(elapsed(iterations)).toEqual([0.5, 0.75, 9]);
  });
  test("begin with what chi2 was at the start", () => {
    expect(chi2Line("a", 100, iterations, "iteration")).toEqual({ name: "a", x: [0, 1, 2, 3], y: [100, 10, null, 2] });
    expect(chi2Line("a", null, iterations, "time").x).toEqual([0.5, 0.75, 9]);
  });
});
