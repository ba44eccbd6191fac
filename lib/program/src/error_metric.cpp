// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/error_metric.hpp"

#include <algorithm>
#include <set>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "cairn/plugin/registry.hpp"

namespace cairn::app {
namespace {

/// The default of `slam3d`, and what it was before.
constexpr std::string_view kDefault = "rotation_vector";
constexpr std::string_view kFormer = "logarithm: --types slam3d:metric=logarithm";

bool is_chosen(const Session& session) {
  return std::ranges::any_of(session.common.types, [](const std::string& types) {
    return parse_component(types).values.contains("metric");
  });
}

}  // namespace

std::string metric_of(const Graph& graph) {
  std::set<std::string> metrics;
  for (const FactorPool& pool : graph.factor_pools()) {
    if (pool.size() > 0 && !pool.type->metric().empty()) metrics.emplace(pool.type->metric());
  }
  return fmt::format("{}", fmt::join(metrics, ", "));
}

void add_metric(Table& table, const Graph& graph, const Session& session) {
  const std::string metric = metric_of(graph);
  if (metric.empty()) return;
  table.add({"metric", metric == kDefault && !is_chosen(session)
                           ? fmt::format("{} (default; formerly {})", metric, kFormer)
                           : metric});
}

}  // namespace cairn::app
