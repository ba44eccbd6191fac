// SPDX-License-Identifier: BSD-3-Clause
#include "wrapping_checks.hpp"

#include <cmath>
#include <cstddef>
#include <numbers>
#include <string>
#include <string_view>

#include <fmt/core.h>

#include "factor_samples.hpp"

namespace cairn::conformance {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr std::string_view kLaw = "a residual that is an angle is wrapped to ±π";
constexpr double kSame = 1e-6;      // two states, or an angle and 2π [rad]
constexpr double kUnlikePi = 1e-3;  // of what is beside a jump [rad]
constexpr double kReach = 4.0;      // of lines, beyond most random states
constexpr int kSteps = 180;         // along a turn or a line
constexpr int kHalvings = 50;       // until a step has only the jump in it
constexpr int kFactors = 20;

/// One way to move one variable of a factor: exp(t e_k).
class Walk {
 public:
  Walk(const FactorSamples& type, const FactorSample& sample, std::size_t variable,
       std::size_t direction)
      : type_(type), sample_(sample), variable_(variable), direction_(direction) {
    for (int row = 0; row < type.type().residual_size(); ++row) {
      sample_.U[at_++] = 1.0;
      for (int k = row + 1; k < type.type().residual_size(); ++k) sample_.U[at_++] = 0.0;
    }
    const State there = state(kTurn);
    turns_ = type_.apart(variable_, sample.x[variable_], there) < kSame &&
             type_.apart(variable_, sample.x[variable_], state(0.5 * kTurn)) > 1.0;
  }

  bool turns() const { return turns_; }
  double begin() const { return turns_ ? 0.0 : -kReach; }
  double end() const { return turns_ ? kTurn : kReach; }
  /// The error, not whitened.
  State residual(double t) {
    moved_ = sample_;
    moved_.x[variable_] = state(t);
    return type_.residual(moved_);
  }

  /// In words, a jump that only an angle which is not wrapped has; none: empty.
  std::string jump() {
    State before = residual(begin());
    const State first = before;
    for (int step = 1; step <= kSteps; ++step) {
      const double width = (end() - begin()) / kSteps, t = begin() + step * width;
      State after = residual(t);
      for (std::size_t row = 0; row < after.size(); ++row) {
        if (std::abs(after[row] - before[row]) <= 0.5 * kTurn) continue;
        if (std::string text = jump_within(t - width, t, row); !text.empty()) return text;
      }
      before = std::move(after);
    }
    for (std::size_t row = 0; turns_ && row < first.size(); ++row) {
      if (std::abs(std::abs(before[row] - first[row]) - kTurn) < kSame)
        return fmt::format(
            "row {} is {:.6g}, and after a full turn of variable {} in direction {} "
            "it is {:.6g}",
            row, first[row], variable_, direction_, before[row]);
    }
    return {};
  }

 private:
  State state(double t) const {
    State step(type_.tangent(variable_));
    step[direction_] = t;
    return type_.retract(variable_, sample_.x[variable_], step);
  }

  /// What is steep, and no jump, shrinks with the step.
  std::string jump_within(double low, double high, std::size_t row) {
    double below = residual(low)[row], above = residual(high)[row];
    for (int k = 0; k < kHalvings; ++k) {
      const double middle = 0.5 * (low + high), value = residual(middle)[row];
      const bool in_lower = std::abs(value - below) > std::abs(above - value);
      (in_lower ? high : low) = middle;
      (in_lower ? above : below) = value;
    }
    const bool by_a_turn = std::abs(std::abs(above - below) - kTurn) < kSame;
    if (!by_a_turn || std::abs(above + below) < kUnlikePi) return {};
    return fmt::format(
        "row {} jumps from {:.6g} to {:.6g} where variable {} moves by {:.6g} in "
        "direction {} (wrap_angle in cairn/lie/so2.hpp brings it back to ±π)",
        row, below, above, variable_, low, direction_);
  }

  const FactorSamples& type_;
  FactorSample sample_, moved_;
  std::size_t variable_, direction_, at_ = 0;
  bool turns_ = false;
};

}  // namespace

void check_wrapping(const Subject& subject, Checker& check) {
  int factors = 0;
  for_factors(subject, check, [&](const FactorSamples& type, const FactorSample& sample) {
    if (++factors > kFactors) return;
    for (std::size_t v = 0; v < type.arity(); ++v) {
      for (std::size_t k = 0; k < type.tangent(v); ++k) {
        std::string jump;
        check.without_counting([&] { jump = Walk(type, sample, v, k).jump(); });
        check.expect(jump.empty(), kLaw, [&] { return jump; });
      }
    }
  });
}

}  // namespace cairn::conformance
