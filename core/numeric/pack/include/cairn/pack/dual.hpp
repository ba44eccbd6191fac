// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <concepts>
#include <limits>
#include <type_traits>

#include <Eigen/Core>

#include "cairn/pack/pack.hpp"

namespace cairn {

template <class C, class T>
concept PlainFor = std::convertible_to<C, T>;

/// A dual number value + gradient · ε (ε² = 0) with N partial derivatives: arithmetic on it
/// differentiates as it goes. It works with +, −, *, /, comparisons (by value), ternaries, the
/// functions below (write `using std::sin; sin(x)`, so that plain doubles work too) and Eigen
/// matrices, all of them mixed with plain numbers. No expression templates: `auto` is safe. T is
/// double or a pack of them (`cairn/pack/pack.hpp`).
///
/// Every operation states its value and its partial derivatives; the chain rule is in the two
/// private constructors. They are plain loops of fixed length, which compilers turn into vector
/// instructions even where a large file has reached the limits of inlining.
template <int N, class T = double>
class Dual {
 public:
  T value = 0.0;
  alignas(16) alignas(T) std::array<T, N> gradient;  // whole vector registers

  Dual() { gradient.fill(0.0); }
  Dual(double constant) : Dual() { value = constant; }  // NOLINT(google-explicit-constructor)
  Dual(const T& constant)                               // NOLINT(google-explicit-constructor)
      requires(!std::is_same_v<T, double>)
      : Dual() {
    value = constant;
  }
  /// The `k`th independent variable, with that value.
  static Dual variable(const T& v, int k) {
    Dual x(v);
    x.gradient[k] = 1.0;
    return x;
  }

  Dual& operator+=(const Dual& b) { return *this = *this + b; }
  Dual& operator-=(const Dual& b) { return *this = *this - b; }
  Dual& operator*=(const Dual& b) { return *this = *this * b; }
  Dual& operator/=(const Dual& b) { return *this = *this / b; }

  friend Dual operator+(const Dual& a) { return a; }
  friend Dual operator-(const Dual& a) { return {-a.value, -1.0, a}; }
  friend Dual operator+(const Dual& a, const Dual& b) {
    return {a.value + b.value, 1.0, a, 1.0, b};
  }
  friend Dual operator-(const Dual& a, const Dual& b) {
    return {a.value - b.value, 1.0, a, -1.0, b};
  }
  friend Dual operator*(const Dual& a, const Dual& b) {
    return {a.value * b.value, b.value, a, a.value, b};
  }
  friend Dual operator/(const Dual& a, const Dual& b) {
    const T quotient = a.value / b.value;
    return {quotient, 1.0 / b.value, a, -quotient / b.value, b};
  }
  friend Dual operator+(const Dual& a, const PlainFor<T> auto& b) { return {a.value + b, 1.0, a}; }
  friend Dual operator+(const PlainFor<T> auto& a, const Dual& b) { return {a + b.value, 1.0, b}; }
  friend Dual operator-(const Dual& a, const PlainFor<T> auto& b) { return {a.value - b, 1.0, a}; }
  friend Dual operator-(const PlainFor<T> auto& a, const Dual& b) { return {a - b.value, -1.0, b}; }
  friend Dual operator*(const Dual& a, const PlainFor<T> auto& b) { return {a.value * b, T(b), a}; }
  friend Dual operator*(const PlainFor<T> auto& a, const Dual& b) { return {a * b.value, T(a), b}; }
  friend Dual operator/(const Dual& a, const PlainFor<T> auto& b) {
    return {a.value / b, 1.0 / b, a};
  }
  friend Dual operator/(const PlainFor<T> auto& a, const Dual& b) {
    const T quotient = a / b.value;
    return {quotient, -quotient / b.value, b};
  }

  friend bool operator==(const Dual& a, const Dual& b) { return a.value == b.value; }
  friend auto operator<=>(const Dual& a, const Dual& b) { return a.value <=> b.value; }
  friend bool operator==(const Dual& a, double b) { return a.value == b; }
  friend auto operator<=>(const Dual& a, double b) { return a.value <=> b; }

  friend Dual sqrt(const Dual& x) {
    const T root = lanes::sqrt(x.value);
    return {root, 0.5 / root, x};
  }
  friend Dual exp(const Dual& x) {
    const T power = lanes::exp(x.value);
    return {power, power, x};
  }
  friend Dual log(const Dual& x) { return {lanes::log(x.value), 1.0 / x.value, x}; }
  friend Dual pow(const Dual& x, double p) {
    return {lanes::pow(x.value, p), p * lanes::pow(x.value, p - 1.0), x};
  }
  friend Dual pow(const Dual& x, const Dual& p) {
    const T power = lanes::pow(x.value, p.value);
    const T by_power = x.value > 0.0 ? power * lanes::log(x.value) : 0.0;
    return {power, p.value * lanes::pow(x.value, p.value - 1.0), x, by_power, p};
  }
  friend Dual sin(const Dual& x) { return {lanes::sin(x.value), lanes::cos(x.value), x}; }
  friend Dual cos(const Dual& x) { return {lanes::cos(x.value), -lanes::sin(x.value), x}; }
  friend Dual tan(const Dual& x) {
    const T tangent = lanes::tan(x.value);
    return {tangent, 1.0 + tangent * tangent, x};
  }
  friend Dual asin(const Dual& x) {
    return {lanes::asin(x.value), 1.0 / lanes::sqrt((1.0 - x.value) * (1.0 + x.value)), x};
  }
  friend Dual acos(const Dual& x) {
    return {lanes::acos(x.value), -1.0 / lanes::sqrt((1.0 - x.value) * (1.0 + x.value)), x};
  }
  friend Dual atan(const Dual& x) {
    return {lanes::atan(x.value), 1.0 / (1.0 + x.value * x.value), x};
  }
  friend Dual atan2(const Dual& y, const Dual& x) {
    const T square = x.value * x.value + y.value * y.value;
    return {lanes::atan2(y.value, x.value), x.value / square, y, -y.value / square, x};
  }
  friend Dual hypot(const Dual& x, const Dual& y) {
    const T length = lanes::hypot(x.value, y.value);
    return {length, x.value / length, x, y.value / length, y};
  }
  friend Dual sinh(const Dual& x) { return {lanes::sinh(x.value), lanes::cosh(x.value), x}; }
  friend Dual cosh(const Dual& x) { return {lanes::cosh(x.value), lanes::sinh(x.value), x}; }
  friend Dual tanh(const Dual& x) {
    const T tangent = lanes::tanh(x.value);
    return {tangent, 1.0 - tangent * tangent, x};
  }
  friend Dual abs(const Dual& x) { return if_less(x, 0.0, -x, x); }
  friend Dual fabs(const Dual& x) { return abs(x); }
  friend Dual floor(const Dual& x) { return lanes::floor(x.value); }
  friend Dual ceil(const Dual& x) { return lanes::ceil(x.value); }
  friend Dual fmod(const Dual& x, double y) { return {lanes::fmod(x.value, y), 1.0, x}; }
  friend Dual min(const Dual& a, const Dual& b) { return b.value < a.value ? b : a; }
  friend Dual max(const Dual& a, const Dual& b) { return a.value < b.value ? b : a; }
  friend Dual if_less(const Dual& a, const Dual& b, const Dual& x, const Dual& y) {
    Dual r(lanes::if_less(a.value, b.value, x.value, y.value));
    for (int k = 0; k < N; ++k)
      r.gradient[k] = lanes::if_less(a.value, b.value, x.gradient[k], y.gradient[k]);
    return r;
  }
  friend int is_below(const Dual& x, double bound) { return lanes::is_below(x.value, bound); }
  friend bool isfinite(const Dual& x) {
    bool finite = lanes::isfinite(x.value);
    for (const T& partial : x.gradient) finite = finite && lanes::isfinite(partial);
    return finite;
  }
  friend bool isnan(const Dual& x) { return lanes::isnan(x.value); }
  friend bool isinf(const Dual& x) { return lanes::isinf(x.value); }

  // What Eigen asks of a real scalar.
  friend const Dual& conj(const Dual& x) { return x; }
  friend const Dual& real(const Dual& x) { return x; }
  friend Dual imag(const Dual&) { return {}; }
  friend Dual abs2(const Dual& x) { return x * x; }

 private:
  /// v, with the gradient da ∇a.
  Dual(const T& v, const T& da, const Dual& a) : value(v) {
    for (int k = 0; k < N; ++k) gradient[k] = da * a.gradient[k];
  }
  /// v, with the gradient da ∇a + db ∇b.
  Dual(const T& v, const T& da, const Dual& a, const T& db, const Dual& b) : value(v) {
    for (int k = 0; k < N; ++k) gradient[k] = da * a.gradient[k] + db * b.gradient[k];
  }
};

namespace detail {
template <class S>
struct ValueOf {
  using Type = S;
};
template <int N, class T>
struct ValueOf<Dual<N, T>> {
  using Type = T;
};
}  // namespace detail

/// The scalar without derivatives: T of Dual<N, T>, any other itself.
template <class S>
using ValueOf = typename detail::ValueOf<S>::Type;

}  // namespace cairn

namespace Eigen {

template <int N, class T>
struct NumTraits<cairn::Dual<N, T>> : GenericNumTraits<double> {
  using Real = cairn::Dual<N, T>;
  using NonInteger = Real;
  using Nested = Real;
  using Literal = Real;
  enum {
    IsComplex = 0,
    IsInteger = 0,
    IsSigned = 1,
    RequireInitialization = 1,
    ReadCost = 1,
    AddCost = N + 1,
    MulCost = 3 * N
  };
  static Real epsilon() { return std::numeric_limits<double>::epsilon(); }
  static Real dummy_precision() { return 1e-12; }
  static Real highest() { return std::numeric_limits<double>::max(); }
  static Real lowest() { return std::numeric_limits<double>::lowest(); }
};

// Matrices of plain numbers and of dual numbers mix.
template <int N, class T, std::convertible_to<T> C, class Operation>
struct ScalarBinaryOpTraits<cairn::Dual<N, T>, C, Operation> {
  using ReturnType = cairn::Dual<N, T>;
};
template <int N, class T, std::convertible_to<T> C, class Operation>
struct ScalarBinaryOpTraits<C, cairn::Dual<N, T>, Operation> {
  using ReturnType = cairn::Dual<N, T>;
};

}  // namespace Eigen
