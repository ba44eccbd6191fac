// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/trajectory.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string>
#include <string_view>

#include <fmt/core.h>
#include <Eigen/Core>

#include "cairn/geometry/pose.hpp"
#include "cairn/io/format.hpp"
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

std::vector<double> read_stamps(const std::filesystem::path& file) {
  const std::string bytes = read_file(file);
  std::vector<double> stamps;
  std::string_view rest = bytes;
  for (int line = 1; !rest.empty(); ++line) {
    const std::size_t length = std::min(rest.find('\n'), rest.size());
    const std::string_view text = content(rest.substr(0, length));
    rest.remove_prefix(std::min(length + 1, rest.size()));
    if (text.empty()) continue;
    const std::string where = fmt::format("{}:{}", file.string(), line);
    const double stamp = stamp_of(text, where);
    if (!stamps.empty() && !(stamp > stamps.back())) {
      throw Error(ErrorCode::input, fmt::format("{}: stamp {} after {}; expected rising stamps",
                                                where, stamp, stamps.back()));
    }
    stamps.push_back(stamp);
  }
  return stamps;
}

Trajectory camera_to_robot_axes(Trajectory poses) {
  const Matrix3d C{{0, -1, 0}, {0, 0, -1}, {1, 0, 0}};
  for (TrajectoryPose& pose : poses) {
    Eigen::Map<Matrix3d> R(pose.R.data());
    Eigen::Map<Vector3d> t(pose.t.data());
    R = (C.transpose() * R * C).eval();
    t = (C.transpose() * t).eval();
  }
  return poses;
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
