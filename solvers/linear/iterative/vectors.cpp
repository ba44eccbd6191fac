// SPDX-License-Identifier: BSD-3-Clause
#include "iterative/vectors.hpp"

#include <algorithm>
#include <array>
#include <numeric>
#include <vector>

#include "cairn/runtime/threads.hpp"

namespace cairn::iterative {
namespace {

/// Scalars of one range. Part of the result, since partial sums are taken range by range. Long
/// enough that passing a range to another thread costs little of it.
constexpr std::size_t kRange = 8192;

}  // namespace

double sum_over_ranges(std::size_t size,
                       const std::function<double(std::size_t, std::size_t)>& body) {
  const std::size_t ranges = (size + kRange - 1) / kRange;
  std::array<double, 64> few{};  // most systems need no allocation
  std::vector<double> many(ranges > few.size() ? ranges : 0);
  double* partial = many.empty() ? few.data() : many.data();
  for_each_range(size, kRange, [&](std::size_t begin, std::size_t end) {
    partial[begin / kRange] = body(begin, end);
  });
  return std::accumulate(partial, partial + ranges, 0.0);
}

double dot(std::span<const double> a, std::span<const double> b) {
  return sum_over_ranges(a.size(), [&](std::size_t begin, std::size_t end) {
    double sum = 0.0;
    for (std::size_t k = begin; k < end; ++k) sum += a[k] * b[k];
    return sum;
  });
}

}  // namespace cairn::iterative
