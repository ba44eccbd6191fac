// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <limits>

#include <Eigen/Core>

namespace cairn {

/// A dual number value + gradient · ε (ε² = 0) with N partial derivatives: arithmetic on it
/// differentiates as it goes. It works with +, −, *, /, comparisons (by value), ternaries, the functions
/// below (write `using std::sin; sin(x)`, so that plain doubles work too) and Eigen matrices.
template <int N>
struct Dual {
  using Gradient = Eigen::Matrix<double, N, 1>;

  double value = 0.0;
  Gradient gradient;

  Dual() : gradient(Gradient::Zero()) {}
  // Not explicit: constants mix with dual numbers.
  Dual(double constant) : value(constant), gradient(Gradient::Zero()) {}  // NOLINT
  /// The gradient as an expression, so that it is written in place.
  template <class Expression>
  Dual(double v, const Eigen::MatrixBase<Expression>& g) : value(v), gradient(g) {}
  /// The `k`th independent variable, with that value.
  static Dual variable(double v, int k) {
    Dual x(v);
    x.gradient[k] = 1.0;
    return x;
  }

  Dual& operator+=(const Dual& b) { return *this = *this + b; }
  Dual& operator-=(const Dual& b) { return *this = *this - b; }
  Dual& operator*=(const Dual& b) { return *this = *this * b; }
  Dual& operator/=(const Dual& b) { return *this = *this / b; }

  friend Dual operator+(const Dual& a) { return a; }
  friend Dual operator-(const Dual& a) { return {-a.value, -a.gradient}; }
  friend Dual operator+(const Dual& a, const Dual& b) {
    return {a.value + b.value, a.gradient + b.gradient};
  }
  friend Dual operator-(const Dual& a, const Dual& b) {
    return {a.value - b.value, a.gradient - b.gradient};
  }
  friend Dual operator*(const Dual& a, const Dual& b) {
    return {a.value * b.value, a.gradient * b.value + b.gradient * a.value};
  }
  friend Dual operator/(const Dual& a, const Dual& b) {
    const double reciprocal = 1.0 / b.value, quotient = a.value * reciprocal;
    return {a.value / b.value, (a.gradient - b.gradient * quotient) * reciprocal};
  }
  // With a plain number there is half the work.
  friend Dual operator+(const Dual& a, double b) { return {a.value + b, a.gradient}; }
  friend Dual operator+(double a, const Dual& b) { return {a + b.value, b.gradient}; }
  friend Dual operator-(const Dual& a, double b) { return {a.value - b, a.gradient}; }
  friend Dual operator-(double a, const Dual& b) { return {a - b.value, -b.gradient}; }
  friend Dual operator*(const Dual& a, double b) { return {a.value * b, a.gradient * b}; }
  friend Dual operator*(double a, const Dual& b) { return {a * b.value, b.gradient * a}; }
  friend Dual operator/(const Dual& a, double b) { return {a.value / b, a.gradient / b}; }
  friend Dual operator/(double a, const Dual& b) {
    const double quotient = a / b.value;
    return {quotient, b.gradient * (-quotient / b.value)};
  }

  friend bool operator==(const Dual& a, const Dual& b) { return a.value == b.value; }
  friend auto operator<=>(const Dual& a, const Dual& b) { return a.value <=> b.value; }
  friend bool operator==(const Dual& a, double b) { return a.value == b; }
  friend auto operator<=>(const Dual& a, double b) { return a.value <=> b; }

  friend Dual sqrt(const Dual& x) {
    const double root = std::sqrt(x.value);
    return {root, x.gradient * (0.5 / root)};
  }
  friend Dual exp(const Dual& x) {
    const double power = std::exp(x.value);
    return {power, x.gradient * power};
  }
  friend Dual log(const Dual& x) { return {std::log(x.value), x.gradient / x.value}; }
  friend Dual pow(const Dual& x, double p) {
    return {std::pow(x.value, p), x.gradient * (p * std::pow(x.value, p - 1.0))};
  }
  friend Dual pow(const Dual& x, const Dual& p) {
    const double power = std::pow(x.value, p.value);
    Gradient gradient = x.gradient * (p.value * std::pow(x.value, p.value - 1.0));
    if (x.value > 0.0) gradient += p.gradient * (power * std::log(x.value));
    return {power, gradient};
  }
  friend Dual sin(const Dual& x) { return {std::sin(x.value), x.gradient * std::cos(x.value)}; }
  friend Dual cos(const Dual& x) { return {std::cos(x.value), x.gradient * -std::sin(x.value)}; }
  friend Dual tan(const Dual& x) {
    const double tangent = std::tan(x.value);
    return {tangent, x.gradient * (1.0 + tangent * tangent)};
  }
  friend Dual asin(const Dual& x) {
    return {std::asin(x.value), x.gradient / std::sqrt((1.0 - x.value) * (1.0 + x.value))};
  }
  friend Dual acos(const Dual& x) {
    return {std::acos(x.value), x.gradient / -std::sqrt((1.0 - x.value) * (1.0 + x.value))};
  }
  friend Dual atan(const Dual& x) {
    return {std::atan(x.value), x.gradient / (1.0 + x.value * x.value)};
  }
  friend Dual atan2(const Dual& y, const Dual& x) {
    const double square = x.value * x.value + y.value * y.value;
    return {std::atan2(y.value, x.value),
            y.gradient * (x.value / square) - x.gradient * (y.value / square)};
  }
  friend Dual hypot(const Dual& x, const Dual& y) {
    const double length = std::hypot(x.value, y.value);
    return {length, x.gradient * (x.value / length) + y.gradient * (y.value / length)};
  }
  friend Dual sinh(const Dual& x) { return {std::sinh(x.value), x.gradient * std::cosh(x.value)}; }
  friend Dual cosh(const Dual& x) { return {std::cosh(x.value), x.gradient * std::sinh(x.value)}; }
  friend Dual tanh(const Dual& x) {
    const double tangent = std::tanh(x.value);
    return {tangent, x.gradient * (1.0 - tangent * tangent)};
  }
  friend Dual abs(const Dual& x) { return x.value < 0.0 ? -x : x; }
  friend Dual fabs(const Dual& x) { return abs(x); }
  friend Dual floor(const Dual& x) { return {std::floor(x.value)}; }
  friend Dual ceil(const Dual& x) { return {std::ceil(x.value)}; }
  friend Dual fmod(const Dual& x, double y) { return {std::fmod(x.value, y), x.gradient}; }
  friend Dual min(const Dual& a, const Dual& b) { return b.value < a.value ? b : a; }
  friend Dual max(const Dual& a, const Dual& b) { return a.value < b.value ? b : a; }
  friend bool isfinite(const Dual& x) { return std::isfinite(x.value) && x.gradient.allFinite(); }
  friend bool isnan(const Dual& x) { return std::isnan(x.value) || x.gradient.hasNaN(); }
  friend bool isinf(const Dual& x) { return std::isinf(x.value); }

  // What Eigen asks of a real scalar.
  friend const Dual& conj(const Dual& x) { return x; }
  friend const Dual& real(const Dual& x) { return x; }
  friend Dual imag(const Dual&) { return {}; }
  friend Dual abs2(const Dual& x) { return x * x; }
};

}  // namespace cairn

namespace Eigen {

template <int N>
struct NumTraits<cairn::Dual<N>> : GenericNumTraits<double> {
  using Real = cairn::Dual<N>;
  using NonInteger = cairn::Dual<N>;
  using Nested = cairn::Dual<N>;
  using Literal = cairn::Dual<N>;
  enum { IsComplex = 0, IsInteger = 0, IsSigned = 1, RequireInitialization = 1, ReadCost = 1, AddCost = N + 1, MulCost = 3 * N };
  static Real epsilon() { return std::numeric_limits<double>::epsilon(); }
  static Real dummy_precision() { return 1e-12; }
  static Real highest() { return std::numeric_limits<double>::max(); }
  static Real lowest() { return std::numeric_limits<double>::lowest(); }
};

// Matrices of plain numbers and of dual numbers mix.
template <int N, class Operation>
struct ScalarBinaryOpTraits<cairn::Dual<N>, double, Operation> {
  using ReturnType = cairn::Dual<N>;
};
template <int N, class Operation>
struct ScalarBinaryOpTraits<double, cairn::Dual<N>, Operation> {
  using ReturnType = cairn::Dual<N>;
};

}  // namespace Eigen
