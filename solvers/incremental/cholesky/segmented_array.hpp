// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "cairn/runtime/aligned.hpp"

namespace cairn::incremental {

/// Small arrays of doubles, each at a place that stays the same. Nothing is copied when there is no
/// more room, as in a vector, whose growth takes milliseconds in a large map, which no time limit
/// could divide. Only the first segment grows like one, so that a small graph takes little memory.
class SegmentedArray {
 public:
  /// Room for `doubles` values side by side, all zero. Returns their place.
  std::int64_t take(std::size_t doubles) {
    if (segments_.empty() ||
        segments_[last_].size() + std::max<std::size_t>(doubles, 1) > kSegment) {
      last_ = segments_.size();
      // An array that is longer has the numbers of several segments, of which the first has it all.
      segments_.resize(last_ + std::max<std::size_t>(1, (doubles + kSegment - 1) / kSegment));
      if (last_ > 0) segments_[last_].reserve(std::max(doubles, kSegment));
    }
    AlignedVector& segment = segments_[last_];
    const std::size_t place = last_ * kSegment + segment.size();
    segment.resize(segment.size() + doubles, 0.0);
    taken_ += static_cast<std::int64_t>(doubles);
    return static_cast<std::int64_t>(place);
  }
  /// The array at a place; it moves with the next `take` where all is in the first segment.
  double* at(std::int64_t place) { return const_cast<double*>(std::as_const(*this).at(place)); }
  const double* at(std::int64_t place) const {
    const auto index = static_cast<std::size_t>(place);
    return segments_[index / kSegment].data() + index % kSegment;
  }
  void fill_with_zeros() {
    for (AlignedVector& segment : segments_) std::ranges::fill(segment, 0.0);
  }
  /// Doubles that were taken.
  std::int64_t size() const { return taken_; }

 private:
  static constexpr std::size_t kSegment = 1 << 15;

  std::vector<AlignedVector> segments_;
  std::size_t last_ = 0;
  std::int64_t taken_ = 0;
};

}  // namespace cairn::incremental
