// SPDX-License-Identifier: BSD-3-Clause
// Where axes have marks, and how they are written.

/** The smallest of 1, 2, 5 × 10^k that is at least `atLeast`. */
export function niceStep(atLeast: number): number {
  if (!(atLeast > 0) || !Number.isFinite(atLeast)) return 1;
  const power = Math.floor(Math.log10(atLeast));
  // Written and read, since 10 ** -4 is not the number 0.0001.
  for (const step of [`1e${power}`, `2e${power}`, `5e${power}`].map(Number)) {
    if (step >= atLeast * (1 - 1e-9)) return step;
  }
  return Number(`1e${power + 1}`);
}

/** Multiples of `step` within low … high, free of the error of adding up. */
export function multiples(low: number, high: number, step: number): number[] {
  const all: number[] = [];
  const last = Math.floor(high / step + 1e-9);
  for (let k = Math.ceil(low / step - 1e-9); k <= last && all.length < 1000; ++k) all.push(k === 0 ? 0 : k * step);
  return all;
}

/** About `count` marks. */
export function niceTicks(low: number, high: number, count: number): number[] {
  return multiples(low, high, niceStep((high - low) / Math.max(count, 1)));
}

/** As many digits as the step needs. */
export function tickLabel(value: number, step: number): string {
  const digits = Math.max(0, Math.min(12, -Math.floor(Math.log10(step) + 1e-9)));
  return value.toFixed(digits).replace("-", "−");
}

/** Powers of ten within low … high; if there are fewer than two, also 2 and 5 times them. */
export function logTicks(low: number, high: number): number[] {
  if (!(low > 0) || !(high >= low)) return [];
  const first = Math.floor(Math.log10(low));
  const last = Math.ceil(Math.log10(high));
  const within = (factors: number[]) => {
    const all: number[] = [];
    for (let k = first; k <= last; ++k) {
      for (const f of factors) {
        const value = f * 10 ** k;
        if (value >= low * (1 - 1e-9) && value <= high * (1 + 1e-9)) all.push(value);
      }
    }
    return all;
  };
  const decades = within([1]);
  if (decades.length < 2) return within([1, 2, 5]);
  const stride = Math.ceil(decades.length / 8);
  return decades.filter((_, k) => k % stride === 0);
}
