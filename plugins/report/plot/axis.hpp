// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace cairn::plot {

/// An interval of numbers on an axis.
struct Range {
  double low = 0, high = 1;
  bool logarithmic = false;
  bool whole = false;  ///< only integers have a meaning, such as those of iterations

  /// 0 at low, 1 at high.
  double part(double value) const;
  /// Places for grid lines within the range, about `count` of them: 1, 2 or 5 times a power of ten.
  std::vector<double> ticks(int count) const;
};

/// A range that holds all values that can be shown (finite; positive if logarithmic), with a little
/// room round them.
Range range_of(const std::vector<double>& values, bool logarithmic);

/// "1200", "0.05", "1e-7"
std::string tick_text(double value);

}  // namespace cairn::plot
