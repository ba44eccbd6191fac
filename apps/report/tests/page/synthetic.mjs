// SPDX-License-Identifier: BSD-3-Clause
// Payloads as the program would write them, made of nothing but a seed.

export function embed(template, payload) {
  const parts = template.split("@CAIRN_DATA@");
  if (parts.length !== 2) throw new Error("the template must hold the placeholder once");
  return parts[0] + JSON.stringify(payload).replaceAll("<", "\\u003c") + parts[1];
}

const kTypes = new Map([
  [Float32Array, "f32"], [Float64Array, "f64"], [Int32Array, "i32"], [BigInt64Array, "i64"], [Uint8Array, "u8"], [Uint16Array, "u16"],
]);

export function pack(numbers) {
  const base64 = Buffer.from(numbers.buffer, numbers.byteOffset, numbers.byteLength).toString("base64");
  return { type: kTypes.get(numbers.constructor), count: numbers.length, base64 };
}

export function randomNumbers(seed) {
  let state = seed >>> 0 || 1;
  const uniform = () => {
    state ^= state << 13;
    state ^= state >>> 17;
    state ^= state << 5;
    return (state >>> 0) / 4294967296;
  };
  const normal = () => Math.sqrt(-2 * Math.log(1 - uniform())) * Math.cos(2 * Math.PI * uniform());
  return { uniform, normal };
}

/** Positions with an error that grows along the way, as integrated odometry has it. */
function drift(truth, dimension, step, random) {
  const all = new Float32Array(truth.length);
  const error = new Float64Array(3);
  for (let i = 0; i < truth.length; i += dimension) {
    for (let d = 0; d < dimension; ++d) {
      error[d] += step * random.normal();
      all[i + d] = truth[i + d] + error[d];
    }
  }
  return all;
}

function blend(from, to, t) {
  return from.map((x, k) => x + t * (to[k] - x));
}

function quantized(xyz, dimension) {
  const min = new Array(dimension).fill(Infinity), max = new Array(dimension).fill(-Infinity);
  for (let i = 0; i < xyz.length; ++i) {
    const d = i % dimension;
    min[d] = Math.min(min[d], xyz[i]);
    max[d] = Math.max(max[d], xyz[i]);
  }
  const numbers = Uint16Array.from(xyz, (x, i) => {
    const d = i % dimension;
    return Math.round(((x - min[d]) / (max[d] - min[d] || 1)) * 65534);
  });
  return { ...pack(numbers), min, max };
}

function iterations(initial, final, n, seconds, random) {
  let chi2 = initial;
  return Array.from({ length: n }, (_, k) => {
    chi2 = final + (chi2 - final) * (0.04 + 0.1 * random.uniform());
    return {
      chi2: k === n - 1 ? final : chi2, step_norm: 300 * 0.12 ** k, lambda: 1e-4 * 0.3 ** k, accepted: true,
      seconds: (seconds / n) * (0.8 + 0.4 * random.uniform()),
    };
  });
}

const kSolvers = ["block_cholesky", "cholmod", "eigen"];

function runs(initial, final, seconds, random) {
  return [...kSolvers.map((solver, k) => ["levenberg_marquardt", solver, 1 + 0.7 * k]), ["ceres", "-", 2.9]].map(([optimizer, solver, slower]) => ({
    name: solver === "-" ? optimizer : solver, optimizer, linear_solver: solver, threads: 2, status: "converged",
    chi2: { initial, final }, iterations: iterations(initial, final, 7, seconds * slower, random),
    seconds: { total: seconds * slower, linearize: 0.2 * seconds, analyze: 0.1 * seconds, factorize: 0.4 * seconds * slower, solve: 0.1 * seconds, update: 0.1 * seconds },
    solver: { ordering: "amd", factor_nonzeros: Math.round(9e5 * slower), factor_flops: 1e8 }, peak_memory_bytes: 6e7 * slower, notes: [],
  }));
}

function recording(from, to, dimension, chi2Initial, chi2Final, frames) {
  return {
    name: "levenberg_marquardt", kind: "iterations",
    frames: Array.from({ length: frames }, (_, k) => {
      const t = k === 0 ? 0 : 1 - 0.35 ** k;
      return {
        label: k === 0 ? "start" : "", iteration: k, chi2: chi2Final + (chi2Initial - chi2Final) * (1 - t) ** 2,
        positions: quantized(blend(from, to, k === frames - 1 ? 1 : t), dimension),
      };
    }),
  };
}

/** chi2 of edges that are as good as their noise says, but for those named. */
function residuals(count, size, random, wrong = new Map()) {
  const chi2 = new Float32Array(count);
  for (let e = 0; e < count; ++e) {
    let sum = 0;
    for (let k = 0; k < size; ++k) sum += random.normal() ** 2;
    chi2[e] = wrong.get(e) ?? sum;
  }
  return chi2;
}

/** A walk on a city's grid, with landmarks, covariances, an online recording and one wrong loop closure. */
export function manhattan(poses = 3500, seed = 7) {
  const random = randomNumbers(seed);
  const landmarks = 60;
  const n = poses + landmarks;
  const truth = new Float32Array(2 * n);
  const yaw = new Float32Array(n).fill(NaN);
  let x = 0, y = 0, heading = 0;
  const size = Math.ceil(Math.sqrt(poses) * 0.75);
  for (let i = 0; i < poses; ++i) {
    if (i % 10 === 0) {
      for (let tries = 0; tries < 20; ++tries) {
        const turn = [0, 1, 3][Math.floor(random.uniform() * 3)];
        const next = (heading + turn) % 4;
        const [dx, dy] = [[1, 0], [0, 1], [-1, 0], [0, -1]][next];
        if (Math.abs(x + 10 * dx) <= size && Math.abs(y + 10 * dy) <= size) {
          heading = next;
          break;
        }
      }
    }
    truth[2 * i] = x;
    truth[2 * i + 1] = y;
    yaw[i] = (heading * Math.PI) / 2;
    const [dx, dy] = [[1, 0], [0, 1], [-1, 0], [0, -1]][heading];
    x += dx;
    y += dy;
  }
  for (let l = 0; l < landmarks; ++l) {
    truth[2 * (poses + l)] = (random.uniform() * 2 - 1) * size;
    truth[2 * (poses + l) + 1] = (random.uniform() * 2 - 1) * size;
  }
  const a = [], b = [], kind = [];
  const seen = new Map();
  for (let i = 0; i < poses; ++i) {
    if (i > 0) a.push(i - 1), b.push(i), kind.push(0);
    const key = `${truth[2 * i]},${truth[2 * i + 1]}`;
    const earlier = seen.get(key);
    if (earlier !== undefined && i - earlier > 20 && random.uniform() < 0.8) a.push(earlier), b.push(i), kind.push(1);
    seen.set(key, i);
    if (i % 5 === 0) {
      for (let l = 0; l < landmarks; ++l) {
        const d = Math.hypot(truth[2 * i] - truth[2 * (poses + l)], truth[2 * i + 1] - truth[2 * (poses + l) + 1]);
        if (d < 5) a.push(i), b.push(poses + l), kind.push(2);
      }
    }
  }
  const wrong = a.length;
  a.push(Math.floor(poses * 0.11)), b.push(Math.floor(poses * 0.83)), kind.push(1);
  a.push(0), b.push(-1), kind.push(3);
  const m = a.length;
  const estimate = truth.map((v) => v + 0.06 * random.normal());
  const initial = drift(truth, 2, 0.16, random);
  const covariance = { variable: [], upper: [] };
  for (let i = 0; i < poses; i += 5) {
    const s = 0.02 + 0.00006 * i;
    const angle = i / 400;
    const [c, w] = [Math.cos(angle), Math.sin(angle)];
    const [p, q] = [(3 * s) ** 2, s ** 2];
    covariance.variable.push(i);
    covariance.upper.push(c * c * p + w * w * q, c * w * (p - q), w * w * p + c * c * q);
  }
  const chi2 = residuals(m, 3, random, new Map([[wrong, 5230]]));
  const frames = 24;
  const online = {
    name: "incremental", kind: "time",
    frames: Array.from({ length: frames }, (_, k) => {
      const present = Math.floor((poses * (k + 1)) / frames);
      const edges = b.findIndex((j, e) => j >= present && j < poses && a[e] < poses);
      const noisy = drift(truth.subarray(0, 2 * present), 2, 0.03, random);
      return {
        label: "", time: k * 12.5, chi2: 90 + 800 * k + 300 * random.uniform(), variables: present, edges: edges < 0 ? m : edges,
        positions: pack(noisy), seconds: 0.002 + 0.0004 * k + (k % 7 === 3 ? 0.03 : 0),
      };
    }),
  };
  return {
    graph: {
      name: "manhattan.g2o", comment: "A walk on a grid, with one wrong loop closure.", dimension: 2, origin: [1000, -250, 0],
      variables: {
        count: n, ids: pack(BigInt64Array.from({ length: n }, (_, i) => BigInt(i))),
        types: [{ name: "VERTEX_SE2", role: "pose" }, { name: "VERTEX_XY", role: "landmark" }],
        type: pack(Uint8Array.from({ length: n }, (_, i) => (i < poses ? 0 : 1))), fixed: [0],
      },
      edges: {
        count: m, a: pack(Int32Array.from(a)), b: pack(Int32Array.from(b)), class: pack(Uint8Array.from(kind)),
        types: [{ name: "EDGE_SE2", residual_size: 3 }, { name: "EDGE_SE2_XY", residual_size: 2 }, { name: "EDGE_PRIOR_SE2", residual_size: 3 }],
        type: pack(Uint8Array.from(kind, (k) => [0, 0, 1, 2][k])),
        columns: [{ name: "distance measured", unit: "m", values: pack(Float32Array.from(a, () => random.uniform())) }],
      },
      estimates: [
        { name: "block_cholesky", role: "estimate", run: 0, positions: pack(estimate), orientation: pack(yaw), edge_chi2: pack(chi2), covariance: { variable: covariance.variable, upper: pack(Float32Array.from(covariance.upper)) } },
        { name: "initial guess", role: "initial", positions: pack(initial), edge_chi2: pack(residuals(m, 3, random).map((v) => v * 900)), chi2: 6.4e7 },
        { name: "ground truth", role: "truth", positions: pack(truth) },
        { name: "ceres", role: "peer", run: 3, positions: pack(estimate.map((v) => v + 0.15 * random.normal())), edge_chi2: pack(residuals(m, 3, random)) },
      ],
      runs: runs(6.4e7, 5312.4, 0.031, random),
      recordings: [recording(initial, estimate, 2, 6.4e7, 5312.4, 9), online],
    },
    wrong,
  };
}

/** Rings of a sphere; each pose is joined to the one above it. */
export function sphere(rings = 50, around = 50, seed = 3) {
  const random = randomNumbers(seed);
  const n = rings * around;
  const truth = new Float32Array(3 * n);
  const turns = new Float32Array(4 * n);
  const radius = 50;
  for (let i = 0; i < n; ++i) {
    const latitude = ((i / n) * 0.94 + 0.03 - 0.5) * Math.PI;
    const longitude = (2 * Math.PI * (i % around)) / around;
    truth[3 * i] = radius * Math.cos(latitude) * Math.cos(longitude);
    truth[3 * i + 1] = radius * Math.cos(latitude) * Math.sin(longitude);
    truth[3 * i + 2] = radius * Math.sin(latitude);
    const yaw = longitude + Math.PI / 2;
    turns.set([0, 0, Math.sin(yaw / 2), Math.cos(yaw / 2)], 4 * i);
  }
  const a = [], b = [], kind = [];
  for (let i = 1; i < n; ++i) {
    a.push(i - 1), b.push(i), kind.push(0);
    if (i >= around) a.push(i - around), b.push(i), kind.push(1);
  }
  const m = a.length;
  const estimate = truth.map((v) => v + 0.12 * random.normal());
  const initial = drift(truth, 3, 0.5, random);
  const variable = Int32Array.from({ length: Math.ceil(n / 10) }, (_, k) => 10 * k);
  const upper = new Float32Array(6 * variable.length);
  for (let k = 0; k < variable.length; ++k) upper.set([0.3, 0.05, 0, 0.2, 0, 0.6], 6 * k);
  return {
    name: "sphere.g2o", dimension: 3,
    variables: { count: n, ids: "sequence", types: [{ name: "VERTEX_SE3:QUAT", role: "pose" }] },
    edges: {
      count: m, a: pack(Int32Array.from(a)), b: pack(Int32Array.from(b)), class: pack(Uint8Array.from(kind)),
      types: [{ name: "EDGE_SE3:QUAT", residual_size: 6 }],
    },
    estimates: [
      { name: "initial guess", role: "initial", positions: pack(initial), chi2: 1.2e8 },
      { name: "block_cholesky", role: "estimate", run: 0, positions: pack(estimate), orientation: pack(turns), edge_chi2: pack(residuals(m, 6, random)), covariance: { variable: pack(variable), upper: pack(upper) } },
      { name: "cholmod", role: "peer", run: 1, positions: pack(estimate.map((v) => v + 0.3 * random.normal())), edge_chi2: pack(residuals(m, 6, random)) },
    ],
    runs: runs(1.2e8, 727.15, 0.12, random),
    recordings: [recording(initial, estimate, 3, 1.2e8, 727.15, 12)],
  };
}

/** A tower of rings, `perPose` edges a pose. */
export function large(poses = 100000, perPose = 3, frames = 0, seed = 5) {
  const random = randomNumbers(seed);
  const around = 400;
  const truth = new Float32Array(3 * poses);
  for (let i = 0; i < poses; ++i) {
    const angle = (2 * Math.PI * i) / around;
    const layer = i / around;
    const radius = 60 + 25 * Math.sin(layer * 0.09);
    truth[3 * i] = radius * Math.cos(angle) + 0.15 * random.normal();
    truth[3 * i + 1] = radius * Math.sin(angle) + 0.15 * random.normal();
    truth[3 * i + 2] = layer * 0.8;
  }
  const m = poses * perPose;
  const a = new Int32Array(m), b = new Int32Array(m), kind = new Uint8Array(m);
  for (let e = 0; e < m; ++e) {
    if (e < poses - 1) {
      a[e] = e;
      b[e] = e + 1;
    } else {
      const i = Math.floor(random.uniform() * (poses - 6 * around));
      a[e] = i;
      b[e] = i + around * (1 + Math.floor(random.uniform() * 5)) + Math.floor(random.normal() * 2);
      b[e] = Math.max(0, Math.min(poses - 1, b[e]));
      kind[e] = 1;
    }
  }
  const initial = drift(truth, 3, 0.02, random);
  return {
    name: `tower of ${poses}`, dimension: 3,
    variables: { count: poses, ids: pack(BigInt64Array.from({ length: poses }, (_, i) => BigInt(i))), types: [{ name: "VERTEX_SE3:QUAT", role: "pose" }] },
    edges: { count: m, a: pack(a), b: pack(b), class: pack(kind), types: [{ name: "EDGE_SE3:QUAT", residual_size: 6 }] },
    estimates: [
      { name: "block_cholesky", role: "estimate", positions: pack(truth), edge_chi2: pack(residuals(m, 6, random, new Map([[m - 5, 4e5]]))), chi2: 1.9e6 },
      { name: "initial guess", role: "initial", positions: pack(initial), chi2: 3e9 },
    ],
    recordings: frames > 0 ? [recording(initial, truth, 3, 3e9, 1.9e6, frames)] : [],
  };
}

export function bench(seed = 11) {
  const random = randomNumbers(seed);
  const graph = (file, variables, factors, seconds, final) => ({
    graph: { file, variables, factors, residual_size: factors * 3, tangent_size: variables * 3 },
    configurations: [["levenberg_marquardt", "block_cholesky", 1], ["levenberg_marquardt", "cholmod", 1.42], ["levenberg_marquardt", "eigen", 2.2], ["ceres", "-", 3.1]]
      .map(([optimizer, linear_solver, slower], k) => {
        const median = seconds * slower;
        const off = k === 3 && file.startsWith("torus") ? 2.4e-4 : k * 3e-12;
        return {
          optimizer, linear_solver, error: null, status: k === 3 && off > 1e-6 ? "max_iterations" : "converged",
          chi2: { initial: final * 1e4, final: final * (1 + off), relative_difference: off, agrees: off < 1e-6 }, iterations: 7,
          seconds: { median, min: median * 0.93, max: median * (1.08 + 0.2 * random.uniform()), per_iteration: median / 7 }, ratio: slower * (0.97 + 0.06 * random.uniform()),
          solver: { ordering: "amd", factor_nonzeros: Math.round(variables * 90 * slower), factor_flops: 1e9 }, notes: [],
          peak_memory_bytes: variables * 9000 * slower, runs: [], history: iterations(final * 1e4, final * (1 + off), 7, median, random),
        };
      }),
  });
  return {
    cairn: "0.1.0", command: "bench", threads: 2, repeat: 9, initial: "as_given", loss: null, max_iterations: 100, tolerance: 1e-10, interrupted: false,
    machine: { cpu: "A processor of no particular make", cores: 2 }, build: { compiler: "gcc 12.2.0", flags: "-O3", simd: "avx512" },
    graphs: [graph("manhattan.g2o", 3500, 5453, 0.0243, 137.913), graph("sphere.g2o", 2500, 4949, 0.164, 727.15), graph("torus.g2o", 5000, 9048, 0.391, 12113.8)],
  };
}

/** A robot in a square room of `size` cells a side, with a tree and candidates at every eighth motion. */
export function exploration(motions = 60, size = 60, seed = 17) {
  const random = randomNumbers(seed);
  const lines = [];
  for (let k = 0; k <= motions; ++k) {
    const angle = (2 * Math.PI * k) / motions;
    const [x, y] = [2 * Math.cos(angle), 2 * Math.sin(angle)];
    const cells = Uint8Array.from({ length: size * 4 }, (_, i) => (i % size === 0 || i % size === size - 1 ? 97 : Math.round(12 * random.uniform())));
    lines.push({
      step: k, decision: Math.ceil(k / 8), distance: (12.6 * k) / motions, estimate: [x, y, angle + Math.PI / 2], truth: [x + 0.02 * random.normal(), y - 0.05, angle + 1.6],
      covariance: [0.02, 0.005, 0.01], coverage: 2 * k + 1, map_entropy: 40 - k / 3, trajectory_entropy: -12 + k / 30, kept: k + 1, loops: Math.floor(k / 10), collisions: 0,
      scan: { first_angle: -1.5, angle_step: 0.1, max_range: 4, ranges: quantized(Float32Array.from({ length: 31 }, () => 1 + random.uniform()), 1) },
      poses: [[k, x, y, angle]], edges: k > 0 ? [[k, k - 1, k, 0], ...(k % 10 === 0 ? [[1000 + k, 0, k, 1]] : [])] : [],
      map: { ...(k === 0 ? { resolution: 0.1, origin: [-3, -3], yaw: 0 } : {}), x: 0, y: Math.min(k, size - 4), width: size, height: 4, cells: pack(cells) }, time: k,
    });
    if (k % 8 !== 0) continue;
    const nodes = 200;
    const positions = new Float32Array(2 * nodes);
    for (let i = 0; i < 2 * nodes; ++i) positions[i] = (i % 2 === 0 ? x : y) + (i < 2 ? 0 : random.normal());
    lines.push({
      decision: k / 8, kind: "drive", why: `to the frontier of ${k} m`, chosen: 1,
      candidates: [3, 1, 2].map((value) => ({ value, what: `frontier ${value}`, length: value, change: { trajectory: 0.1, map: -value, alpha: 0.9 }, points: [[x, y], [x + value / 2, y + 0.5], [x + value / 2, y - 1]] })),
      tree: {
        count: nodes, positions: quantized(positions, 2), parents: pack(Int32Array.from({ length: nodes }, (_, i) => Math.floor((i + 1) / 2) - 1)),
        values: quantized(Float32Array.from({ length: nodes }, (_, i) => i / 50), 1),
      },
    });
  }
  lines.push({ end: "limit", why: "12 m are driven", converged: true, notes: ["A note."], time: motions });
  return { name: "robot.jsonl", complete: true, header: { floor: "room.yaml", seed: 3, parts: { explorer: "frontier", mapper: "log_odds" }, robot: { radius: 0.2 } }, lines };
}

export function report(members) {
  return {
    format: "cairn-report", version: 1, kind: "view", cairn: "0.1.0", title: "demo", command: "cairn view manhattan.g2o sphere.g2o", created: "2026-11-01T12:00:00Z",
    machine: { cpu: "A processor of no particular make", cores: 2 }, build: { compiler: "gcc 12.2.0", flags: "-O3", simd: "avx512" }, ...members,
  };
}
