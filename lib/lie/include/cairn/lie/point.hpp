// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

#include "cairn/types/define_variable.hpp"

namespace cairn {

/// A point of N coordinates [m]; its group is addition.
template <int N>
struct Point {
  static constexpr int kAmbient = N, kTangent = N;
  static constexpr int kDimension = N;
  static constexpr bool kOriented = false;

  static Vector<double, N> identity() { return Vector<double, N>::Zero(); }
  template <class S>
  static Vector<S, N> retract(const Vector<S, N>& x, const Vector<S, N>& delta) {
    return x + delta;
  }
  template <class S>
  static Vector<S, N> local(const Vector<S, N>& x, const Vector<S, N>& y) {
    return y - x;
  }

  template <class S>
  static Vector<S, N> compose(const Vector<S, N>& a, const Vector<S, N>& b) {
    return a + b;
  }
  template <class S>
  static Vector<S, N> inverse(const Vector<S, N>& a) {
    return -a;
  }
  static Eigen::Matrix<double, N, N> adjoint(const Vector<double, N>&) {
    return Eigen::Matrix<double, N, N>::Identity();
  }
  template <class S>
  static Vector<S, N> exp(const Vector<S, N>& delta) {
    return delta;
  }
  template <class S>
  static Vector<S, N> log(const Vector<S, N>& a) {
    return a;
  }

  static std::string normalize(Vector<double, N>& x) {
    return x.allFinite() ? std::string() : "a coordinate is not finite";
  }
  static Vector<double, N> position(const Vector<double, N>& x) { return x; }
  static Vector<double, N> from_placement(const Eigen::Matrix<double, N, N>&,
                                          const Vector<double, N>& t) {
    return t;
  }
};

/// A landmark in the plane: x y [m].
struct PointXY : Point<2> {
  static constexpr std::string_view kTag = "VERTEX_XY";
};

/// A landmark in space: x y z [m].
struct PointXYZ : Point<3> {
  static constexpr std::string_view kTag = "VERTEX_TRACKXYZ";
};

}  // namespace cairn
