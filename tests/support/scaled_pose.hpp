// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/types/define_variable.hpp"

namespace cairn::test {

/// A pose with a scale: more than a pose, and no group on offer.
struct ScaledPose {
  static constexpr std::string_view kTag = "VERTEX_SCALED";
  static constexpr int kAmbient = 4, kTangent = 4;
  static Vector<double, 4> identity() { return Vector<double, 4>::Zero(); }
  template <class S>
  static Vector<S, 4> retract(const Vector<S, 4>& x, const Vector<S, 4>& delta) {
    return x + delta;
  }
  template <class S>
  static Vector<S, 4> local(const Vector<S, 4>& x, const Vector<S, 4>& y) {
    return y - x;
  }
};

}  // namespace cairn::test
