// SPDX-License-Identifier: BSD-3-Clause
//
// The kernel of potential_kernels.hpp, compiled once for each instruction set: the including file
// sets CAIRN_KERNEL_SET (a name) and CAIRN_KERNEL_WIDTH (doubles in a vector register), and is
// compiled with that set's flags. No inline function of the standard library may be called here:
// compiled for a newer machine, it could be the copy that the linker keeps for all.

#include "potential_kernels.hpp"

#if defined(__AVX2__)
#include <immintrin.h>
#endif

namespace cairn::CAIRN_KERNEL_SET {
namespace {

constexpr std::size_t kWidth = CAIRN_KERNEL_WIDTH;
typedef double Vec __attribute__((vector_size(kWidth * sizeof(double))));
typedef double LooseVec __attribute__((vector_size(kWidth * sizeof(double)), aligned(8)));
typedef std::int64_t Mask __attribute__((vector_size(kWidth * sizeof(double))));
typedef std::int64_t LooseMask __attribute__((vector_size(kWidth * sizeof(double)), aligned(8)));

inline __attribute__((always_inline)) Vec load(const double* p) {
  return *reinterpret_cast<const LooseVec*>(p);
}
inline __attribute__((always_inline)) Vec magnitude(Vec v) { return v < 0.0 ? -v : v; }

inline __attribute__((always_inline)) bool any_larger(Vec a, Vec b) {
#if CAIRN_KERNEL_WIDTH == 8
  return _mm512_cmp_pd_mask(a, b, _CMP_GT_OQ) != 0;
#elif CAIRN_KERNEL_WIDTH == 4
  return _mm256_movemask_pd(_mm256_cmp_pd(a, b, _CMP_GT_OQ)) != 0;
#else
  return a[0] > b[0] || a[1] > b[1];
#endif
}

inline __attribute__((always_inline)) Mask first_lanes(std::size_t count) {
  Mask mask{};
  for (std::size_t k = 0; k < kWidth; ++k) mask[k] = k < count ? -1 : 0;
  return mask;
}

}  // namespace

void relax_row(const PotentialRows& rows, std::size_t cell, std::size_t parity, double* largest) {
  const std::size_t row = 2 * cell + parity, stride = rows.stride, half = rows.half;
  double* const here = rows.values + row * stride;
  // In the other row, before[j] and before[j + 1] are the orientations before and after.
  const double* const before = parity == 0 ? here + stride - 1 : here - stride;
  const double* beside[4];
  int missing = 0;
  for (int k = 0; k < 4; ++k) {
    const std::int32_t other = rows.neighbours[4 * cell + static_cast<std::size_t>(k)];
    if (other < 0) ++missing;
    beside[k] = other < 0 ? rows.nothing
                          : rows.values + (2 * static_cast<std::size_t>(other) + parity) * stride;
  }
  const Vec keeps = rows.keeps - Vec{}, factor = rows.factor[missing] - Vec{},
            least = rows.least - Vec{};
  const std::int32_t limited = rows.free_row[row];
  const std::int64_t* const free =
      limited < 0 ? nullptr : rows.free + static_cast<std::size_t>(limited) * stride;
  double most = largest ? *largest : 0.0;
  for (std::size_t j = 0; j < half; j += kWidth) {
    const Vec old = load(here + j);
    const Vec sum = load(before + j) + load(before + j + 1) + load(beside[0] + j) +
                    load(beside[1] + j) + load(beside[2] + j) + load(beside[3] + j);
    Vec value = keeps * old + factor * sum;
    if (free) value = *reinterpret_cast<const LooseMask*>(free + j) ? value : old;
    if (half - j < kWidth) value = first_lanes(half - j) ? value : old;
    if (largest) {
      const Vec change = magnitude(value - old), own = magnitude(value);
      const Vec scale = own > least ? own : least;
      if (any_larger(change, most * scale)) {  // only then is there something to divide
        for (std::size_t k = 0; k < kWidth; ++k)
          if (change[k] > most * scale[k]) most = change[k] / scale[k];
      }
    }
    *reinterpret_cast<LooseVec*>(here + j) = value;
  }
  if (parity == 0)
    here[half] = here[0];
  else
    *(here - 1) = here[half - 1];
  if (largest) *largest = most;
}

}  // namespace cairn::CAIRN_KERNEL_SET
