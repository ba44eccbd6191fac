// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>
#include <vector>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// The mean of a sample, and the interval in which the mean of the population lies with a given
/// confidence if the values are normally distributed (Student's t). NaN stands for what the sample
/// is too small for.
struct MeanInterval {
  int count = 0;           ///< values that are finite: the others are left out
  double mean = 0.0;       ///< NaN without a value
  double deviation = 0.0;  ///< standard deviation of the sample, over count − 1
  /// Of the interval: t deviation / √count, t the quantile of count − 1 degrees of freedom.
  double half_width = 0.0;

  double low() const { return mean - half_width; }
  double high() const { return mean + half_width; }
  /// Whether the interval is clear of zero; false where there is none.
  bool excludes_zero() const { return low() > 0.0 || high() < 0.0; }
};

/// The quantile of Student's t distribution: what a variable with so many degrees of freedom does
/// not exceed with probability `p`. Precondition: 0 < p < 1, dof > 0.
CAIRN_API double student_t_quantile(double p, double dof);

/// `confidence` is between 0 and 1.
CAIRN_API MeanInterval mean_interval(std::span<const double> values, double confidence = 0.95);

/// Of the differences `values[k] − reference[k]`, such as those of two methods that met the same
/// noise in run k: what both have in common cancels, so that few runs say more than two means do.
/// Pairs of which one is not finite are left out. Precondition: as many of each.
CAIRN_API MeanInterval paired_difference(std::span<const double> values,
                                         std::span<const double> reference,
                                         double confidence = 0.95);

/// With as many digits as the interval is worth: "741 ± 12", "0.043 ± 0.008", the mean alone where
/// there is no interval, "-" where there is no mean. `sign`: the mean has one, "+0.5 ± 1.2".
CAIRN_API std::string interval_text(const MeanInterval& interval, bool sign = false);

/// A quantity of one run against another that grows, such as the distance driven.
struct RunCurve {
  std::vector<double> x, y;  ///< as many of each
};

/// What a curve is beyond its last point: the run is over, and its result stays; or it is unknown.
enum class BeyondEnd { keep, unknown };

/// A curve at some places, by linear interpolation; NaN before its first point. Where `x` falls the
/// points are left out until it exceeds its largest value again; of points with one `x` the last
/// counts.
CAIRN_API std::vector<double> values_at(const RunCurve& curve, std::span<const double> places,
                                        BeyondEnd beyond);

/// The means of several curves at these places.
CAIRN_API std::vector<MeanInterval> mean_curve(std::span<const RunCurve> curves,
                                               std::span<const double> places, BeyondEnd beyond,
                                               double confidence = 0.95);

}  // namespace cairn
