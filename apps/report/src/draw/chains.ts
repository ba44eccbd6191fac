// SPDX-License-Identifier: BSD-3-Clause
// In which order edges are drawn.
import { EdgeClass, type Edges } from "../data/graph";

/** Edges that make up trajectories, along them; each from the variable with the lower index to the higher. */
export interface Chain {
  edge: Int32Array;
  a: Int32Array;
  b: Int32Array;
}

export function trajectoryChain(edges: Edges): Chain {
  const chosen: number[] = [];
  for (let e = 0; e < edges.count; ++e) {
    const c = edges.class[e];
    if ((c === EdgeClass.odometry || c === EdgeClass.path) && edges.b[e] >= 0) chosen.push(e);
  }
  const low = (e: number) => Math.min(edges.a[e], edges.b[e]);
  chosen.sort((e, f) => low(e) - low(f) || e - f);
  const edge = Int32Array.from(chosen);
  return { edge, a: edge.map(low), b: edge.map((e) => Math.max(edges.a[e], edges.b[e])) };
}

/** The same with up to `stride` edges that follow each other made one: what is drawn while the view moves. */
export function coarser(chain: Chain, stride: number): Chain {
  const a: number[] = [], b: number[] = [], edge: number[] = [];
  let run = 0;
  for (let k = 0; k < chain.a.length; ++k) {
    if (run > 0 && run < stride && chain.a[k] === b[b.length - 1]) {
      b[b.length - 1] = chain.b[k];
      edge[edge.length - 1] = chain.edge[k];
      ++run;
    } else {
      a.push(chain.a[k]);
      b.push(chain.b[k]);
      edge.push(chain.edge[k]);
      run = 1;
    }
  }
  return { edge: Int32Array.from(edge), a: Int32Array.from(a), b: Int32Array.from(b) };
}

/** Distance along the trajectory at both ends of each edge [m]; begins anew where the chain is broken. */
export function arcLengths(chain: Chain, positions: Float32Array): Float32Array {
  const arcs = new Float32Array(2 * chain.a.length);
  let s = 0;
  for (let k = 0; k < chain.a.length; ++k) {
    if (k > 0 && chain.a[k] !== chain.b[k - 1]) s = 0;
    const i = 3 * chain.a[k], j = 3 * chain.b[k];
    arcs[2 * k] = s;
    const length = Math.hypot(positions[j] - positions[i], positions[j + 1] - positions[i + 1], positions[j + 2] - positions[i + 2]);
    if (Number.isFinite(length)) s += length;
    arcs[2 * k + 1] = s;
  }
  return arcs;
}

/**
 * An order in which every tail is a fair sample, with the `worst` of the largest weight last, by rising weight: drawing
 * the last part of it is a coarser picture in which nothing that stands out is missing.
 */
export function drawingOrder(members: Int32Array, weight: ArrayLike<number> | null, worst: number): Int32Array {
  const order = members.slice();
  let state = 0x2545f491;
  for (let k = order.length - 1; k > 0; --k) {
    // xorshift32: the same picture each time
    state ^= state << 13;
    state ^= state >>> 17;
    state ^= state << 5;
    const j = (state >>> 0) % (k + 1);
    const swap = order[k];
    order[k] = order[j];
    order[j] = swap;
  }
  if (!weight) return order;
  const value = (e: number) => (Number.isFinite(weight[e]) ? weight[e] : -1);
  if (order.length <= worst) return order.sort((e, f) => value(e) - value(f));
  const values = Float64Array.from(order, value).sort();
  const threshold = values[values.length - worst];
  const head = order.filter((e) => value(e) < threshold);
  const tail = order.filter((e) => value(e) >= threshold).sort((e, f) => value(e) - value(f));
  order.set(head, 0);
  order.set(tail, head.length);
  return order;
}

export function membersOf(edges: Edges, classes: number[]): Int32Array {
  const chosen: number[] = [];
  for (let e = 0; e < edges.count; ++e) if (classes.includes(edges.class[e]) && edges.b[e] >= 0) chosen.push(e);
  return Int32Array.from(chosen);
}

/**
 * The few edges that no noise explains: above `times` the 99th percentile of chi2, at most `most` of them. Where more than
 * one in a hundred is bad, they need no help to be seen.
 */
export function outliers(chi2: ArrayLike<number>, times: number, most: number, shown: (e: number) => boolean): number[] {
  const known = Float64Array.from(chi2 as ArrayLike<number>).filter((x) => x > 0 && x < Infinity).sort();
  if (known.length === 0) return [];
  const threshold = times * known[Math.floor(0.99 * (known.length - 1))];
  return worstEdges(chi2, most, (e) => shown(e) && chi2[e] > threshold);
}

/** Edges by falling chi2, the first `count` of those that satisfy `shown`. A factor that has several edges counts once. */
export function worstEdges(
  chi2: ArrayLike<number>, count: number, shown: (e: number) => boolean, factor: Int32Array | null = null,
): number[] {
  const best: number[] = [];
  const seen = new Set<number>();
  for (let e = 0; e < chi2.length; ++e) {
    if (!Number.isFinite(chi2[e]) || !shown(e)) continue;
    if (best.length === count && !(chi2[e] > chi2[best[count - 1]])) continue;
    if (factor) {
      if (seen.has(factor[e])) continue;
      seen.add(factor[e]);
    }
    let k = best.length;
    while (k > 0 && chi2[best[k - 1]] < chi2[e]) --k;
    best.splice(k, 0, e);
    if (best.length > count) best.pop();
  }
  return best;
}
