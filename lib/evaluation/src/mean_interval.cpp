// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/mean_interval.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <limits>

#include <fmt/core.h>
#include <boost/math/distributions/students_t.hpp>

namespace cairn {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// The points of a curve whose x is larger than all before.
RunCurve rising(const RunCurve& curve) {
  RunCurve points;
  for (std::size_t k = 0; k < curve.x.size(); ++k) {
    if (!std::isfinite(curve.x[k]) || !std::isfinite(curve.y[k])) continue;
    if (points.x.empty() || curve.x[k] > points.x.back()) {
      points.x.push_back(curve.x[k]);
      points.y.push_back(curve.y[k]);
    } else if (curve.x[k] == points.x.back()) {
      points.y.back() = curve.y[k];
    }
  }
  return points;
}

double value_at(const RunCurve& points, double place, BeyondEnd beyond) {
  if (points.x.empty() || place < points.x.front()) return kNone;
  if (place >= points.x.back())
    return beyond == BeyondEnd::keep || place == points.x.back() ? points.y.back() : kNone;
  const auto after = std::ranges::upper_bound(points.x, place);
  const auto k = static_cast<std::size_t>(after - points.x.begin());
  const double part = (place - points.x[k - 1]) / (points.x[k] - points.x[k - 1]);
  return points.y[k - 1] + part * (points.y[k] - points.y[k - 1]);
}

}  // namespace

double student_t_quantile(double p, double dof) {
  return boost::math::quantile(boost::math::students_t(dof), p);
}

MeanInterval mean_interval(std::span<const double> values, double confidence) {
  MeanInterval result{.mean = kNone, .deviation = kNone, .half_width = kNone};
  double sum = 0.0;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    ++result.count;
    sum += value;
  }
  if (result.count == 0) return result;
  result.mean = sum / result.count;
  if (result.count == 1) return result;
  double squares = 0.0;
  for (const double value : values)
    if (std::isfinite(value)) squares += (value - result.mean) * (value - result.mean);
  result.deviation = std::sqrt(squares / (result.count - 1));
  result.half_width = student_t_quantile(0.5 * (1.0 + confidence), result.count - 1) *
                      result.deviation / std::sqrt(result.count);
  return result;
}

MeanInterval paired_difference(std::span<const double> values, std::span<const double> reference,
                               double confidence) {
  assert(values.size() == reference.size());
  std::vector<double> differences(values.size());
  for (std::size_t k = 0; k < values.size(); ++k) differences[k] = values[k] - reference[k];
  return mean_interval(differences, confidence);
}

std::string interval_text(const MeanInterval& interval, bool sign) {
  if (interval.count == 0) return "-";
  const bool known = std::isfinite(interval.half_width);
  const double scale =
      known && interval.half_width > 0.0 ? interval.half_width : 0.01 * std::abs(interval.mean);
  constexpr int kMostDigits = 4;
  const int digits =
      scale > 0.0 ? std::clamp(1 - static_cast<int>(std::floor(std::log10(scale))), 0, kMostDigits)
                  : 0;
  std::string text = sign ? fmt::format("{:+.{}f}", interval.mean, digits)
                          : fmt::format("{:.{}f}", interval.mean, digits);
  if (known) text += fmt::format(" ± {:.{}f}", interval.half_width, digits);
  return text;
}

std::vector<double> values_at(const RunCurve& curve, std::span<const double> places,
                              BeyondEnd beyond) {
  const RunCurve points = rising(curve);
  std::vector<double> values;
  for (const double place : places) values.push_back(value_at(points, place, beyond));
  return values;
}

std::vector<MeanInterval> mean_curve(std::span<const RunCurve> curves,
                                     std::span<const double> places, BeyondEnd beyond,
                                     double confidence) {
  std::vector<std::vector<double>> values;
  for (const RunCurve& curve : curves) values.push_back(values_at(curve, places, beyond));
  std::vector<MeanInterval> means;
  std::vector<double> here(curves.size());
  for (std::size_t k = 0; k < places.size(); ++k) {
    std::ranges::transform(values, here.begin(), [k](const auto& of_run) { return of_run[k]; });
    means.push_back(mean_interval(here, confidence));
  }
  return means;
}

}  // namespace cairn
