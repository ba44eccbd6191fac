// SPDX-License-Identifier: BSD-3-Clause
#include "bal_camera.hpp"

#include <algorithm>

#include "cairn/lie/so3.hpp"

namespace cairn::formats {
namespace {

using Vector3 = Eigen::Vector3d;
using Quaternion = so3::Quaternion<double>;

struct Parts {
  std::span<const double> intrinsics;  // f k1 k2
  Vector3 position;
  Quaternion world_camera;
};

Parts parts_of(std::span<const double> state) {
  return {state.first(3), Vector3(state[3], state[4], state[5]),
          Quaternion(state[6], state[7], state[8], state[9])};
}

}  // namespace

void to_state(const BalCamera& camera, std::span<double> state) {
  const Quaternion camera_world = so3::exp<double>(Vector3(camera[0], camera[1], camera[2]));
  const Vector3 T(camera[3], camera[4], camera[5]);
  const Vector3 position = -so3::rotate_back<double>(camera_world, T);
  const Quaternion world_camera = so3::conjugate<double>(camera_world);
  std::copy_n(camera.begin() + 6, 3, state.begin());
  std::copy_n(position.data(), 3, state.begin() + 3);
  std::copy_n(world_camera.data(), 4, state.begin() + 6);
}

BalCamera from_state(std::span<const double> state) {
  const Parts parts = parts_of(state);
  const Vector3 omega = -so3::log<double>(parts.world_camera);
  const Vector3 T = -so3::rotate_back<double>(parts.world_camera, parts.position);
  return {omega[0],
          omega[1],
          omega[2],
          T[0],
          T[1],
          T[2],
          parts.intrinsics[0],
          parts.intrinsics[1],
          parts.intrinsics[2]};
}

bool is_behind(std::span<const double> camera_state, std::span<const double> point) {
  const Parts parts = parts_of(camera_state);
  const Vector3 apart = Vector3(point[0], point[1], point[2]) - parts.position;
  return so3::rotate_back<double>(parts.world_camera, apart)[2] >= 0.0;
}

}  // namespace cairn::formats
