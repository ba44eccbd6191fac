// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "cairn/graph/update.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/enum_names.hpp"
#include "cairn/types/factor_type.hpp"
#include "cairn/types/variable_type.hpp"

namespace cairn {

/// A relative pose with covariance: z · exp(ξ), ξ ~ N(0, Σ).
struct Motion {
  std::vector<double> mean;        ///< z, ambient_size doubles
  std::vector<double> covariance;  ///< Σ, tangent × tangent, column-major
};

/// To which order in ξ the covariance of a composition is computed.
enum class CompositionOrder {
  first,   ///< Smith and Cheeseman 1986: Jacobians
  fourth,  ///< Barfoot and Furgale 2014: Baker-Campbell-Hausdorff (BCH) to fourth order
};
constexpr auto enum_names(CompositionOrder) {
  return std::to_array<EnumName<CompositionOrder>>(
      {{CompositionOrder::first, "first"}, {CompositionOrder::fourth, "fourth"}});
}

/// Arithmetic with relative poses with covariance on any Lie group (the ability `LieGroup` of a
/// variable type). Perturbations are on the right throughout, as in `VariableType::retract`.
/// Relative poses that are combined must be independent of each other.
class CAIRN_API MotionGroup {
 public:
  /// Throws `Error` (usage) if the type's states form no Lie group.
  explicit MotionGroup(std::shared_ptr<const VariableType> type);

  const VariableType& type() const { return *type_; }
  int ambient_size() const { return ambient_; }
  int tangent_size() const { return tangent_; }

  /// The identity, with zero covariance.
  Motion identity() const;
  /// First a, then b: mean z_a z_b. First order: Σ = A Σ_a Aᵀ + Σ_b with A = Ad(z_b⁻¹). Fourth
  /// order, with Σ₁ = A Σ_a Aᵀ, Σ₂ = Σ_b and ad the derivative of Ad at the identity:
  ///
  ///     Σ = Σ₁ + Σ₂ + ¼ E[ad(ξ₁) Σ₂ ad(ξ₁)ᵀ]
  ///         + 1/12 (P₁ Σ₂ + Σ₂ P₁ᵀ + P₂ Σ₁ + Σ₁ P₂ᵀ),   P_k = E[ad(ξ_k) ad(ξ_k)]
  ///
  /// (Barfoot and Furgale, Associating uncertainty with three-dimensional poses, TRO 2014,
  /// with perturbations on the other side.) E[ξ] is zero to third order, and is left so.
  Motion compose(const Motion& a, const Motion& b,
                 CompositionOrder order = CompositionOrder::first) const;
  /// Backwards: mean z⁻¹, Σ = Ad(z) Σ Ad(z)ᵀ, which is exact.
  Motion inverse(const Motion& a) const;
  /// Two independent measurements of one relative pose, fused: the likeliest z, which has the least
  /// ‖log(z_a⁻¹ z)‖² + ‖log(z_b⁻¹ z)‖² (Mahalanobis), and the sum of their information there. A
  /// graph with both as factors has the same minimum, and the result does not depend on their
  /// order. Throws `Error` (numerical) if a covariance is not positive definite.
  Motion fuse(const Motion& a, const Motion& b) const;

  /// The measurement of a relative factor (`FactorType::is_relative`), as a relative pose from its
  /// first variable to its second. The covariance is that of ξ to first order, whatever the
  /// factor's error metric: Σ⁻¹ = DᵀΩD with D = ∂error/∂ξ where the error is zero. Throws `Error`
  /// (usage) for another factor, (input) for numbers that a graph would not take either.
  Motion of_factor(const FactorType& type, std::span<const double> measurement,
                   std::span<const double> information) const;
  /// The same from variable `from`, which may be the factor's second.
  Motion of_factor(const Factor& factor, Id from) const;
  /// The inverse: a factor of that type with this measurement and information. Throws `Error`
  /// (numerical) if the covariance is not positive definite.
  Factor to_factor(std::shared_ptr<const FactorType> type, Id from, Id to,
                   const Motion& motion) const;

 private:
  /// of_factor with what messages call the factor.
  Motion measured(const FactorType& type, std::span<const double> measurement,
                  std::span<const double> information, const std::string& name) const;
  std::vector<double> of_error_metric(const FactorType& type, std::span<const double> z) const;

  std::shared_ptr<const VariableType> type_;
  const LieGroup* group_;
  int ambient_, tangent_;
  std::vector<double> ad_;  ///< ad(e_k) of each unit vector, one after the other
};

}  // namespace cairn
