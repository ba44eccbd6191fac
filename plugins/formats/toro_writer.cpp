// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <string>

#include "euler_angles.hpp"
#include "information.hpp"
#include "line_writer.hpp"
#include "writer_order.hpp"
#include "writers.hpp"

namespace cairn::formats {
namespace {

constexpr std::string_view kExpected =
    "a pose graph in the plane (VERTEX_SE2, EDGE_SE2) or in space (VERTEX_SE3:QUAT, EDGE_SE3:QUAT) "
    "with ids from 0";

void write_pose_of_angles(std::span<const double> pose, LineWriter& out) {
  out.fields(pose.first(3)).fields(angles_from(pose.subspan<3, 4>()));
}

void write_vertices(const Graph& graph, LineWriter& out) {
  const std::vector<int> order = variables_by_id(graph);
  for (const int v : order) {
    const std::string_view tag = graph.type(v).tag();
    const bool in_space = tag == "VERTEX_SE3:QUAT";
    if ((tag != "VERTEX_SE2" && !in_space) || graph.id(v) < 0) {
      cannot_express("toro", graph.describe_variable(v), kExpected);
    }
    out.field(in_space ? "VERTEX3" : "VERTEX2").field(graph.id(v));
    in_space ? write_pose_of_angles(graph.state(v), out) : void(out.fields(graph.state(v)));
    out.end_line();
  }
  // Not TORO's own, but its readers pass over lines that they don't know, and ours keeps it.
  for (const int v : order) {
    if (!graph.fixed(v)) continue;
    out.field("FIX").field(graph.id(v));
    out.end_line();
  }
}

void write_edge(const Graph& graph, int position, LineWriter& out) {
  const std::string_view tag = graph.factor_type(position).tag();
  const bool in_space = tag == "EDGE_SE3:QUAT";
  if (tag != "EDGE_SE2" && !in_space) {
    cannot_express("toro", graph.describe_factor(position), kExpected);
  }
  out.field(in_space ? "EDGE3" : "EDGE2");
  for (const int v : graph.factor_variables(position)) out.field(graph.id(v));
  if (in_space) {
    write_pose_of_angles(graph.measurement(position), out);
    out.fields(graph.information(position));
  } else {
    std::array<double, 6> information;
    std::ranges::copy(graph.information(position), information.begin());
    to_toro_order(information);
    out.fields(graph.measurement(position)).fields(information);
  }
  out.end_line();
}

}  // namespace

std::string write_toro(const Graph& graph) {
  LineWriter out;
  write_vertices(graph, out);
  for (int f = 0; f < graph.factor_count(); ++f) write_edge(graph, f, out);
  return out.take();
}

}  // namespace cairn::formats
