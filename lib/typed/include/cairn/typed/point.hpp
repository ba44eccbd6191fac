// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <concepts>
#include <ostream>
#include <ranges>
#include <span>
#include <string>
#include <type_traits>

#include "cairn/lie/point.hpp"
#include "cairn/typed/group_value.hpp"

namespace cairn {

/// A point of the plane (N = 2) or of space (N = 3) as a value: an Eigen vector with a name, x y z
/// [m], which starts as zero and is implicitly a span of its coordinates. S is double, or a dual
/// number inside of a factor's `residual`.
template <class S, int N>
class BasicPoint : public Vector<S, N> {
  using Base = Vector<S, N>;

 public:
  using Traits = std::conditional_t<N == 2, PointXY, PointXYZ>;
  static constexpr const char* kName = N == 2 ? "Point2" : "Point3";

  BasicPoint() : Base(Base::Zero()) {}
  BasicPoint(const S& x, const S& y) requires(N == 2) : Base(x, y) {}
  BasicPoint(const S& x, const S& y, const S& z) requires(N == 3) : Base(x, y, z) {}
  /// From any Eigen vector of that size, so that points add and subtract as vectors do.
  template <class Other>
  requires(int(Other::SizeAtCompileTime) == N && std::same_as<typename Other::Scalar, S>)
      BasicPoint(const Eigen::MatrixBase<Other>& other)  // NOLINT(google-explicit-constructor)
      : Base(other) {}
  template <class Other>
  BasicPoint& operator=(const Eigen::MatrixBase<Other>& other) {
    Base::operator=(other);
    return *this;
  }

  /// Coordinates [m]. Throws `Error` (usage) for another count than N.
  static BasicPoint from_state(std::span<const double> state) requires std::is_same_v<S, double> {
    return BasicPoint(detail::sized<N>(kName, state));
  }

  /// Whether no coordinate differs by more than the tolerance [m].
  bool equals(const BasicPoint& other,
              double tolerance = 1e-9) const requires std::is_same_v<S, double> {
    return (*this - other).cwiseAbs().maxCoeff() <= tolerance;
  }

  /// The coordinates.
  const Base& state() const { return *this; }
  operator std::span<const S>() const  // NOLINT(google-explicit-constructor)
      requires(!std::ranges::contiguous_range<const Base>) {
    return {this->data(), static_cast<std::size_t>(N)};
  }

  friend std::string to_string(const BasicPoint& point) requires std::is_same_v<S, double> {
    if constexpr (N == 2) {
      return detail::value_text(kName, {point[0], point[1]});
    } else {
      return detail::value_text(kName, {point[0], point[1], point[2]});
    }
  }
  friend std::ostream& operator<<(std::ostream& stream,
                                  const BasicPoint& point) requires std::is_same_v<S, double> {
    return stream << to_string(point);
  }
};

template <class S>
using BasicPoint2 = BasicPoint<S, 2>;
template <class S>
using BasicPoint3 = BasicPoint<S, 3>;
/// x y [m]; VERTEX_XY in files.
using Point2 = BasicPoint2<double>;
/// x y z [m]; VERTEX_TRACKXYZ in files.
using Point3 = BasicPoint3<double>;

}  // namespace cairn
