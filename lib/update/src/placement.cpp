// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/update/placement.hpp"

#include <cstddef>
#include <utility>

#include <Eigen/QR>

namespace cairn {
namespace {

/// Steps of `place_in_part`: two are enough for a relative pose, whose translation follows its
/// rotation; more where the components that are measured depend on those that are not.
constexpr int kSteps = 20;
constexpr double kSmall = 1e-12;  // of a step, beside its numbers

/// The state of another variable of the factor of the same type; null if there is none.
const double* neighbour(const FactorType& type, int target, std::span<const double* const> x) {
  const std::span<const std::string_view> tags = type.variable_tags();
  for (std::size_t k = 0; k < x.size(); ++k) {
    if (static_cast<int>(k) != target && tags[k] == tags[static_cast<std::size_t>(target)])
      return x[k];
  }
  return nullptr;
}

}  // namespace

bool measures_all(const FactorType& type, std::span<const double> sqrt_information) {
  const auto n = static_cast<std::size_t>(type.residual_size());
  std::size_t diagonal = 0;
  for (std::size_t row = 0; row < n; ++row) {
    if (!(sqrt_information[diagonal] > 0.0)) return false;
    diagonal += n - row;
  }
  return true;
}

bool place_wholly(const FactorType& type, std::span<const double> sqrt_information, int target,
                  const double* const* x, const double* z, double* out) {
  return measures_all(type, sqrt_information) && type.propagate(target, x, z, out);
}

bool place_in_part(const FactorType& type, const VariableType& variable,
                   std::span<const double> sqrt_information, int target,
                   std::span<const double* const> x, const double* z, std::vector<double>& state) {
  std::vector<double> moved = state;
  std::vector<const double*> states(x.begin(), x.end());
  states[static_cast<std::size_t>(target)] = moved.data();
  Eigen::VectorXd residual(type.residual_size());
  Eigen::MatrixXd J(type.residual_size(), variable.tangent_size());
  std::vector<double*> jacobians(x.size(), nullptr);
  jacobians[static_cast<std::size_t>(target)] = J.data();
  for (int k = 0; k < kSteps; ++k) {
    type.evaluate(states.data(), z, sqrt_information.data(), residual.data(), jacobians.data());
    if (!residual.allFinite() || !J.allFinite() || J.isZero(0.0)) return false;
    const Eigen::VectorXd step = J.completeOrthogonalDecomposition().solve(-residual);
    const std::int64_t offset = 0;
    variable.retract(1, moved.data(), &offset, step.data(), moved.data());
    if (step.norm() < kSmall) break;
  }
  if (!Eigen::Map<const Eigen::VectorXd>(moved.data(), std::ssize(moved)).allFinite() ||
      !variable.normalize(moved.data()).empty())
    return false;
  state = std::move(moved);
  return true;
}

bool place_beside(const FactorType& type, const VariableType& variable,
                  std::span<const double> sqrt_information, int target,
                  std::span<const double* const> x, const double* z, std::vector<double>& state) {
  std::vector<double> from = state;
  if (!type.propagate(target, x.data(), z, from.data())) return false;
  from = state;
  if (const double* const beside = neighbour(type, target, x))
    from.assign(beside, beside + state.size());
  if (!place_in_part(type, variable, sqrt_information, target, x, z, from)) return false;
  state = std::move(from);
  return true;
}

}  // namespace cairn
