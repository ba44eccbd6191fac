// SPDX-License-Identifier: BSD-3-Clause
#include "threshold_finder.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include <fmt/core.h>

#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/lu.hpp"

namespace cairn::compact {

double percentile(std::vector<double> numbers, double part) {
  if (numbers.empty()) return 0.0;
  const auto rank = static_cast<std::size_t>(std::ceil(part * static_cast<double>(numbers.size())));
  const auto place = numbers.begin() + static_cast<std::ptrdiff_t>(
                                           std::clamp<std::size_t>(rank, 1, numbers.size()) - 1);
  std::nth_element(numbers.begin(), place, numbers.end());
  return *place;
}

void ThresholdFinder::note_loop(const DistanceTest& test, const Dimensions& dimensions, double gain,
                                const Matrix& covariance) {
  const SensorRange least = test.least_range(dimensions);
  loops_.push_back(
      {*std::ranges::max_element(least.translation), least.rotation, gain, covariance});
}

Matrix ThresholdFinder::sensor() const {
  if (loops_.empty()) {
    throw Error(ErrorCode::input,
                "no loop closure in the sample, so the sensor's range is unknown: take a larger "
                "part of the data, or give the thresholds");
  }
  std::vector<std::pair<double, const Matrix*>> by_size;
  for (const Loop& loop : loops_)
    by_size.emplace_back(Eigen::MatrixXd(loop.covariance).determinant(), &loop.covariance);
  const auto middle = by_size.begin() + std::ssize(by_size) / 2;
  std::ranges::nth_element(by_size, middle, {}, &std::pair<double, const Matrix*>::first);
  return *middle->second;
}

OptionValues ThresholdFinder::found(double probability) const {
  const Matrix sensor = this->sensor();
  double range = 0.0, angle = 0.0;
  std::vector<double> gains;
  for (const Loop& loop : loops_) {
    range = std::max(range, loop.range);
    angle = std::max(angle, loop.angle);
    gains.push_back(loop.gain);
  }
  std::string numbers;
  for (const double number : pack(sensor))
    numbers += fmt::format("{}{:.6g}", numbers.empty() ? "" : " ", number);
  // Rounded up, so that the farthest loop closure still passes.
  const double up = 1.0 + 1e-6;
  return {
      {"range", fmt::format("{:.9g}", range * up)},
      {"angle", fmt::format("{:.9g}", std::min(angle * up, 3.15))},
      {"probability", fmt::format("{:.9g}", probability)},
      {"loop_gain", fmt::format("{:.9g}", std::pow(percentile(gains, 0.9) + 1.0, 1.36) - 1.0)},
      {"pose_gain", fmt::format("{:.9g}", std::pow(percentile(pose_gains_, 0.9) + 1.0, 1.7) - 1.0)},
      {"sensor", numbers}};
}

}  // namespace cairn::compact
