// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace cairn::generate {

// Elementary functions built from + - * / floor and frexp alone, which IEEE 754 fixes to the last
// bit. The C library's own may differ in the last bit between machines (glibc even chooses between
// variants with and without fused multiply-add when a program starts), and a simulated graph must
// not. That rests on IEEE doubles with round to nearest, on a compiler that neither reorders nor
// fuses (CMakeLists.txt of this plugin sees to that), and on std::sqrt, std::floor and std::frexp,
// which have one right answer. Errors are a few units in the last place.

inline constexpr double kPi = 3.14159265358979323846;

struct SinCos {
  double sin;
  double cos;
};

/// Sine and cosine of an angle [rad], |angle| < 1e6.
SinCos sin_cos(double angle);

/// ln x for finite x > 0.
double natural_log(double x);

/// The angle of the vector (x, y) in [-π, π] [rad], 0 for the null vector.
double arc_tangent(double y, double x);

/// The same direction in [-π, π) [rad].
double wrap_angle(double angle);

}  // namespace cairn::generate
