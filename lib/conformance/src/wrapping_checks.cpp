// SPDX-License-Identifier: BSD-3-Clause
#include "wrapping_checks.hpp"

#include <cstddef>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>

#include <fmt/core.h>

#include "cairn/evaluation/check_wrapping.hpp"
#include "factor_samples.hpp"

namespace cairn::conformance {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr std::string_view kLaw = "a residual that is an angle is wrapped to ±π";
constexpr double kSame = 1e-6;  // two states
constexpr double kReach = 4.0;  // of lines, beyond most random states
constexpr int kFactors = 20;

/// One way to move one variable of a factor: exp(t e_k).
class Walk {
 public:
  Walk(const FactorSamples& type, const FactorSample& sample, std::size_t variable,
       std::size_t direction)
      : type_(type), sample_(sample), variable_(variable), direction_(direction) {
    std::size_t at = 0;
    for (int row = 0; row < type.type().residual_size(); ++row) {
      sample_.U[at++] = 1.0;
      for (int k = row + 1; k < type.type().residual_size(); ++k) sample_.U[at++] = 0.0;
    }
    const State there = state(kTurn);
    turns_ = type_.apart(variable_, sample.x[variable_], there) < kSame &&
             type_.apart(variable_, sample.x[variable_], state(0.5 * kTurn)) > 1.0;
  }

  /// In words, a jump that only an angle which is not wrapped has; none: empty.
  std::string jump() {
    const std::optional<AngleJump> jump =
        find_angle_jump([this](double t) { return residual(t); }, turns_ ? 0.0 : -kReach,
                        turns_ ? kTurn : kReach, turns_);
    if (!jump) return {};
    return to_text({static_cast<int>(variable_), static_cast<int>(direction_), *jump}) +
           " (wrap_angle in cairn/lie/so2.hpp brings it back to ±π)";
  }

 private:
  /// The error, not whitened.
  State residual(double t) {
    moved_ = sample_;
    moved_.x[variable_] = state(t);
    return type_.residual(moved_);
  }
  State state(double t) const {
    State step(type_.tangent(variable_));
    step[direction_] = t;
    return type_.retract(variable_, sample_.x[variable_], step);
  }

  const FactorSamples& type_;
  FactorSample sample_, moved_;
  std::size_t variable_, direction_;
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
