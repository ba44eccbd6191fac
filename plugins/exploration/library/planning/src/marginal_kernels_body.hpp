// SPDX-License-Identifier: BSD-3-Clause
//
// The kernel of marginal_kernels.hpp, compiled once for each instruction set: the including file
// sets CAIRN_KERNEL_SET (a name) and CAIRN_KERNEL_WIDTH (doubles in a vector register), and is
// compiled with that set's flags. Nothing but raw pointers may stand here (an inline function of
// the standard library, compiled here for a newer machine, could be the copy that the linker keeps
// for all).

#include "marginal_kernels.hpp"

namespace cairn::CAIRN_KERNEL_SET {
namespace {

constexpr int kWidth = CAIRN_KERNEL_WIDTH;
typedef double Vec __attribute__((vector_size(kWidth * sizeof(double))));
typedef double LooseVec __attribute__((vector_size(kWidth * sizeof(double)), aligned(8)));

inline __attribute__((always_inline)) Vec load(const double* p) {
  return *reinterpret_cast<const LooseVec*>(p);
}
inline __attribute__((always_inline)) void store(double* p, Vec value) {
  *reinterpret_cast<LooseVec*>(p) = value;
}

/// Of symmetric matrices by the entries of their lower triangles, column by column.
inline __attribute__((always_inline)) Vec determinant(const Vec* D) {
  return D[0] * (D[3] * D[5] - D[4] * D[4]) - D[1] * (D[1] * D[5] - D[4] * D[2]) +
         D[2] * (D[1] * D[4] - D[3] * D[2]);
}

/// Poses that several closures update while what they read of those before is in the caches. Read
/// pose by pose, the entries of the closures before would be more streams than are prefetched.
constexpr long kPosesAtOnce = 64;

/// `count` poses from `begin` on, a multiple of the width.
inline __attribute__((always_inline)) void update_poses(const MarginalUpdate& u, long begin,
                                                        long count) {
  const long padded = u.padded;
  alignas(64) double sums[9 * kPosesAtOnce];  // cov(y, ε_i) − Σ_b L_b Z_b,i
  for (int e = 0; e < 9; ++e) {
    const double *newest = u.newest + e * padded + begin, *other = u.other + e * padded + begin;
    for (long i = 0; i < count; i += kWidth)
      store(sums + e * kPosesAtOnce + i, load(newest + i) - load(other + i));
  }
  for (int b = 0; b < u.closures; ++b) {
    const double* L = u.coupling + 9 * b;
    for (int r = 0; r < 3; ++r) {  // a coordinate of ε_i
      const double* before = u.Z_before[b] + 3 * r * padded + begin;
      double* y = sums + r * kPosesAtOnce;
      for (long i = 0; i < count; i += kWidth) {
        const Vec z0 = load(before + i), z1 = load(before + padded + i),
                  z2 = load(before + 2 * padded + i);
        for (int c = 0; c < 3; ++c) {
          double* sum = y + 3 * c * kPosesAtOnce + i;
          store(sum, load(sum) - (L[c] * z0 + L[3 + c] * z1 + L[6 + c] * z2));
        }
      }
    }
  }
  const double* inverse = u.inverse;
  for (long k = 0; k < count; k += kWidth) {
    const long i = begin + k;
    Vec Z[9];
    for (int r = 0; r < 3; ++r) {
      const double* y = sums + r * kPosesAtOnce + k;
      const Vec y0 = load(y), y1 = load(y + 3 * kPosesAtOnce), y2 = load(y + 6 * kPosesAtOnce);
      Z[3 * r] = inverse[0] * y0;
      Z[3 * r + 1] = inverse[1] * y0 + inverse[4] * y1;
      Z[3 * r + 2] = inverse[2] * y0 + inverse[5] * y1 + inverse[8] * y2;
      for (int c = 0; c < 3; ++c) store(u.Z + (3 * r + c) * padded + i, Z[3 * r + c]);
    }
    Vec D[6];
    int entry = 0;
    for (int c = 0; c < 3; ++c) {
      for (int r = c; r < 3; ++r, ++entry) {
        D[entry] = load(u.diagonal + entry * padded + i) - Z[3 * r] * Z[3 * c] -
                   Z[3 * r + 1] * Z[3 * c + 1] - Z[3 * r + 2] * Z[3 * c + 2];
        store(u.updated + entry * padded + i, D[entry]);
      }
    }
    if (u.ratios) store(u.ratios + i, determinant(D) * load(u.determinants + i));
  }
}

/// As many partners as a register has numbers, from `p` on.
inline __attribute__((always_inline)) void update_some_partners(const PartnerUpdate& u, long p) {
  const long stride = u.stride;
  const double *inverse = u.inverse, *end = u.end;
  Vec y[9];
  for (int e = 0; e < 9; ++e) y[e] = load(u.innovation + e * stride + p);
  const double* before = u.D_before + p;
  const double* L = u.coupling;
  for (int b = 0; b < u.closures; ++b, before += 9 * stride, L += 9) {
    for (int m = 0; m < 3; ++m) {
      const Vec d0 = load(before + m * stride), d1 = load(before + (3 + m) * stride),
                d2 = load(before + (6 + m) * stride);
      for (int r = 0; r < 3; ++r) {
        y[r] -= L[3 * m + r] * d0;
        y[3 + r] -= L[3 * m + r] * d1;
        y[6 + r] -= L[3 * m + r] * d2;
      }
    }
  }
  Vec D[9];
  for (int c = 0; c < 9; c += 3) {
    D[c] = inverse[0] * y[c];
    D[c + 1] = inverse[1] * y[c] + inverse[4] * y[c + 1];
    D[c + 2] = inverse[2] * y[c] + inverse[5] * y[c + 1] + inverse[8] * y[c + 2];
  }
  for (int e = 0; e < 9; ++e) store(u.D + e * stride + p, D[e]);
  int entry = 0;
  for (int c = 0; c < 3; ++c) {
    for (int r = c; r < 3; ++r, ++entry) {
      double* S = u.S + entry * stride + p;
      store(S, load(S) - D[3 * r] * D[3 * c] - D[3 * r + 1] * D[3 * c + 1] -
                   D[3 * r + 2] * D[3 * c + 2]);
    }
    for (int r = 0; r < 3; ++r) {
      double* K = u.K + (3 * c + r) * stride + p;
      store(K, load(K) - end[3 * r] * D[3 * c] - end[3 * r + 1] * D[3 * c + 1] -
                   end[3 * r + 2] * D[3 * c + 2]);
    }
  }
}

/// y −= L Z, of 3×3 matrices by columns.
inline __attribute__((always_inline)) void subtract_product(const double* L, const double* Z,
                                                            long stride, Vec* y) {
  for (int c = 0; c < 9; c += 3) {
    const Vec z0 = load(Z + c * stride), z1 = load(Z + (c + 1) * stride),
              z2 = load(Z + (c + 2) * stride);
    for (int r = 0; r < 3; ++r) y[c + r] -= L[r] * z0 + L[3 + r] * z1 + L[6 + r] * z2;
  }
}

/// L⁻¹ y
inline __attribute__((always_inline)) void whiten(const double* inverse, const Vec* y, Vec* Z) {
  for (int c = 0; c < 9; c += 3) {
    Z[c] = inverse[0] * y[c];
    Z[c + 1] = inverse[1] * y[c] + inverse[4] * y[c + 1];
    Z[c + 2] = inverse[2] * y[c] + inverse[5] * y[c + 1] + inverse[8] * y[c + 2];
  }
}

/// As many stretches of a block as a register has numbers, from `lane` on. `behind`: Σ_b L_b Z_b
/// of the closures before the block.
inline __attribute__((always_inline)) void update_some_stretches(const StretchUpdate& u, long block,
                                                                 long lane, const double* behind) {
  constexpr long kStride = StretchUpdate::kStretches;
  Vec y[9], one[9];
  for (int e = 0; e < 9; ++e) {
    y[e] = load(u.innovation + (9 * block + e) * kStride + lane) - behind[e];
    one[e] = Vec{} + (e % 4 == 0 ? 1.0 : 0.0);
  }
  const long at = 18 * block * kStride + lane;
  for (long b = block * kStride; b < u.closures; ++b) {
    const double* L = u.coupling + 9 * b;
    subtract_product(L, u.Z_before[b] + at, kStride, y);
    subtract_product(L, u.Z_before[b] + at + 9 * kStride, kStride, one);
  }
  Vec Z[9], Z_one[9];
  whiten(u.inverse, y, Z);
  whiten(u.inverse, one, Z_one);
  for (int e = 0; e < 9; ++e) {
    store(u.Z + at + e * kStride, Z[e]);
    store(u.Z + at + (9 + e) * kStride, Z_one[e]);
  }
  double* marginal = u.marginals + 21 * block * kStride + lane;
  int entry = 0;
  for (int c = 0; c < 9; c += 3) {
    for (int r = c; r < 9; r += 3, ++entry) {
      double *posterior = marginal + entry * kStride, *T = marginal + (15 + entry) * kStride;
      store(posterior, load(posterior) - Z[r] * Z[c] - Z[r + 1] * Z[c + 1] - Z[r + 2] * Z[c + 2]);
      store(T, load(T) + Z_one[r] * Z_one[c] + Z_one[r + 1] * Z_one[c + 1] +
                   Z_one[r + 2] * Z_one[c + 2]);
    }
    for (int r = 0; r < 9; r += 3) {
      double* Q = marginal + (6 + c + r / 3) * kStride;
      store(Q, load(Q) + Z_one[r] * Z[c] + Z_one[r + 1] * Z[c + 1] + Z_one[r + 2] * Z[c + 2]);
    }
  }
}

}  // namespace

void update_marginals(const MarginalUpdate* updates, int count);
void update_marginals(const MarginalUpdate* updates, int count) {
  const long padded = count > 0 ? updates->padded : 0;
  for (long begin = 0; begin < padded; begin += kPosesAtOnce) {
    const long left = padded - begin;
    for (int k = 0; k < count; ++k)
      update_poses(updates[k], begin, left < kPosesAtOnce ? left : kPosesAtOnce);
  }
}

void update_partners(const PartnerUpdate& u);
void update_partners(const PartnerUpdate& u) {
  for (long p = 0; p < u.count; p += kWidth) update_some_partners(u, p);
}

void update_stretches(const StretchUpdate& u);
void update_stretches(const StretchUpdate& u) {
  constexpr long kStretches = StretchUpdate::kStretches;
  double behind[9] = {};
  for (long block = 0; block * kStretches <= u.closures; ++block) {
    for (long lane = 0; lane < kStretches; lane += kWidth)
      update_some_stretches(u, block, lane, behind);
    for (long b = block * kStretches; b < (block + 1) * kStretches && b < u.closures; ++b) {
      const double *L = u.coupling + 9 * b, *end = u.ends + 9 * b;
      for (int c = 0; c < 9; c += 3) {
        for (int r = 0; r < 3; ++r)
          behind[c + r] += L[r] * end[c] + L[3 + r] * end[c + 1] + L[6 + r] * end[c + 2];
      }
    }
  }
}

}  // namespace cairn::CAIRN_KERNEL_SET
