// SPDX-License-Identifier: BSD-3-Clause
#include "rigid.hpp"

#include <cmath>

namespace cairn::generate {
namespace {

using Vector3 = std::array<double, 3>;
using Quaternion = std::array<double, 4>;  // x y z w

Vector3 cross(const Vector3& a, const Vector3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
double dot(const Vector3& a, const Vector3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vector3 unit(const Vector3& a) {
  const double n = std::sqrt(dot(a, a));
  return {a[0] / n, a[1] / n, a[2] / n};
}

Quaternion unit(const Quaternion& q) {
  const double n = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  const double s = q[3] < 0.0 ? -n : n;
  return {q[0] / s, q[1] / s, q[2] / s, q[3] / s};
}
Quaternion multiply(const Quaternion& a, const Quaternion& b) {
  return {a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
          a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
          a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
          a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]};
}
Quaternion conjugate(const Quaternion& q) { return {-q[0], -q[1], -q[2], q[3]}; }

/// R(q) p = p + 2 w (v × p) + 2 v × (v × p).
Vector3 rotate(const Quaternion& q, const Vector3& p) {
  const Vector3 v{q[0], q[1], q[2]};
  const Vector3 c = cross(v, p);
  const Vector3 cc = cross(v, c);
  Vector3 out;
  for (int k = 0; k < 3; ++k) out[k] = p[k] + 2.0 * (q[3] * c[k] + cc[k]);
  return out;
}

/// Shepperd's method: the largest of the four components is found by a square root, the others
/// follow.
Quaternion from_axes(const Vector3& x, const Vector3& y, const Vector3& z) {
  const double trace = x[0] + y[1] + z[2];
  if (trace >= x[0] && trace >= y[1] && trace >= z[2]) {
    return unit(Quaternion{y[2] - z[1], z[0] - x[2], x[1] - y[0], 1.0 + trace});
  }
  if (x[0] >= y[1] && x[0] >= z[2]) {
    return unit(Quaternion{1.0 + x[0] - y[1] - z[2], y[0] + x[1], z[0] + x[2], y[2] - z[1]});
  }
  if (y[1] >= z[2]) {
    return unit(Quaternion{y[0] + x[1], 1.0 + y[1] - x[0] - z[2], z[1] + y[2], z[0] - x[2]});
  }
  return unit(Quaternion{z[0] + x[2], z[1] + y[2], 1.0 + z[2] - x[0] - y[1], x[1] - y[0]});
}

}  // namespace

Pose2 compose(const Pose2& a, const Pose2& b) {
  const SinCos r = sin_cos(a.theta);
  return {a.x + (r.cos * b.x - r.sin * b.y), a.y + (r.sin * b.x + r.cos * b.y),
          wrap_angle(a.theta + b.theta)};
}
Pose3 compose(const Pose3& a, const Pose3& b) {
  const Vector3 t = rotate(a.q, b.t);
  return {{a.t[0] + t[0], a.t[1] + t[1], a.t[2] + t[2]}, unit(multiply(a.q, b.q))};
}

Pose2 inverse(const Pose2& a) { return between(a, Pose2{}); }
Pose3 inverse(const Pose3& a) { return between(a, Pose3{}); }

Pose2 between(const Pose2& a, const Pose2& b) {
  const SinCos r = sin_cos(a.theta);
  const double dx = b.x - a.x, dy = b.y - a.y;
  return {r.cos * dx + r.sin * dy, r.cos * dy - r.sin * dx, wrap_angle(b.theta - a.theta)};
}
Pose3 between(const Pose3& a, const Pose3& b) {
  const Quaternion back = conjugate(a.q);
  return {rotate(back, {b.t[0] - a.t[0], b.t[1] - a.t[1], b.t[2] - a.t[2]}),
          unit(multiply(back, b.q))};
}

Pose2::State state(const Pose2& a) { return {a.x, a.y, a.theta}; }
Pose3::State state(const Pose3& a) {
  return {a.t[0], a.t[1], a.t[2], a.q[0], a.q[1], a.q[2], a.q[3]};
}
std::array<double, 3> position(const Pose2& a) { return {a.x, a.y, 0.0}; }
std::array<double, 3> position(const Pose3& a) { return a.t; }

double rotation_angle(const Pose2& a) { return std::fabs(wrap_angle(a.theta)); }
double rotation_angle(const Pose3& a) {
  const double sine = std::sqrt(a.q[0] * a.q[0] + a.q[1] * a.q[1] + a.q[2] * a.q[2]);
  return 2.0 * arc_tangent(sine, std::fabs(a.q[3]));
}
double length(const Pose2& a) { return std::sqrt(a.x * a.x + a.y * a.y); }
double length(const Pose3& a) { return std::sqrt(dot(a.t, a.t)); }

Pose2 from_vectors(const std::array<double, 3>& v) { return {v[0], v[1], wrap_angle(v[2])}; }
Pose3 from_vectors(const std::array<double, 6>& v) {
  const double angle = std::sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5]);
  const SinCos half = sin_cos(0.5 * angle);
  const double scale = angle > 0.0 ? half.sin / angle : 0.5;
  return {{v[0], v[1], v[2]}, unit(Quaternion{scale * v[3], scale * v[4], scale * v[5], half.cos})};
}

void draw_motion(Random& random, double reach, Pose2& out) {
  out.x = random.uniform(-reach, reach);
  out.y = random.uniform(-reach, reach);
  out.theta = wrap_angle(random.uniform(-kPi, kPi));
}
void draw_motion(Random& random, double reach, Pose3& out) {
  for (double& coordinate : out.t) coordinate = random.uniform(-reach, reach);
  Quaternion q;  // four normal numbers point into every direction alike
  for (double& component : q) component = random.gaussian();
  out.q = unit(q);
}

Pose3 look_along(const Vector3& t, const Vector3& forward, const Vector3& up) {
  const Vector3 x = unit(forward);
  const Vector3 y = unit(cross(up, x));
  return {t, from_axes(x, y, cross(x, y))};
}

}  // namespace cairn::generate
