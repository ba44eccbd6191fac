// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/check_wrapping.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <utility>

#include <fmt/core.h>

#include "cairn/io/random_numbers.hpp"
#include "cairn/runtime/error.hpp"
#include "moved_factor.hpp"

namespace cairn {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kSame = 1e-6;      // an angle and 2π [rad]
constexpr double kUnlikePi = 1e-3;  // of what is beside a jump [rad]
constexpr int kSteps = 180;         // along a turn or a line
constexpr int kHalvings = 50;       // until a step has only the jump in it
constexpr int kStarts = 12;         // of which the first is that of the states given
constexpr double kReach = 4.0;      // of lines, beyond the largest number of the states
constexpr double kMeasured = 2.0;   // by which measurements are changed

/// What is steep, and no jump, shrinks with the step.
std::optional<AngleJump> jump_within(const ErrorsAlong& errors, double low, double high, int row) {
  const auto at = [&](double t) { return errors(t)[static_cast<std::size_t>(row)]; };
  double below = at(low), above = at(high);
  for (int k = 0; k < kHalvings; ++k) {
    const double middle = 0.5 * (low + high), value = at(middle);
    const bool in_lower = std::abs(value - below) > std::abs(above - value);
    (in_lower ? high : low) = middle;
    (in_lower ? above : below) = value;
  }
  const bool by_a_turn = std::abs(std::abs(above - below) - kTurn) < kSame;
  if (!by_a_turn || std::abs(above + below) < kUnlikePi) return std::nullopt;
  return AngleJump{.row = row, .before = below, .after = above, .moved = low, .of_a_turn = false};
}

}  // namespace

std::optional<AngleJump> find_angle_jump(const ErrorsAlong& errors, double begin, double end,
                                         bool turn) {
  std::vector<double> before = errors(begin);
  const std::vector<double> first = before;
  const double width = (end - begin) / kSteps;
  for (int step = 1; step <= kSteps; ++step) {
    const double t = begin + step * width;
    std::vector<double> after = errors(t);
    for (std::size_t row = 0; row < after.size(); ++row) {
      if (!(std::abs(after[row] - before[row]) > 0.5 * kTurn)) continue;
      if (const auto jump = jump_within(errors, t - width, t, static_cast<int>(row))) return jump;
    }
    before = std::move(after);
  }
  for (std::size_t row = 0; turn && row < first.size(); ++row) {
    const bool by_a_turn = std::abs(std::abs(before[row] - first[row]) - kTurn) < kSame;
    if (by_a_turn && std::abs(before[row] + first[row]) > kUnlikePi)  // not from −π to π
      return AngleJump{static_cast<int>(row), first[row], before[row], end, true};
  }
  return std::nullopt;
}

std::optional<UnwrappedAngle> find_unwrapped_angle(const FactorType& type,
                                                   std::span<const VariableType* const> variables,
                                                   std::span<const double* const> x,
                                                   std::span<const double> measurement) {
  std::vector<std::vector<double>> given;
  double reach = kReach;
  for (std::size_t v = 0; v < variables.size(); ++v) {
    given.emplace_back(x[v], x[v] + variables[v]->ambient_size());
    for (const double number : given.back()) reach = std::max(reach, kReach + std::abs(number));
  }
  RandomNumbers random(RandomNumbers::mixed(1));
  for (int start = 0; start < kStarts; ++start) {
    std::vector<std::vector<double>> states = given;
    std::vector<double> z(measurement.begin(), measurement.end());
    for (std::size_t v = 0; start > 0 && v < variables.size(); ++v) {
      std::vector<double> step(std::size_t(variables[v]->tangent_size()));
      for (double& s : step) s = random.uniform(-reach, reach);
      const std::int64_t offset = 0;
      variables[v]->retract(1, given[v].data(), &offset, step.data(), states[v].data());
    }
    if (start % 2 == 1) {
      for (double& number : z) number += random.uniform(-kMeasured, kMeasured);
      if (!type.normalize(z.data()).empty()) continue;
    }
    std::vector<const double*> from;
    for (const std::vector<double>& state : states) from.push_back(state.data());
    MovedFactor factor(type, variables, std::move(from), z);
    for (std::size_t v = 0; v < factor.variables(); ++v) {
      for (int k = 0; k < factor.directions(v); ++k) {
        try {
          const bool turn = factor.turns(v, k);
          const auto jump = find_angle_jump([&](double t) { return factor.error(v, k, t); },
                                            turn ? 0.0 : -reach, turn ? kTurn : reach, turn);
          if (jump) return UnwrappedAngle{static_cast<int>(v), k, *jump};
        } catch (const Error&) {  // it is not defined there
        }
      }
    }
  }
  return std::nullopt;
}

std::string to_text(const UnwrappedAngle& angle) {
  const AngleJump& jump = angle.jump;
  if (jump.of_a_turn) {
    return fmt::format(
        "row {} is {:.6g}, and after a full turn of variable {} in direction {} it is {:.6g}",
        jump.row, jump.before, angle.variable, angle.direction, jump.after);
  }
  return fmt::format(
      "row {} jumps from {:.6g} to {:.6g} where variable {} moves by {:.6g} in "
      "direction {}",
      jump.row, jump.before, jump.after, angle.variable, jump.moved, angle.direction);
}

}  // namespace cairn
