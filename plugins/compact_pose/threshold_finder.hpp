// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "cairn/plugin/options.hpp"
#include "proximity.hpp"

namespace cairn::compact {

/// Of some covariances the median by determinant. Throws `std::logic_error` if there is none.
Matrix median_covariance(std::span<const Matrix> covariances);

/// Σ̄_y as the latest matches have it: the median of their covariances.
class TypicalMatch {
 public:
  void note(const Matrix& covariance);
  /// It was a false match. Does nothing if it is not among the latest any more.
  void forget(const Matrix& covariance);
  bool known() const { return !latest_.empty(); }
  const Matrix& covariance() const { return median_; }

 private:
  std::vector<Matrix> latest_;  ///< a ring
  std::size_t oldest_ = 0;      ///< once the ring is full
  Matrix median_;
};

/// Finds the thresholds of compact pose SLAM from a sample of the data (section 5.2): all
/// measurements are used, and recorded are the displacement of every loop closure before it was
/// closed, its information gain, and that of the link of every new pose.
class ThresholdFinder {
 public:
  void note_loop(const DistanceTest& test, const Dimensions& dimensions, double gain,
                 const Matrix& covariance);
  /// It was a false one.
  void forget_loop(double gain, const Matrix& covariance);
  void note_pose(double gain) { pose_gains_.push_back(gain); }

  /// Options of compact_pose: `range` and `angle`, so that every recorded loop closure passes the
  /// distance test; `loop_gain` = (l₉₀ + 1)^1.36 − 1 and `pose_gain` = (p₉₀ + 1)^1.7 − 1 with the
  /// 90th percentiles; `sensor`, the median of the loops' covariances. Throws `Error` (input) if
  /// there was no loop closure.
  OptionValues found(double probability) const;
  /// The median of the loops' covariances, by their determinants. Throws as `found`.
  Matrix sensor() const;

 private:
  struct Loop {
    double range, angle;  // least ones with which it would have passed [m, rad]
    double gain;
    Matrix covariance;
  };
  std::vector<Loop> loops_;
  std::vector<double> pose_gains_;
};

/// Of some numbers, the smallest that a part of them does not exceed.
double percentile(std::vector<double> numbers, double part);

}  // namespace cairn::compact
