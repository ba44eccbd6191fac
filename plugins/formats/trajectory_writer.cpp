// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <optional>

#include <fmt/core.h>
#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cairn/geometry/pose.hpp"
#include "cairn/graph/id_text.hpp"
#include "line_writer.hpp"
#include "writer_order.hpp"
#include "writers.hpp"

namespace cairn::formats {
namespace {

/// Readers of TUM files take stamps for doubles.
constexpr Id kLargestStamp = Id{1} << 53;

/// The poses by rising id; all else is no part of a trajectory.
std::vector<int> poses_by_id(const Graph& graph, std::string_view format) {
  std::vector<int> poses;
  for (const int v : variables_by_id(graph)) {
    if (has_orientation(graph.type(v))) poses.push_back(v);
  }
  if (poses.empty()) cannot_express(format, "a graph without a pose", "at least one pose");
  return poses;
}

/// A stamp that can be an id as that, so that it is written with all its digits; -1 for any other.
Id whole(double stamp) {
  return stamp >= 0.0 && stamp <= static_cast<double>(kLargestStamp) && stamp == std::floor(stamp)
             ? static_cast<Id>(stamp)
             : -1;
}

/// qx qy qz qw with qw ≥ 0. A spatial pose that is kept as a quaternion is written as it is kept,
/// to the bit.
Eigen::Vector4d quaternion_of(const Graph& graph, int v, const Pose& pose) {
  if (graph.type(v).tag() == "VERTEX_SE3:QUAT") {
    return Eigen::Map<const Eigen::Vector4d>(graph.state(v).data() + 3);
  }
  const Eigen::Quaterniond q(pose.R);
  return q.w() < 0.0 ? Eigen::Vector4d(-q.coeffs()) : Eigen::Vector4d(q.coeffs());
}

}  // namespace

std::string write_tum(const Graph& graph, std::span<const double> stamps) {
  LineWriter out;
  const std::vector<int> poses = poses_by_id(graph, "tum");
  for (std::size_t k = 0; k < poses.size(); ++k) {
    const int v = poses[k];
    const bool timed = stamps.size() == poses.size();
    if (!timed && (graph.id(v) < 0 || graph.id(v) > kLargestStamp)) {
      cannot_express("tum", graph.describe_variable(v),
                     "ids from 0 to 2^53, which a stamp holds exactly");
    }
    const Pose pose = pose_of(graph.type(v), graph.state(v));
    const Eigen::Vector4d q = quaternion_of(graph, v, pose);
    const Id stamp = timed ? whole(stamps[k]) : graph.id(v);
    stamp >= 0 ? out.field(stamp) : out.field(stamps[k]);
    out.fields({pose.t.data(), 3}).fields({q.data(), 4});
    out.end_line();
  }
  return out.take();
}

std::string write_kitti(const Graph& graph, std::span<const double>) {
  LineWriter out;
  Id row = 0;
  for (const int v : poses_by_id(graph, "kitti")) {
    const std::optional<Symbol> symbol = as_symbol(graph.id(v));
    if ((symbol ? symbol->index : graph.id(v)) != row) {
      cannot_express("kitti", fmt::format("{} in row {}", graph.describe_variable(v), row),
                     "poses 0, 1, 2 … or x0, x1, x2 … without a gap, since the row is the id "
                     "(format tum keeps ids)");
    }
    const Pose pose = pose_of(graph.type(v), graph.state(v));
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) out.field(pose.R(i, j));
      out.field(pose.t[i]);
    }
    out.end_line();
    ++row;
  }
  return out.take();
}

}  // namespace cairn::formats
