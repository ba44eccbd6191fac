// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Core>

namespace cairn {

/// A dual number value + gradient · ε (ε² = 0) with N partial derivatives: arithmetic on it
/// differentiates as it goes. It works with +, −, *, /, comparisons (by value), ternaries, the
/// functions below (write `using std::sin; sin(x)`, so that plain doubles work too) and Eigen
/// matrices, all of them mixed with plain numbers. No expression templates: `auto` is safe.
///
/// Every operation states its value and its partial derivatives; the chain rule is in the two
/// private constructors. They are plain loops of fixed length, which compilers turn into vector
/// instructions even where a large file has reached the limits of inlining.
template <int N>
class Dual {
 public:
  double value = 0.0;
  alignas(16) std::array<double, N> gradient;  // whole vector registers

  Dual() : gradient{} {}
  Dual(double constant) : value(constant), gradient{} {}  // NOLINT(google-explicit-constructor)
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
    const double quotient = a.value / b.value;
    return {quotient, 1.0 / b.value, a, -quotient / b.value, b};
  }
  friend Dual operator+(const Dual& a, double b) { return {a.value + b, 1.0, a}; }
  friend Dual operator+(double a, const Dual& b) { return {a + b.value, 1.0, b}; }
  friend Dual operator-(const Dual& a, double b) { return {a.value - b, 1.0, a}; }
  friend Dual operator-(double a, const Dual& b) { return {a - b.value, -1.0, b}; }
  friend Dual operator*(const Dual& a, double b) { return {a.value * b, b, a}; }
  friend Dual operator*(double a, const Dual& b) { return {a * b.value, a, b}; }
  friend Dual operator/(const Dual& a, double b) { return {a.value / b, 1.0 / b, a}; }
  friend Dual operator/(double a, const Dual& b) {
    const double quotient = a / b.value;
    return {quotient, -quotient / b.value, b};
  }

  friend bool operator==(const Dual& a, const Dual& b) { return a.value == b.value; }
  friend auto operator<=>(const Dual& a, const Dual& b) { return a.value <=> b.value; }
  friend bool operator==(const Dual& a, double b) { return a.value == b; }
  friend auto operator<=>(const Dual& a, double b) { return a.value <=> b; }

  friend Dual sqrt(const Dual& x) {
    const double root = std::sqrt(x.value);
    return {root, 0.5 / root, x};
  }
  friend Dual exp(const Dual& x) {
    const double power = std::exp(x.value);
    return {power, power, x};
  }
  friend Dual log(const Dual& x) { return {std::log(x.value), 1.0 / x.value, x}; }
  friend Dual pow(const Dual& x, double p) {
    return {std::pow(x.value, p), p * std::pow(x.value, p - 1.0), x};
  }
  friend Dual pow(const Dual& x, const Dual& p) {
    const double power = std::pow(x.value, p.value);
    const double by_power = x.value > 0.0 ? power * std::log(x.value) : 0.0;
    return {power, p.value * std::pow(x.value, p.value - 1.0), x, by_power, p};
  }
  friend Dual sin(const Dual& x) { return {std::sin(x.value), std::cos(x.value), x}; }
  friend Dual cos(const Dual& x) { return {std::cos(x.value), -std::sin(x.value), x}; }
  friend Dual tan(const Dual& x) {
    const double tangent = std::tan(x.value);
    return {tangent, 1.0 + tangent * tangent, x};
  }
  friend Dual asin(const Dual& x) {
    return {std::asin(x.value), 1.0 / std::sqrt((1.0 - x.value) * (1.0 + x.value)), x};
  }
  friend Dual acos(const Dual& x) {
    return {std::acos(x.value), -1.0 / std::sqrt((1.0 - x.value) * (1.0 + x.value)), x};
  }
  friend Dual atan(const Dual& x) {
    return {std::atan(x.value), 1.0 / (1.0 + x.value * x.value), x};
  }
  friend Dual atan2(const Dual& y, const Dual& x) {
    const double square = x.value * x.value + y.value * y.value;
    return {std::atan2(y.value, x.value), x.value / square, y, -y.value / square, x};
  }
  friend Dual hypot(const Dual& x, const Dual& y) {
    const double length = std::hypot(x.value, y.value);
    return {length, x.value / length, x, y.value / length, y};
  }
  friend Dual sinh(const Dual& x) { return {std::sinh(x.value), std::cosh(x.value), x}; }
  friend Dual cosh(const Dual& x) { return {std::cosh(x.value), std::sinh(x.value), x}; }
  friend Dual tanh(const Dual& x) {
    const double tangent = std::tanh(x.value);
    return {tangent, 1.0 - tangent * tangent, x};
  }
  friend Dual abs(const Dual& x) { return x.value < 0.0 ? -x : x; }
  friend Dual fabs(const Dual& x) { return abs(x); }
  friend Dual floor(const Dual& x) { return std::floor(x.value); }
  friend Dual ceil(const Dual& x) { return std::ceil(x.value); }
  friend Dual fmod(const Dual& x, double y) { return {std::fmod(x.value, y), 1.0, x}; }
  friend Dual min(const Dual& a, const Dual& b) { return b.value < a.value ? b : a; }
  friend Dual max(const Dual& a, const Dual& b) { return a.value < b.value ? b : a; }
  friend bool isfinite(const Dual& x) {
    bool finite = std::isfinite(x.value);
    for (const double partial : x.gradient) finite = finite && std::isfinite(partial);
    return finite;
  }
  friend bool isnan(const Dual& x) { return std::isnan(x.value); }
  friend bool isinf(const Dual& x) { return std::isinf(x.value); }

  // What Eigen asks of a real scalar.
  friend const Dual& conj(const Dual& x) { return x; }
  friend const Dual& real(const Dual& x) { return x; }
  friend Dual imag(const Dual&) { return {}; }
  friend Dual abs2(const Dual& x) { return x * x; }

 private:
  /// v, with the gradient da ∇a.
  Dual(double v, double da, const Dual& a) : value(v) {
    for (int k = 0; k < N; ++k) gradient[k] = da * a.gradient[k];
  }
  /// v, with the gradient da ∇a + db ∇b.
  Dual(double v, double da, const Dual& a, double db, const Dual& b) : value(v) {
    for (int k = 0; k < N; ++k) gradient[k] = da * a.gradient[k] + db * b.gradient[k];
  }
};

}  // namespace cairn

namespace Eigen {

template <int N>
struct NumTraits<cairn::Dual<N>> : GenericNumTraits<double> {
  using Real = cairn::Dual<N>;
  using NonInteger = cairn::Dual<N>;
  using Nested = cairn::Dual<N>;
  using Literal = cairn::Dual<N>;
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
template <int N, class Operation>
struct ScalarBinaryOpTraits<cairn::Dual<N>, double, Operation> {
  using ReturnType = cairn::Dual<N>;
};
template <int N, class Operation>
struct ScalarBinaryOpTraits<double, cairn::Dual<N>, Operation> {
  using ReturnType = cairn::Dual<N>;
};

}  // namespace Eigen
