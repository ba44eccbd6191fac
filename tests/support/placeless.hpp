// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/types/define_variable.hpp"

namespace cairn::test {

/// N numbers that are nowhere, as a velocity or a bias of a sensor; a struct that derives from it
/// has a `kTag`.
template <int N>
struct Placeless {
  static constexpr int kAmbient = N, kTangent = N;
  static Vector<double, N> identity() { return Vector<double, N>::Zero(); }
  template <class S>
  static Vector<S, N> retract(const Vector<S, N>& x, const Vector<S, N>& delta) {
    return x + delta;
  }
  template <class S>
  static Vector<S, N> local(const Vector<S, N>& x, const Vector<S, N>& y) {
    return y - x;
  }
};

}  // namespace cairn::test
