// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "cairn/plugin/options.hpp"
#include "proximity.hpp"

namespace cairn::compact {

/// Of some covariances the one that a part of them, by determinant, does not exceed: ½ for the
/// median. Throws `std::logic_error` if there is none.
Matrix covariance_by_size(std::span<const Matrix> covariances, double part);

/// Σ̄_y, what a match can be worth by the latest ones: the lower quartile of their covariances. What
/// is learnt decides which matches are asked for, so that it must not end by itself: poor matches
/// would keep from being seen the better ones that others would give.
class TypicalMatch {
 public:
  void note(const Matrix& covariance);
  /// It was a false match. Does nothing if it is not among the latest any more.
  void forget(const Matrix& covariance);
  /// A pose that it alone kept from being matched. After eight of them the poorer half is
  /// forgotten, and the last one too.
  void note_silence();
  bool known() const { return !latest_.empty(); }
  const Matrix& covariance() const { return quartile_; }

 private:
  void update();

  std::vector<Matrix> latest_;  ///< a ring
  std::size_t oldest_ = 0;      ///< once the ring is full
  int silent_ = 0;              ///< poses, since a match was noted
  Matrix quartile_;
};

/// Finds the thresholds of compact pose SLAM from a sample of the data (section 5.2): all
/// measurements are used, and recorded are the displacement of every loop closure before it was
/// closed, its information gain, and that of the link of every new pose.
class ThresholdFinder {
 public:
  void note_loop(const Dimensions& dimensions, double gain, const Matrix& covariance);
  /// It was a false one.
  void forget_loop(double gain, const Matrix& covariance);
  void note_pose(double gain) { pose_gains_.push_back(gain); }

  /// Options of compact_pose: `range` and `angle`, so that every recorded loop closure passes the
  /// test with its `probability` and `noise_scale`, which are among them; `loop_gain` = (l₉₀ +
  /// 1)^1.36 − 1 and `pose_gain` = (p₉₀ + 1)^1.7 − 1 with the 90th percentiles; `sensor`, the
  /// median of the loops' covariances. Throws `Error` (input) if there was no loop closure.
  OptionValues found(const DistanceTest& test) const;
  /// The median of the loops' covariances, by their determinants. Throws as `found`.
  Matrix sensor() const;

 private:
  struct Loop {
    Dimensions dimensions;  // before it was closed
    double gain;
    Matrix covariance;
  };
  std::vector<Loop> loops_;
  std::vector<double> pose_gains_;
};

/// Of some numbers, the smallest that a part of them does not exceed.
double percentile(std::vector<double> numbers, double part);

}  // namespace cairn::compact
