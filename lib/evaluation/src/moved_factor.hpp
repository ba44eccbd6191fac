// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include "cairn/types/factor_type.hpp"
#include "cairn/types/variable_type.hpp"

namespace cairn {

/// A factor one of whose variables is moved from its state x to x · exp(t e_direction), while the
/// others stay. What it is given must outlive it.
class MovedFactor {
 public:
  MovedFactor(const FactorType& type, std::span<const VariableType* const> variables,
              std::vector<const double*> states, std::span<const double> measurement)
      : type_(type),
        variables_(variables),
        from_(std::move(states)),
        x_(from_),
        measurement_(measurement) {
    for (int row = 0; row < type.residual_size(); ++row) {
      identity_.push_back(1.0);
      identity_.insert(identity_.end(), std::size_t(type.residual_size() - row - 1), 0.0);
    }
  }

  std::size_t variables() const { return variables_.size(); }
  int directions(std::size_t variable) const { return variables_[variable]->tangent_size(); }

  /// The error, not whitened.
  std::vector<double> error(std::size_t variable, int direction, double t) {
    move(variable, direction, t);
    std::vector<double> r(std::size_t(type_.residual_size()));
    x_ = from_;
    x_[variable] = moved_.data();
    type_.evaluate(x_.data(), measurement_.data(), identity_.data(), r.data(), nullptr);
    return r;
  }
  /// Whether the variable is back after a full turn, and only then: headings and rotations.
  bool turns(std::size_t variable, int direction) {
    constexpr double kTurn = 2.0 * std::numbers::pi, kSame = 1e-6;  // [rad]
    return distance(variable, direction, kTurn) < kSame &&
           distance(variable, direction, 0.5 * kTurn) > 1.0;
  }

 private:
  void move(std::size_t variable, int direction, double t) {
    const VariableType& type = *variables_[variable];
    step_.assign(std::size_t(type.tangent_size()), 0.0);
    step_[std::size_t(direction)] = t;
    moved_.resize(std::size_t(type.ambient_size()));
    const std::int64_t offset = 0;
    type.retract(1, from_[variable], &offset, step_.data(), moved_.data());
  }
  double distance(std::size_t variable, int direction, double t) {
    move(variable, direction, t);
    variables_[variable]->local(1, from_[variable], moved_.data(), step_.data());
    double squares = 0.0;
    for (const double s : step_) squares += s * s;
    return std::sqrt(squares);
  }

  const FactorType& type_;
  std::span<const VariableType* const> variables_;
  std::vector<const double*> from_, x_;
  std::span<const double> measurement_;
  std::vector<double> identity_, moved_, step_;
};

}  // namespace cairn
