// SPDX-License-Identifier: BSD-3-Clause
#include "portable_math.hpp"

#include <cmath>

namespace cairn::generate {
namespace {

// Taylor series of sin and cos for |r| ≤ π/4; the first term left out is below 1e-18.
double sin_series(double r) {
  const double s = r * r;
  double sum = 0.0;
  for (int k = 17; k >= 3; k -= 2) sum = (1.0 - sum) * s / ((k - 1) * k);
  return r * (1.0 - sum);
}
double cos_series(double r) {
  const double s = r * r;
  double sum = 0.0;
  for (int k = 18; k >= 2; k -= 2) sum = (1.0 - sum) * s / ((k - 1) * k);
  return 1.0 - sum;
}

// π/2 = kHigh + kMiddle + kLow; the first two have at most 33 bits, so that their products with a
// quadrant below 2^20 are exact (Cody and Waite 1980).
constexpr double kHigh = 0x1.921fb544p+0;
constexpr double kMiddle = 0x1.0b4611a6p-34;
constexpr double kLow = 0x1.3198a2e037073p-69;

}  // namespace

SinCos sin_cos(double angle) {
  const double quadrant = std::floor(angle * (2.0 / kPi) + 0.5);
  const double r = ((angle - quadrant * kHigh) - quadrant * kMiddle) - quadrant * kLow;
  const double s = sin_series(r), c = cos_series(r);
  switch (static_cast<long long>(quadrant) & 3) {
    case 0:
      return {s, c};
    case 1:
      return {c, -s};
    case 2:
      return {-s, -c};
    default:
      return {-c, s};
  }
}

double natural_log(double x) {
  constexpr double kSqrtHalf = 0.70710678118654752440;
  constexpr double kLn2 = 0.69314718055994530942;
  int exponent = 0;
  double m = std::frexp(x, &exponent);  // x = m 2^exponent, m in [1/2, 1)
  if (m < kSqrtHalf) {
    m *= 2.0;
    --exponent;
  }
  // ln m = 2 artanh f with |f| < 0.172: f (1 + f²/3 + f⁴/5 + …)
  const double f = (m - 1.0) / (m + 1.0);
  const double s = f * f;
  double sum = 0.0;
  for (int k = 25; k >= 1; k -= 2) sum = sum * s + 1.0 / k;
  return exponent * kLn2 + 2.0 * f * sum;
}

double arc_tangent(double y, double x) {
  const double norm = std::sqrt(x * x + y * y);
  if (norm == 0.0) return 0.0;
  const double c = x / norm, s = y / norm;
  // A guess good to 0.08 rad, then δ = arcsin of the sine of what is missing, by its series; the
  // error goes with the seventh power, so that three rounds are more than enough.
  const double a = std::fabs(s), b = std::fabs(c);
  double angle = a <= b ? kPi / 4.0 * (a / b) : kPi / 2.0 - kPi / 4.0 * (b / a);
  if (c < 0.0) angle = kPi - angle;
  if (s < 0.0) angle = -angle;
  for (int round = 0; round < 3; ++round) {
    const SinCos guess = sin_cos(angle);
    const double d = s * guess.cos - c * guess.sin, d2 = d * d;
    angle += d * (1.0 + d2 * (1.0 / 6.0 + d2 * (3.0 / 40.0)));
  }
  return angle > kPi ? kPi : angle < -kPi ? -kPi : angle;
}

double wrap_angle(double angle) {
  return angle - std::floor(angle / (2.0 * kPi) + 0.5) * (2.0 * kPi);
}

}  // namespace cairn::generate
