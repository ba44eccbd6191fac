// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace cairn::incremental {

/// A clock that moves on by a second whenever it is read, which is once for each piece of work: a
/// limit of n seconds is one of n pieces.
struct CountingClock {
  double reads = 0.0;
  /// Of an engine, or of the estimator around one.
  template <class Limited>
  void drive(Limited& limited) {
    limited.set_clock([this] { return reads += 1.0; });
  }
};

}  // namespace cairn::incremental
