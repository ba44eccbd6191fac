// SPDX-License-Identifier: BSD-3-Clause
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/geometry/correlated_pair.hpp"
#include "cairn/geometry/linear_constraint.hpp"
#include "cairn/update/marginal_prior.hpp"
#include "line_writer.hpp"
#include "writer_order.hpp"
#include "writers.hpp"

namespace cairn::formats {
namespace {

/// A factor that g2o writes with the id of a sensor offset after those of its variables, and g2o's
/// tag of it.
struct WithOffset {
  std::string_view tag;
  std::string_view g2o_tag;
};
constexpr WithOffset kWithOffset[] = {{"EDGE_SE3_TRACKXYZ", "EDGE_SE3_TRACKXYZ"},
                                      {"EDGE_PRIOR_SE3:QUAT", "EDGE_SE3_PRIOR"}};

const WithOffset* with_offset(std::string_view tag) {
  for (const WithOffset& entry : kWithOffset) {
    if (entry.tag == tag) return &entry;
  }
  return nullptr;
}

void check_tag(std::string_view tag, const std::string& described) {
  if (tag.empty() || tag.find_first_of(" \t\r\n#") != std::string_view::npos) {
    cannot_express("g2o", described, "a tag of one word");
  }
}

bool needs_offset(const Graph& graph) {
  for (const FactorPool& pool : graph.factor_pools()) {
    if (pool.size() > 0 && with_offset(pool.type->tag())) return true;
  }
  return false;
}

void write_variables(const Graph& graph, LineWriter& out) {
  const std::vector<int> order = variables_by_id(graph);
  for (const int v : order) {
    if (graph.id(v) < 0) cannot_express("g2o", graph.describe_variable(v), "ids from 0");
    check_tag(graph.type(v).tag(), graph.describe_variable(v));
    out.field(graph.type(v).tag()).field(graph.id(v)).fields(graph.state(v));
    out.end_line();
  }
  for (const int v : order) {
    if (!graph.fixed(v)) continue;
    out.field("FIX").field(graph.id(v));
    out.end_line();
  }
}

void write_factor(const Graph& graph, int position, LineWriter& out) {
  const std::string_view tag = graph.factor_type(position).tag();
  if (tag == MarginalPrior::kTag) {
    cannot_express("g2o", graph.describe_factor(position),
                   "a graph without what marginalization left (a trajectory format such as tum "
                   "writes the poses alone)");
  }
  if (tag == CorrelatedPair::kTag) {
    cannot_express("g2o", graph.describe_factor(position),
                   "a graph without correlated pairs, which exist in memory only");
  }
  if (tag == LinearConstraint::kTag) {
    cannot_express("g2o", graph.describe_factor(position),
                   "a graph without linear constraints, which exist in memory only");
  }
  check_tag(tag, graph.describe_factor(position));
  const WithOffset* offset = with_offset(tag);
  out.field(offset ? offset->g2o_tag : tag);
  for (const int v : graph.factor_variables(position)) out.field(graph.id(v));
  if (offset) out.field(std::int64_t{0});
  out.fields(graph.measurement(position)).fields(graph.information(position));
  out.end_line();
}

}  // namespace

std::string write_g2o(const Graph& graph) {
  LineWriter out;
  if (needs_offset(graph)) {
    out.field("PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1");
    out.end_line();
  }
  write_variables(graph, out);
  for (int f = 0; f < graph.factor_count(); ++f) write_factor(graph, f, out);
  return out.take();
}

}  // namespace cairn::formats
