// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

namespace cairn::performance {

/// The middle value, or the mean of the two in the middle; NaN of nothing.
double median(std::vector<double> values);

/// The smallest value that a part of them does not exceed; NaN of nothing.
double percentile(std::vector<double> values, double part);

/// exp of the mean logarithm: what ratios are averaged by, so that a/b and b/a agree. NaN of
/// nothing.
double geometric_mean(std::span<const double> ratios);

/// The exponent p of the law y = c xᵖ that fits best: linear least squares on the logarithms. NaN
/// with fewer than two points.
double fitted_exponent(std::span<const double> x, std::span<const double> y);

}  // namespace cairn::performance
