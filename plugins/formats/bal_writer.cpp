// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "bal_camera.hpp"
#include "line_writer.hpp"
#include "writer_order.hpp"
#include "writers.hpp"

namespace cairn::formats {
namespace {

constexpr std::string_view kExpected =
    "cameras (VERTEX_CAMERA_BAL), points (VERTEX_TRACKXYZ) and observations (EDGE_PROJECT_BAL) "
    "whose information is 1 0 1, none of them fixed";

/// Cameras and points by rising id, and the number of each within its kind by variable.
struct Numbering {
  std::vector<int> cameras, points;
  std::vector<std::int64_t> number;
};

Numbering number_variables(const Graph& graph) {
  Numbering n;
  n.number.resize(static_cast<std::size_t>(graph.variable_count()));
  for (const int v : variables_by_id(graph)) {
    const std::string_view tag = graph.type(v).tag();
    const bool camera = tag == "VERTEX_CAMERA_BAL";
    if ((!camera && tag != "VERTEX_TRACKXYZ") || graph.fixed(v)) {
      cannot_express("bal", (graph.fixed(v) ? "FIX of " : "") + graph.describe_variable(v),
                     kExpected);
    }
    std::vector<int>& kind = camera ? n.cameras : n.points;
    n.number[v] = static_cast<std::int64_t>(kind.size());
    kind.push_back(v);
  }
  return n;
}

void write_observation(const Graph& graph, int position, const Numbering& n, LineWriter& out) {
  constexpr std::array<double, 3> kUnit{1.0, 0.0, 1.0};
  if (graph.factor_type(position).tag() != "EDGE_PROJECT_BAL") {
    cannot_express("bal", graph.describe_factor(position), kExpected);
  }
  if (!std::ranges::equal(graph.information(position), kUnit)) {
    cannot_express("bal", "the information of " + graph.describe_factor(position), kExpected);
  }
  for (const int v : graph.factor_variables(position)) out.field(n.number[v]);
  out.fields(graph.measurement(position));
  out.end_line();
}

void write_column(std::span<const double> numbers, LineWriter& out) {
  for (const double number : numbers) {
    out.field(number);
    out.end_line();
  }
}

}  // namespace

std::string write_bal(const Graph& graph) {
  const Numbering n = number_variables(graph);
  LineWriter out;
  out.field(std::ssize(n.cameras))
      .field(std::ssize(n.points))
      .field(std::int64_t{graph.factor_count()});
  out.end_line();
  for (int f = 0; f < graph.factor_count(); ++f) write_observation(graph, f, n, out);
  for (const int v : n.cameras) write_column(from_state(graph.state(v)), out);
  for (const int v : n.points) write_column(graph.state(v), out);
  return out.take();
}

}  // namespace cairn::formats
