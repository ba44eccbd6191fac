// SPDX-License-Identifier: BSD-3-Clause
#include "rank_correlation.hpp"

#include <cmath>
#include <cstddef>

#include "cairn/runtime/error.hpp"

namespace cairn {

double kendall_tau(std::span<const double> a, std::span<const double> b) {
  if (a.size() != b.size())
    throw Error(ErrorCode::usage, "kendall_tau: two orders of different numbers of things");
  const auto order = [](double x, double y) { return (x < y) - (y < x); };
  double same = 0.0, untied_a = 0.0, untied_b = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const int in_a = order(a[i], a[j]), in_b = order(b[i], b[j]);
      same += in_a * in_b;
      untied_a += in_a * in_a;
      untied_b += in_b * in_b;
    }
  }
  return same / std::sqrt(untied_a * untied_b);
}

}  // namespace cairn
