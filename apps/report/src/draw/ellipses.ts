// SPDX-License-Identifier: BSD-3-Clause
// Ellipses and ellipsoids of equal probability.

/** Mahalanobis radius that holds `probability` of a normal distribution in 2 or 3 dimensions. */
export function confidenceRadius(probability: number, dimension: 2 | 3): number {
  if (dimension === 2) return Math.sqrt(-2 * Math.log(1 - probability));
  // Of chi with 3 degrees of freedom, by bisection: P(r) = erf(r/√2) − √(2/π) r exp(−r²/2).
  let low = 0, high = 20;
  for (let k = 0; k < 60; ++k) {
    const r = 0.5 * (low + high);
    const p = errorFunction(r / Math.SQRT2) - Math.sqrt(2 / Math.PI) * r * Math.exp((-r * r) / 2);
    if (p < probability) low = r;
    else high = r;
  }
  return 0.5 * (low + high);
}

/** Abramowitz and Stegun 7.1.26, to 1.5e-7. */
function errorFunction(x: number): number {
  const t = 1 / (1 + 0.3275911 * x);
  const poly = t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))));
  return 1 - poly * Math.exp(-x * x);
}

/**
 * A matrix A with A Aᵀ = Sigma (rows xx xy xz yy yz zz) from its eigenvectors, columns by falling standard deviation:
 * the half axes. Zero where Sigma is not there or not positive semidefinite.
 */
export function halfAxes(upper: ArrayLike<number>, offset = 0): number[][] | null {
  const [xx, xy, xz, yy, yz, zz] = [0, 1, 2, 3, 4, 5].map((k) => Number(upper[offset + k]));
  if (!Number.isFinite(xx + xy + xz + yy + yz + zz)) return null;
  const a = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
  const v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  // Jacobi's method: a few sweeps reach machine precision for 3 × 3.
  for (let sweep = 0; sweep < 12; ++sweep) {
    for (const [p, q] of [[0, 1], [0, 2], [1, 2]]) {
      if (Math.abs(a[p][q]) < 1e-300) continue;
      const theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
      const t = Math.sign(theta || 1) / (Math.abs(theta) + Math.hypot(theta, 1));
      const c = 1 / Math.hypot(t, 1), s = t * c;
      for (let k = 0; k < 3; ++k) {
        const kp = a[k][p], kq = a[k][q];
        a[k][p] = c * kp - s * kq;
        a[k][q] = s * kp + c * kq;
      }
      for (let k = 0; k < 3; ++k) {
        const pk = a[p][k], qk = a[q][k];
        a[p][k] = c * pk - s * qk;
        a[q][k] = s * pk + c * qk;
        const vp = v[k][p], vq = v[k][q];
        v[k][p] = c * vp - s * vq;
        v[k][q] = s * vp + c * vq;
      }
    }
  }
  const eigenvalues = [a[0][0], a[1][1], a[2][2]];
  const largest = Math.max(...eigenvalues.map(Math.abs));
  if (eigenvalues.some((lambda) => lambda < -1e-6 * largest)) return null;
  return [0, 1, 2]
    .sort((i, j) => eigenvalues[j] - eigenvalues[i])
    .map((k) => [0, 1, 2].map((d) => v[d][k] * Math.sqrt(Math.max(0, eigenvalues[k]))));
}

/** Line segments (pairs of points x y z) of the ellipse, or of the three principal ellipses of the ellipsoid. */
export function ellipseSegments(
  centre: ArrayLike<number>, upper: ArrayLike<number>, offset: number, dimension: 2 | 3, radius: number, corners: number,
): number[] {
  const axes = halfAxes(upper, offset);
  if (!axes) return [];
  const planes = dimension === 2 ? [[0, 1]] : [[0, 1], [0, 2], [1, 2]];
  const points: number[] = [];
  for (const [p, q] of planes) {
    for (let k = 0; k < corners; ++k) {
      for (const step of [k, k + 1]) {
        const angle = (2 * Math.PI * step) / corners;
        const c = radius * Math.cos(angle), s = radius * Math.sin(angle);
        for (let d = 0; d < 3; ++d) points.push(centre[d] + c * axes[p][d] + s * axes[q][d]);
      }
    }
  }
  return points;
}
