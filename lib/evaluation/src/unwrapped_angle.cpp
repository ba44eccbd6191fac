// SPDX-License-Identifier: BSD-3-Clause
#include "unwrapped_angle.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <optional>
#include <vector>

#include <fmt/core.h>

namespace cairn {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kBeyond = 1e-6;  // ±π, that an angle must be [rad]
constexpr double kSame = 1e-6;    // two states, or two angles [rad]
constexpr int kSteps = 8;         // of a turn

/// A factor at the graph's states, one of whose variables is moved.
class MovedFactor {
 public:
  MovedFactor(const Graph& graph, int position) : type_(graph.factor_type(position)) {
    for (const std::int32_t v : graph.factor_variables(position)) {
      types_.push_back(&graph.type(v));
      states_.push_back(graph.state(v).data());
    }
    const auto measured = graph.measurement(position);
    measurement_.assign(measured.begin(), measured.end());
    for (int row = 0; row < type_.residual_size(); ++row) {
      identity_.push_back(1.0);
      identity_.insert(identity_.end(), std::size_t(type_.residual_size() - row - 1), 0.0);
    }
  }

  std::size_t variables() const { return types_.size(); }
  int directions(std::size_t variable) const { return types_[variable]->tangent_size(); }

  /// The error, not whitened, where a variable is at x · exp(t e_direction).
  std::vector<double> residual(std::size_t variable, int direction, double t) const {
    const std::vector<double> moved = state(variable, direction, t);
    std::vector<const double*> x = states_;
    x[variable] = moved.data();
    std::vector<double> r(std::size_t(type_.residual_size()));
    type_.evaluate(x.data(), measurement_.data(), identity_.data(), r.data(), nullptr);
    return r;
  }

  /// Whether the variable is back after a full turn, and only then: headings and rotations.
  bool turns(std::size_t variable, int direction) const {
    return distance(variable, state(variable, direction, kTurn)) < kSame &&
           distance(variable, state(variable, direction, 0.5 * kTurn)) > 1.0;
  }

 private:
  std::vector<double> state(std::size_t variable, int direction, double t) const {
    const VariableType& type = *types_[variable];
    std::vector<double> step(std::size_t(type.tangent_size())),
        moved(std::size_t(type.ambient_size()));
    step[std::size_t(direction)] = t;
    const std::int64_t offset = 0;
    type.retract(1, states_[variable], &offset, step.data(), moved.data());
    return moved;
  }
  double distance(std::size_t variable, const std::vector<double>& moved) const {
    std::vector<double> step(std::size_t(types_[variable]->tangent_size()));
    types_[variable]->local(1, states_[variable], moved.data(), step.data());
    double squares = 0.0;
    for (const double s : step) squares += s * s;
    return std::sqrt(squares);
  }

  const FactorType& type_;
  std::vector<const VariableType*> types_;
  std::vector<const double*> states_;
  std::vector<double> measurement_, identity_;
};

/// Whether b − a is the angle, whatever full turns there are beside it.
bool is_turned_by(double a, double b, double angle) {
  return std::abs(std::remainder(b - a - angle, kTurn)) < kSame;
}

/// The row that turns with the variable, if one does that is beyond ±π here.
std::optional<int> turning_row(const MovedFactor& factor, std::size_t variable, int direction) {
  std::vector<double> before = factor.residual(variable, direction, 0.0);
  const std::vector<double> here = before;
  std::vector<bool> with(here.size(), true), against(here.size(), true);
  for (int step = 1; step <= kSteps; ++step) {
    std::vector<double> after = factor.residual(variable, direction, kTurn * step / kSteps);
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
  const MovedFactor factor(graph, position);
  for (std::size_t v = 0; v < factor.variables(); ++v) {
    for (int k = 0; k < factor.directions(v); ++k) {
      if (!factor.turns(v, k)) continue;
      const std::optional<int> row = turning_row(factor, v, k);
      if (!row) continue;
      return fmt::format(
          "{}: its error in row {} is an angle of {:.6g}, which its type should have wrapped to ±π",
          graph.describe_factor(position), *row,
          factor.residual(v, k, 0.0)[static_cast<std::size_t>(*row)]);
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
      if (std::string text = unwrapped_angle(graph, worst); !text.empty()) return text;
    } catch (...) {  // beside the states it may not be defined
    }
  }
  return {};
}

}  // namespace cairn
