// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string_view>

#include "cairn/runtime/component.hpp"

namespace cairn {

/// A robust loss ρ(s) of the squared whitened norm s = ‖r‖², with ρ(s) ≈ s near zero: the cost of a
/// factor is ρ(s), and its weight in the normal equations ρ′(s) (iteratively reweighted least
/// squares).
class CAIRN_API Loss : public Component {
 public:
  static constexpr std::string_view kKind = "loss";
  ~Loss() override;

  /// For each s: rho = ρ(s) and weight = ρ′(s); any of the outputs may be empty. Sizes agree
  /// otherwise.
  virtual void evaluate(std::span<const double> s, std::span<double> rho,
                        std::span<double> weight) const = 0;

  /// ρ″(s), for solvers that use it (Ceres).
  virtual double second_derivative(double s) const = 0;
};

}  // namespace cairn
