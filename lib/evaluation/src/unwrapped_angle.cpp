// SPDX-License-Identifier: BSD-3-Clause
#include "unwrapped_angle.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "moved_factor.hpp"

namespace cairn {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kBeyond = 1e-6;  // ±π, that an angle must be [rad]
constexpr double kSame = 1e-6;    // two angles [rad]
constexpr int kSteps = 8;         // of a turn

/// Whether b − a is the angle, whatever full turns there are beside it.
bool is_turned_by(double a, double b, double angle) {
  return std::abs(std::remainder(b - a - angle, kTurn)) < kSame;
}

/// The row that turns with the variable, if one does that is beyond ±π here.
std::optional<int> turning_row(MovedFactor& factor, std::size_t variable, int direction) {
  std::vector<double> before = factor.error(variable, direction, 0.0);
  const std::vector<double> here = before;
  std::vector<bool> with(here.size(), true), against(here.size(), true);
  for (int step = 1; step <= kSteps; ++step) {
    std::vector<double> after = factor.error(variable, direction, kTurn * step / kSteps);
    for (std::size_t row = 0; row < after.size(); ++row) {
      with[row] = with[row] && is_turned_by(before[row], after[row], kTurn / kSteps);
      against[row] = against[row] && is_turned_by(before[row], after[row], -kTurn / kSteps);
    }
    before = std::move(after);
  }
  for (std::size_t row = 0; row < here.size(); ++row)
    if ((with[row] || against[row]) && std::abs(here[row]) > std::numbers::pi + kBeyond)
      return static_cast<int>(row);
  return std::nullopt;
}

std::string unwrapped_angle(const Graph& graph, int position) {
  std::vector<const VariableType*> types;
  std::vector<const double*> states;
  for (const std::int32_t v : graph.factor_variables(position)) {
    types.push_back(&graph.type(v));
    states.push_back(graph.state(v).data());
  }
  MovedFactor factor(graph.factor_type(position), types, std::move(states),
                     graph.measurement(position));
  for (std::size_t v = 0; v < factor.variables(); ++v) {
    for (int k = 0; k < factor.directions(v); ++k) {
      if (!factor.turns(v, k)) continue;
      const std::optional<int> row = turning_row(factor, v, k);
      if (!row) continue;
      return fmt::format(
          "{}: its error in row {} is an angle of {:.6g}, which its type should have wrapped to ±π",
          graph.describe_factor(position), *row,
          factor.error(v, k, 0.0)[static_cast<std::size_t>(*row)]);
    }
  }
  return {};
}

}  // namespace

std::string unwrapped_angle(const Graph& graph) {
  const std::vector<double> norms = squared_norms(graph);
  for (const FactorPool& pool : graph.factor_pools()) {
    if (pool.sequence.empty()) continue;
    int worst = pool.sequence.front();
    for (const int position : pool.sequence)
      if (norms[std::size_t(position)] > norms[std::size_t(worst)]) worst = position;
    try {
      std::string text = call_plugin([&] { return fmt::format("factor '{}'", pool.type->tag()); },
                                     [&] { return unwrapped_angle(graph, worst); });
      if (!text.empty()) return text;
    } catch (const Error&) {  // beside the states it may not be defined
    }
  }
  return {};
}

}  // namespace cairn
