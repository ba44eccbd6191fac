// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "cairn/types/factor_type.hpp"
#include "cairn/types/variable_type.hpp"

namespace cairn {

/// What `check_factor` found: the entry of the Jacobians that is furthest off.
struct FactorCheck {
  /// |claimed − numeric| relative to the largest entry of the Jacobians, at least to 1.
  double largest_deviation = 0.0;
  /// Column −1: not the Jacobian but the residual itself, which differs with and without Jacobians.
  int variable = 0, row = 0, column = 0;
  double claimed = 0.0, numeric = 0.0;
};

/// Verifies the Jacobians of any factor type: compares those of `evaluate` with differences
/// of its residual along `retract` of its variables, dr/dδ ≈ (8 (r(h) − r(−h)) − (r(2h) − r(−2h)))
/// / 12h. A right factor deviates by some 1e-9 with the default step; a wrong sign or a missing
/// term by 1e-2 or more.
///
/// `variables`: the types, in the order of the factor. `x`: their states. `sqrt_information`:
/// packed as in FactorView; leave it empty for the identity. `step`: h, in units of the tangent. A
/// residual with a cut (a wrapped angle) must not cross it within 2h.
///
///     EXPECT_LT(check_factor(*type, variables, states, z).largest_deviation, 1e-7);
inline FactorCheck check_factor(const FactorType& type,
                                std::span<const VariableType* const> variables,
                                std::span<const double* const> x,
                                std::span<const double> measurement,
                                std::span<const double> sqrt_information = {}, double step = 1e-4) {
  const int size = type.residual_size();
  std::vector<double> whitening(sqrt_information.begin(), sqrt_information.end());
  if (whitening.empty()) {
    for (int row = 0; row < size; ++row) {
      whitening.push_back(1.0);
      whitening.insert(whitening.end(), size - row - 1, 0.0);
    }
  }

  std::vector<std::vector<double>> claimed(type.arity());
  std::vector<double*> jacobians(type.arity());
  for (int v = 0; v < type.arity(); ++v) {
    claimed[v].resize(static_cast<std::size_t>(size) * type.tangent_size(v));
    jacobians[v] = claimed[v].data();
  }
  std::vector<double> residual(size);
  type.evaluate(x.data(), measurement.data(), whitening.data(), residual.data(), jacobians.data());
  double scale = 1.0;
  for (const auto& J : claimed) {
    for (const double entry : J) scale = std::max(scale, std::abs(entry));
  }

  FactorCheck worst;
  const auto compare = [&](int variable, int row, int column, double entry, double numeric) {
    const double deviation = std::abs(entry - numeric) / scale;
    if (std::isnan(worst.largest_deviation)) return;
    if (deviation > worst.largest_deviation || std::isnan(deviation)) {
      worst = {deviation, variable, row, column, entry, numeric};
    }
  };
  std::vector<double> alone(size);
  type.evaluate(x.data(), measurement.data(), whitening.data(), alone.data(), nullptr);
  for (int row = 0; row < size; ++row) compare(0, row, -1, residual[row], alone[row]);

  for (int v = 0; v < type.arity(); ++v) {
    std::vector<double> delta(type.tangent_size(v)), moved(type.ambient_size(v));
    std::vector<const double*> states(x.begin(), x.end());
    states[v] = moved.data();
    const auto residual_at = [&](int column, double h) {
      const std::int64_t offset = 0;
      delta[column] = h;
      variables[v]->retract(1, x[v], &offset, delta.data(), moved.data());
      delta[column] = 0.0;
      std::vector<double> r(size);
      type.evaluate(states.data(), measurement.data(), whitening.data(), r.data(), nullptr);
      return r;
    };
    for (int column = 0; column < type.tangent_size(v); ++column) {
      const auto near_plus = residual_at(column, step), near_minus = residual_at(column, -step);
      const auto far_plus = residual_at(column, 2 * step),
                 far_minus = residual_at(column, -2 * step);
      for (int row = 0; row < size; ++row) {
        const double numeric =
            (8.0 * (near_plus[row] - near_minus[row]) - (far_plus[row] - far_minus[row])) /
            (12.0 * step);
        compare(v, row, column, claimed[v][static_cast<std::size_t>(column) * size + row], numeric);
      }
    }
  }
  return worst;
}

}  // namespace cairn
