// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/typed/print.hpp"

#include <algorithm>
#include <span>
#include <vector>

#include <fmt/format.h>

#include "cairn/typed/symbol.hpp"

namespace cairn {
namespace {

/// "4 variables (3 VERTEX_SE2, 1 VERTEX_XY)"
template <class Pools, class Size>
std::string counts(int all, const char* what, const Pools& pools, Size size) {
  std::vector<std::string> kinds;
  for (const auto& pool : pools) {
    if (size(pool) > 0) kinds.push_back(fmt::format("{} {}", size(pool), pool.type->tag()));
  }
  std::string text = fmt::format("{} {}{}", all, what, all == 1 ? "" : "s");
  return kinds.empty() ? text : fmt::format("{} ({})", text, fmt::join(kinds, ", "));
}

std::string numbers(std::span<const double> values) {
  std::string text;
  for (const double value : values) text += fmt::format(" {:.6g}", value + 0.0);  // no −0
  return text;
}

std::string more(int count, int lines) {
  return count > lines ? fmt::format("  ... {} more\n", count - lines) : std::string();
}

}  // namespace

std::string to_string(const Graph& graph, int lines) {
  std::string text = counts(graph.variable_count(), "variable", graph.variable_pools(),
                            [](const VariablePool& pool) { return pool.variables.size(); });
  text += ", " + counts(graph.factor_count(), "factor", graph.factor_pools(),
                        [](const FactorPool& pool) { return pool.size(); });
  text += "\n";
  for (int v = 0; v < std::min(lines, graph.variable_count()); ++v) {
    text += fmt::format("  {} {}:{}{}\n", graph.type(v).tag(), id_text(graph.id(v)),
                        numbers(graph.state(v)), graph.fixed(v) ? "  (fixed)" : "");
  }
  text += more(graph.variable_count(), lines);
  for (int f = 0; f < std::min(lines, graph.factor_count()); ++f) {
    std::string ids;
    for (const int v : graph.factor_variables(f)) ids += " " + id_text(graph.id(v));
    const FactorType& type = graph.factor_type(f);
    text += fmt::format("  {}{}:{}\n", type.tag(), ids, numbers(graph.measurement(f)));
  }
  return text + more(graph.factor_count(), lines);
}

std::string to_string(const Summary& summary) {
  const std::size_t count = summary.iterations.size();
  std::string text =
      fmt::format("{}: chi2 {:.6g} -> {:.6g} in {} iteration{} ({:.3g} s)\n",
                  to_string(summary.status), summary.initial_chi2, summary.final_chi2, count,
                  count == 1 ? "" : "s", summary.seconds.total);
  for (const std::string& note : summary.notes) text += fmt::format("  {}\n", note);
  return text;
}

}  // namespace cairn
