// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdio>
#include <initializer_list>
#include <ostream>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include <Eigen/Core>

#include "cairn/runtime/error.hpp"
#include "cairn/types/define_variable.hpp"

namespace cairn {
namespace detail {

/// "Pose2(4, 0, 1.5708)"
inline std::string value_text(std::string_view name, std::initializer_list<double> numbers) {
  std::string text = std::string(name) + "(";
  for (const double number : numbers) {
    char digits[32];
    // Adding zero turns −0 into 0.
    std::snprintf(digits, sizeof digits, "%.6g", number + 0.0);
    if (text.back() != '(') text += ", ";
    text += digits;
  }
  return text + ")";
}

/// N numbers as a vector. Throws `Error` (usage) if there are more or fewer.
template <int N>
Vector<double, N> sized(std::string_view name, std::span<const double> numbers) {
  if (numbers.size() != static_cast<std::size_t>(N)) {
    throw Error(ErrorCode::usage, "a " + std::string(name) + " is stored as " + std::to_string(N) +
                                      " numbers, not " + std::to_string(numbers.size()));
  }
  return load<N>(numbers.data());
}

}  // namespace detail

/// What `BasicRot2`, `BasicRot3`, `BasicPose2` and `BasicPose3` have in common: elements of a Lie
/// group as values, over the static functions of `Group` (such as `Se2`). S is double, or a dual
/// number inside of a factor's `residual`.
///
/// A value is stored as the numbers of a graph's state, and is implicitly a span of them. exp, log,
/// retract and local use the full exponential of the group, with tangent vectors of the body:
/// retract(δ) = x · exp(δ), translation first.
template <class Derived, class Group, class S>
class GroupValue {
 public:
  using Scalar = S;
  using Traits = Group;
  static constexpr int kAmbient = Group::kAmbient, kTangent = Group::kTangent;
  using State = Vector<S, kAmbient>;
  using Tangent = Vector<S, kTangent>;

  static Derived identity() { return Derived(State(Group::identity().template cast<S>())); }
  /// The numbers of a state, as they are stored. Throws `Error` (usage) for another count.
  static Derived from_state(std::span<const double> state) requires std::is_same_v<S, double> {
    return Derived(detail::sized<kAmbient>(Derived::kName, state));
  }
  static Derived exp(const Tangent& delta) { return Derived(Group::template exp<S>(delta)); }

  /// The tangent vector with exp(log()) = *this, of least rotation.
  Tangent log() const { return Group::template log<S>(x_); }
  Derived inverse() const { return Derived(Group::template inverse<S>(x_)); }
  /// *this⁻¹ · other: `other` as seen from here.
  Derived between(const Derived& other) const {
    return Derived(Group::template between<S>(x_, other.x_));
  }
  /// *this · exp(delta)
  Derived retract(const Tangent& delta) const {
    return Derived(Group::template retract<S>(x_, delta));
  }
  /// log(*this⁻¹ · other): the δ with retract(δ) = other.
  Tangent local(const Derived& other) const { return Group::template local<S>(x_, other.x_); }
  /// Ad, tangent × tangent: x exp(δ) x⁻¹ = exp(Ad δ).
  Eigen::Matrix<double, kTangent, kTangent> adjoint() const requires std::is_same_v<S, double> {
    return Group::adjoint(x_);
  }

  friend Derived operator*(const Derived& a, const Derived& b) { return product(a, b); }

  /// The same value over another scalar: a measurement inside of a factor's `residual`.
  template <class T>
  auto cast() const {
    return typename Derived::template Over<T>(Vector<T, kAmbient>(x_.template cast<T>()));
  }

  /// Whether no entry of local(other) is beyond the tolerance [m, rad].
  bool equals(const Derived& other,
              double tolerance = 1e-9) const requires std::is_same_v<S, double> {
    return local(other).cwiseAbs().maxCoeff() <= tolerance;
  }

  /// The numbers that it is stored as.
  const State& state() const { return x_; }
  operator std::span<const S>() const {  // NOLINT(google-explicit-constructor)
    return {x_.data(), static_cast<std::size_t>(kAmbient)};
  }

  friend std::ostream& operator<<(std::ostream& stream,
                                  const Derived& value) requires std::is_same_v<S, double> {
    return stream << to_string(value);
  }

 protected:
  explicit GroupValue(const State& state) : x_(state) {}
  GroupValue(const GroupValue&) = default;
  GroupValue& operator=(const GroupValue&) = default;
  ~GroupValue() = default;

  State x_;

 private:
  static Derived product(const Derived& a, const Derived& b) {
    State x = Group::template compose<S>(a.x_, b.x_);
    Derived::renormalize(x);  // or rounding would pile up in long chains
    return Derived(x);
  }
};

}  // namespace cairn
