// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <string_view>

#include "random.hpp"

namespace cairn::generate {

// Rigid transformations for the generators: plain doubles and a fixed order of operations, since a
// seed must give the same graph on every machine. Their arrays are those of the variable types of
// the same name.

/// A pose in the plane: position [m] and heading [rad].
struct Pose2 {
  static constexpr int kDimension = 2;
  static constexpr int kTangent = 3;
  static constexpr std::string_view kVariable = "VERTEX_SE2";
  static constexpr std::string_view kRelative = "EDGE_SE2";
  using State = std::array<double, 3>;  // x y theta

  double x = 0.0, y = 0.0, theta = 0.0;
};

/// A pose in space: position [m] and unit quaternion with w ≥ 0.
struct Pose3 {
  static constexpr int kDimension = 3;
  static constexpr int kTangent = 6;
  static constexpr std::string_view kVariable = "VERTEX_SE3:QUAT";
  static constexpr std::string_view kRelative = "EDGE_SE3:QUAT";
  using State = std::array<double, 7>;  // x y z qx qy qz qw

  std::array<double, 3> t{};
  std::array<double, 4> q{0.0, 0.0, 0.0, 1.0};  // x y z w
};

Pose2 compose(const Pose2& a, const Pose2& b);
Pose3 compose(const Pose3& a, const Pose3& b);
Pose2 inverse(const Pose2& a);
Pose3 inverse(const Pose3& a);
/// a⁻¹ b.
Pose2 between(const Pose2& a, const Pose2& b);
Pose3 between(const Pose3& a, const Pose3& b);

Pose2::State state(const Pose2& a);
Pose3::State state(const Pose3& a);
std::array<double, 3> position(const Pose2& a);
std::array<double, 3> position(const Pose3& a);
/// The angle of the rotation, in [0, π] [rad].
double rotation_angle(const Pose2& a);
double rotation_angle(const Pose3& a);
/// The length of the translation [m].
double length(const Pose2& a);
double length(const Pose3& a);

/// A transformation with that translation [m] and rotation vector [rad] (heading in 2D).
Pose2 from_vectors(const std::array<double, 3>& translation_rotation);
Pose3 from_vectors(const std::array<double, 6>& translation_rotation);

/// A transformation by at most `reach` [m] along each axis, with any rotation.
void draw_motion(Random& random, double reach, Pose2& out);
void draw_motion(Random& random, double reach, Pose3& out);

/// The pose at `t` that looks (x axis) along `forward`, its z axis as near as may be to `up`.
Pose3 look_along(const std::array<double, 3>& t, const std::array<double, 3>& forward,
                 const std::array<double, 3>& up);

}  // namespace cairn::generate
