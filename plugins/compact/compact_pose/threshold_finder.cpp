// SPDX-License-Identifier: BSD-3-Clause
#include "threshold_finder.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include <fmt/core.h>

#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/lu.hpp"

namespace cairn::compact {
namespace {

/// So many of the latest matches tell what the next is worth.
constexpr std::size_t kLatest = 31;
/// Of them this part is better.
constexpr double kBetter = 0.25;
/// So many poses that were not matched for what is expected of a match call it into question.
constexpr int kSilence = 8;
/// Logarithms of determinants that differ by less are the same.
constexpr double kSameSize = 0.01;

/// The sizes of covariances with their positions. Seen from its other end a motion has another
/// covariance with the same determinant: rounding must not decide between the two.
std::vector<std::pair<double, std::size_t>> sizes(std::span<const Matrix> covariances) {
  std::vector<std::pair<double, std::size_t>> by_size;
  for (const Matrix& S : covariances) {
    const double size = std::log(Eigen::MatrixXd(S).determinant());
    by_size.emplace_back(std::round(size / kSameSize), by_size.size());
  }
  return by_size;
}

}  // namespace

Matrix covariance_by_size(std::span<const Matrix> covariances, double part) {
  if (covariances.empty()) throw std::logic_error("a quantile of no covariance");
  auto by_size = sizes(covariances);
  const auto place =
      by_size.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(by_size.size()));
  std::ranges::nth_element(by_size, place);
  return covariances[place->second];
}

void TypicalMatch::note(const Matrix& covariance) {
  if (latest_.size() < kLatest) {
    latest_.push_back(covariance);
  } else {
    latest_[oldest_] = covariance;
    oldest_ = (oldest_ + 1) % kLatest;
  }
  silent_ = 0;
  update();
}

void TypicalMatch::update() {
  quartile_ = latest_.empty() ? Matrix() : covariance_by_size(latest_, kBetter);
}

void TypicalMatch::note_silence() {
  if (latest_.empty() || ++silent_ < kSilence) return;
  silent_ = 0;
  auto by_size = sizes(latest_);
  std::ranges::sort(by_size);
  by_size.resize(by_size.size() / 2);
  std::vector<Matrix> better;
  for (const auto& [size, place] : by_size) better.push_back(latest_[place]);
  latest_ = std::move(better);
  oldest_ = 0;
  update();
}

void TypicalMatch::forget(const Matrix& covariance) {
  std::rotate(latest_.begin(), latest_.begin() + static_cast<std::ptrdiff_t>(oldest_),
              latest_.end());
  oldest_ = 0;  // the ring has room again, or begins there
  const auto found = std::ranges::find(latest_, covariance);
  if (found == latest_.end()) return;
  latest_.erase(found);
  update();
}

double percentile(std::vector<double> numbers, double part) {
  if (numbers.empty()) return 0.0;
  const auto rank = static_cast<std::size_t>(std::ceil(part * static_cast<double>(numbers.size())));
  const auto place = numbers.begin() + static_cast<std::ptrdiff_t>(
                                           std::clamp<std::size_t>(rank, 1, numbers.size()) - 1);
  std::nth_element(numbers.begin(), place, numbers.end());
  return *place;
}

void ThresholdFinder::note_loop(const Dimensions& dimensions, double gain,
                                const Matrix& covariance) {
  loops_.push_back({dimensions, gain, covariance});
}

void ThresholdFinder::forget_loop(double gain, const Matrix& covariance) {
  const auto found = std::ranges::find_if(
      loops_, [&](const Loop& loop) { return loop.gain == gain && loop.covariance == covariance; });
  if (found != loops_.end()) loops_.erase(found);
}

Matrix ThresholdFinder::sensor() const {
  if (loops_.empty()) {
    throw Error(
        ErrorCode::input,
        "no loop closure in the sample was taken (a policy's gate may have refused some), so "
        "the sensor's range is unknown: take a larger part of the data, a larger gate, or "
        "give the thresholds");
  }
  std::vector<Matrix> covariances;
  for (const Loop& loop : loops_) covariances.push_back(loop.covariance);
  return covariance_by_size(covariances, 0.5);
}

OptionValues ThresholdFinder::found(const DistanceTest& test) const {
  const Matrix sensor = this->sensor();
  double range = 0.0, angle = 0.0;
  std::vector<double> gains;
  for (const Loop& loop : loops_) {
    const SensorRange least = test.least_range(loop.dimensions);
    range = std::max(range, *std::ranges::max_element(least.translation));
    angle = std::max(angle, least.rotation);
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
      {"probability", fmt::format("{:.9g}", test.range().probability)},
      {"noise_scale", fmt::format("{:.9g}", test.range().noise_scale)},
      {"loop_gain", fmt::format("{:.9g}", std::pow(percentile(gains, 0.9) + 1.0, 1.36) - 1.0)},
      {"pose_gain", fmt::format("{:.9g}", std::pow(percentile(pose_gains_, 0.9) + 1.0, 1.7) - 1.0)},
      {"sensor", numbers}};
}

}  // namespace cairn::compact
