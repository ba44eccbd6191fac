// SPDX-License-Identifier: BSD-3-Clause
// Structs whose optional functions are there, but not as they are called.
#pragma once

#include <string>
#include <string_view>
#include <tuple>

#include <Eigen/Core>

#include "cairn/types/define_factor.hpp"

namespace cairn::test::misfits {

struct Place {
  static constexpr std::string_view kTag = "VERTEX_PLACE";
  static constexpr int kAmbient = 2, kTangent = 2;
  static Vector<double, 2> identity() { return Vector<double, 2>::Zero(); }
  template <class S>
  static Vector<S, 2> retract(const Vector<S, 2>& x, const Vector<S, 2>& delta) {
    return x + delta;
  }
  template <class S>
  static Vector<S, 2> local(const Vector<S, 2>& x, const Vector<S, 2>& y) {
    return y - x;
  }
};

struct Known {
  static constexpr std::string_view kTag = "EDGE_KNOWN_PLACE";
  static constexpr int kResidual = 2, kMeasurement = 2;
  using Variables = std::tuple<Place>;
  template <class S>
  static Vector<S, 2> residual(const Vector<S, 2>& x, const Measured<S, 2>& z) {
    return x - z;
  }
};

struct Analytic : Known {
  template <class S>
  static Vector<S, 2> evaluate(const Vector<S, 2>& x, const Vector<S, 2>& z,
                               Eigen::Matrix<S, 2, 2>& J) {
    J.setIdentity();
    return x - z;
  }
};
struct InDoubles : Known {
  static Vector<double, 2> evaluate(const Vector<double, 2>& x, const Vector<double, 2>& z,
                                    Eigen::Matrix2d& J) {
    return Analytic::evaluate<double>(x, z, J);
  }
};

/// As Ceres and GTSAM have it.
struct ByPointer : Known {
  static Vector<double, 2> evaluate(const Vector<double, 2>& x, const Vector<double, 2>& z,
                                    Eigen::Matrix2d* J) {
    return Analytic::evaluate<double>(x, z, *J);
  }
};
struct Overloaded : Known {
  static double evaluate(int x) { return x; }
  static double evaluate(double x) { return x; }
};
struct AtAnyScalarButAnotherOrder : Known {
  template <class S>
  static Vector<S, 2> evaluate(Eigen::Matrix<S, 2, 2>& J, const Vector<S, 2>& x,
                               const Vector<S, 2>& z) {
    return Analytic::evaluate<S>(x, z, J);
  }
};
struct Final final : Known {
  static double evaluate(int x) { return x; }
};
class Private : public Known {
  static double evaluate(int x) { return x; }
};
struct NoError : Known {
  static void evaluate(const Vector<double, 2>&, const Vector<double, 2>&, Eigen::Matrix2d&) {}
};

struct NormalizesByValue : Known {
  static Vector<double, 2> normalize(Vector<double, 2> z) { return z; }
};
struct PropagatesMatrices : Known {
  static Vector<double, 2> propagate(const Vector<double, 2>& z) { return z; }
};

struct PlaceThatNormalizesByValue : Place {
  static Vector<double, 2> normalize(Vector<double, 2> x) { return x; }
};
struct PlaceWithAnotherJacobian : Place {
  static Eigen::Matrix2d retract_jacobian(double) { return Eigen::Matrix2d::Identity(); }
};

}  // namespace cairn::test::misfits
