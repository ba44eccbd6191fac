// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/trajectory.hpp"

#include <algorithm>
#include <cassert>
#include <charconv>
#include <cmath>
#include <string>
#include <string_view>

#include <fmt/core.h>
#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cairn/geometry/pose.hpp"
#include "cairn/io/format.hpp"
#include "cairn/io/time_stamps.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr std::string_view kBlanks = " \t\r";

/// A line without comment and without blanks at either end.
std::string_view content(std::string_view line) {
  line = line.substr(0, line.find('#'));
  const std::size_t begin = line.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  return line.substr(begin, line.find_last_not_of(kBlanks) + 1 - begin);
}

/// Takes a robot's coordinates (x forward, y left, z up) to a camera's (x right, y down, z
/// forward).
Matrix3d robot_to_camera() { return Matrix3d{{0, -1, 0}, {0, 0, -1}, {1, 0, 0}}; }

double stamp_of(std::string_view text, const std::string& where) {
  double stamp = 0.0;
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), stamp);
  if (problem != std::errc{} || end != text.data() + text.size() || !std::isfinite(stamp)) {
    throw Error(ErrorCode::input,
                fmt::format("{}: found '{}'; expected a time stamp, one finite number per line",
                            where, text.substr(0, 40)));
  }
  return stamp;
}

}  // namespace

Trajectory trajectory(const Graph& graph) {
  Trajectory result;
  for (int v = 0; v < graph.variable_count(); ++v) {
    if (!has_orientation(graph.type(v))) continue;
    const Pose at = pose_of(graph.type(v), graph.state(v));
    TrajectoryPose pose;
    pose.id = graph.id(v);
    std::copy_n(at.t.data(), 3, pose.t.begin());
    std::copy_n(at.R.data(), 9, pose.R.begin());
    result.push_back(pose);
  }
  std::sort(result.begin(), result.end(),
            [](const TrajectoryPose& a, const TrajectoryPose& b) { return a.id < b.id; });
  return result;
}

bool is_planar(const Graph& graph) {
  bool poses = false;
  for (const VariablePool& pool : graph.variable_pools()) {
    if (!has_orientation(*pool.type) || pool.variables.empty()) continue;
    if (pool.type->placement()->dimension() != 2) return false;
    poses = true;
  }
  return poses;
}

bool is_planar(const Trajectory& poses) {
  return std::ranges::all_of(poses, [](const TrajectoryPose& pose) {
    return pose.t[2] == 0.0 && pose.R[8] == 1.0;  // the last is z·z
  });
}

std::vector<double> read_stamps(const std::filesystem::path& file,
                                std::vector<std::string>& notes) {
  const std::string bytes = read_file(file);
  std::vector<double> stamps;
  std::vector<std::string_view> texts;
  std::string_view rest = bytes;
  for (int line = 1; !rest.empty(); ++line) {
    const std::size_t length = std::min(rest.find('\n'), rest.size());
    const std::string_view text = content(rest.substr(0, length));
    rest.remove_prefix(std::min(length + 1, rest.size()));
    if (text.empty()) continue;
    const std::string where = fmt::format("{}:{}", file.string(), line);
    const double stamp = stamp_of(text, where);
    if (!stamps.empty() && stamp < stamps.back()) {
      throw Error(ErrorCode::input, fmt::format("{}: stamp {} after {}; expected rising stamps",
                                                where, stamp, stamps.back()));
    }
    stamps.push_back(stamp);
    texts.push_back(text);
  }
  const StampUnit unit = stamp_unit(stamps);
  if (unit.exponent == 0) return stamps;
  notes.push_back(fmt::format("{}: the stamps are {}, read as seconds", file.string(), unit.name));
  for (std::size_t k = 0; k < stamps.size(); ++k) stamps[k] = seconds_of(texts[k], unit);
  return stamps;
}

Trajectory with_stamps(Trajectory poses, const std::vector<double>& stamps,
                       std::vector<std::string>& notes) {
  assert(poses.size() == stamps.size());
  for (std::size_t k = 0; k < poses.size(); ++k) poses[k].stamp = stamps[k];
  const auto same = std::unique(
      poses.begin(), poses.end(),
      [](const TrajectoryPose& a, const TrajectoryPose& b) { return a.stamp == b.stamp; });
  if (const auto count = poses.end() - same; count > 0) {
    notes.push_back(
        fmt::format("{} the stamp of the pose before: of poses with one stamp the first is kept",
                    count == 1 ? "1 pose has" : fmt::format("{} poses have", count)));
  }
  poses.erase(same, poses.end());
  return poses;
}

Trajectory camera_to_robot_axes(Trajectory poses) {
  const Matrix3d C = robot_to_camera();
  for (TrajectoryPose& pose : poses) {
    Eigen::Map<Matrix3d> R(pose.R.data());
    Eigen::Map<Vector3d> t(pose.t.data());
    R = (C.transpose() * R * C).eval();
    t = (C.transpose() * t).eval();
  }
  return poses;
}

Trajectory with_quaternions_of_order(Trajectory poses, bool w_first) {
  for (TrajectoryPose& pose : poses) {
    Eigen::Map<Matrix3d> R(pose.R.data());
    const Eigen::Quaterniond q{Matrix3d(R)};
    R = (w_first ? Eigen::Quaterniond(q.x(), q.y(), q.z(), q.w())
                 : Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y()))
            .toRotationMatrix();
  }
  return poses;
}

void camera_to_robot_axes(Graph& trajectory) {
  if (trajectory.factor_count() > 0) {
    throw Error(ErrorCode::input,
                "it has factors, which measure in the axes of its poses; axes can be changed of "
                "trajectories alone");
  }
  for (const VariablePool& pool : trajectory.variable_pools()) {
    const VariableType& type = *pool.type;
    if (has_position(type) && type.placement()->dimension() == 2)
      throw Error(ErrorCode::input, "it is of the plane, and a camera's axes are of space");
    if (has_orientation(type) && !is_pose(type)) {
      throw Error(ErrorCode::input,
                  fmt::format("a {} is more than a pose, and axes can be changed of poses alone",
                              type.tag()));
    }
  }
  const Matrix3d C = robot_to_camera();
  for (int v = 0; v < trajectory.variable_count(); ++v) {
    const Placement* placement = trajectory.type(v).placement();
    if (!placement) continue;
    const std::span<const double> state = trajectory.state(v);
    const Pose old = pose_of(*placement, state.data());
    const Matrix3d R = C.transpose() * old.R * C;
    const Vector3d t = C.transpose() * old.t;
    std::vector<double> x(state.begin(), state.end());
    placement->join(R.data(), t.data(), x.data());
    trajectory.set_state(v, x);
  }
}

Trajectory projected_to_plane(Trajectory poses) {
  for (TrajectoryPose& pose : poses) {
    const double yaw = std::atan2(pose.R[1], pose.R[0]);
    const double c = std::cos(yaw), s = std::sin(yaw);
    pose.t[2] = 0.0;
    pose.R = {c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0};
  }
  return poses;
}

}  // namespace cairn
