// SPDX-License-Identifier: BSD-3-Clause
#include "camera_world.hpp"

#include <cmath>
#include <iterator>
#include <numbers>
#include <random>
#include <sstream>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Geometry>

namespace cairn::performance {
namespace {

using Pose = Eigen::Isometry3d;

std::vector<Pose> poses_of(const std::string& kitti) {
  std::vector<Pose> poses;
  std::istringstream numbers(kitti);
  for (;;) {
    Pose pose = Pose::Identity();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 4; ++column) numbers >> pose(row, column);
    }
    if (!numbers) return poses;
    pose.linear() = Eigen::Quaterniond(pose.linear()).normalized().toRotationMatrix();
    poses.push_back(pose);
  }
}

std::string text_of(const Pose& pose) {
  const Eigen::Vector3d t = pose.translation();
  const Eigen::Quaterniond q(pose.linear());
  return fmt::format("{} {} {} {} {} {} {}", t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
}

/// The same on every machine, unlike std::normal_distribution.
class Normal {
 public:
  explicit Normal(std::uint64_t seed) : engine_(seed) {}
  /// In [0, 1).
  double uniform() { return static_cast<double>(engine_() >> 11) * 0x1.0p-53; }
  Eigen::Vector3d vector(double sigma) {
    Eigen::Vector3d v;
    for (double& component : v) {  // Box and Muller
      const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
      component = sigma * radius * std::cos(2.0 * std::numbers::pi * uniform());
    }
    return v;
  }

 private:
  std::mt19937_64 engine_;
};

/// Its upper triangle row by row.
std::string information_of(const CameraSensor& sensor) {
  std::string text;
  for (int row = 0; row < 6; ++row) {
    const double sigma = row < 3 ? sensor.translation_sigma : sensor.rotation_sigma;
    for (int column = row; column < 6; ++column)
      text += column == row ? fmt::format(" {}", 1.0 / (sigma * sigma)) : " 0";
  }
  return text;
}

}  // namespace

CameraWorld camera_world(const std::string& kitti, const CameraSensor& sensor) {
  const std::vector<Pose> poses = poses_of(kitti);
  const std::string information = information_of(sensor);
  Normal normal(sensor.seed);
  CameraWorld world;
  const auto measure = [&](std::size_t from, std::size_t to) {
    const Pose motion = poses[from].inverse() * poses[to];
    const Eigen::Vector3d dt = normal.vector(sensor.translation_sigma);
    const Eigen::Vector3d turn = normal.vector(sensor.rotation_sigma);
    Pose noise = Pose::Identity();
    noise.translation() = dt;
    if (turn.norm() > 0.0)
      noise.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
    fmt::format_to(std::back_inserter(world.measurements), "EDGE_SE3:QUAT {} {} {}{}\n", from, to,
                   text_of(motion * noise), information);
  };
  const double least_cosine = std::cos(sensor.angle);
  for (std::size_t to = 0; to < poses.size(); ++to) {
    fmt::format_to(std::back_inserter(world.truth), "VERTEX_SE3:QUAT {} {}\n", to,
                   text_of(poses[to]));
    if (to > 0) measure(to - 1, to);
    for (std::size_t from = 0; from + 1 < to; ++from) {
      const Eigen::Vector3d apart = poses[from].translation() - poses[to].translation();
      const double cosine = poses[from].linear().col(2).dot(poses[to].linear().col(2));
      if (apart.norm() > sensor.range || cosine < least_cosine) continue;
      if (normal.uniform() < sensor.matched) measure(from, to);
    }
  }
  return world;
}

}  // namespace cairn::performance
