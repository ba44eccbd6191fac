// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <span>
#include <string_view>
#include <vector>

#include "cairn/runtime/api.hpp"
#include "cairn/runtime/enum_names.hpp"
#include "cairn/sparsification/blanket.hpp"
#include "cairn/sparsification/interruptible.hpp"

// (T n) is equation or section n of the thesis that sparsification.hpp names.

namespace cairn {

/// The information matrices Ω_k ≻ 0 of a topology's factors are sought that minimise
///
///     KLD = ½ (tr Λ̆ − ln |Λ̆| − r),   Λ̆ = Σ_k J_kᵀ Ω_k J_k
///
/// (T 4.2), in r coordinates in which the dense Gaussian is N(0, I): the projection (T 4.3),
/// scaled. With a `background` R, information that stays whatever the factors are, it is Λ̆ = R +
/// Σ_k J_kᵀ Ω_k J_k.
struct RecoveryProblem {
  struct Factor {
    int size = 0;                  ///< m
    std::vector<double> jacobian;  ///< J_k, m × r, of full rank
    /// Where `basis` is given: J_k = A T(columns, ·), A m × columns. What a factor measures are a
    /// few columns of T's rows, and with these the steps of factor descent are cheap.
    std::vector<int> columns{};
    std::vector<double> in_columns{};  ///< A
    /// J_a⁻ᵀ Λ_ab J_b⁻¹ (T 4.8) with the two nodes' blocks; not symmetric in general. Empty: not
    /// defined.
    std::vector<double> off_diagonal;
  };
  int rank = 0;  ///< r
  std::vector<Factor> factors;
  std::vector<double> basis{};  ///< T, d × r, column-major; may be empty
  /// R ⪰ 0, r × r; empty: zero. Methods that do not solve problems with one refuse it
  /// (`FactorRecovery::takes_background`).
  std::vector<double> background{};
};

/// How coordinates are chosen in which the dense Gaussian has a covariance (T 4.3).
enum class Projection {
  eigen,  ///< those of the eigenvectors of Λ whose eigenvalues are not zero
  node,   ///< relative to the blanket's first node, which must be all that Λ leaves open; of an
          ///< absolute blanket, which must leave nothing open, those of the nodes
};
constexpr auto enum_names(Projection) {
  return std::to_array<EnumName<Projection>>(
      {{Projection::node, "node"}, {Projection::eigen, "eigen"}});
}

/// Coordinates z with δ = T z in which the dense Gaussian is N(0, I): TᵀΛT = I.
class CAIRN_API BlanketProjection {
 public:
  /// Throws `Error` (numerical) if Λ is zero, or, for `node`, if it leaves more open than that.
  BlanketProjection(const DenseBlanket& blanket, Projection projection);

  int rank = 0;                                        ///< r
  const std::vector<double>& T() const { return T_; }  ///< d × r
  /// The recovery problem of a topology.
  RecoveryProblem problem(const DenseBlanket& blanket,
                          std::span<const FactorChoice> topology) const;

 private:
  std::vector<double> T_;
};

/// The projection asked for; where Λ leaves more open than `node` can do with, as after the removal
/// of a landmark, there is no node to be relative to, and it is `eigen`. Throws `Error` (numerical)
/// if Λ is zero.
CAIRN_API BlanketProjection project(const DenseBlanket& blanket, Projection projection);

/// Where a recovery stood, for plots of its convergence.
struct RecoveryPoint {
  double seconds = 0.0;
  double kld = 0.0;
};

struct RecoveryResult {
  std::vector<std::vector<double>> information;  ///< Ω_k, m × m, positive definite
  double kld = 0.0;                              ///< [nats]
  /// Largest element of the projected gradient, each factor in units in which its optimum alone
  /// would be the identity: max |W − P(W − 2 ∂KLD/∂W)| / 2 with P the nearest W ⪰ 0.
  double gradient = 0.0;
  int iterations = 0;
  bool converged = true;
  double seconds = 0.0;
  std::vector<RecoveryPoint> trace;  ///< if it was asked for
};

/// Finds the information of a topology's factors (T 4.3).
class CAIRN_API FactorRecovery : public Interruptible {
 public:
  static constexpr std::string_view kKind = "factor_recovery";
  ~FactorRecovery() override;

  /// Throws `Error` (usage) if the method cannot solve such a problem, (numerical) if the factors
  /// do not determine all r coordinates.
  virtual RecoveryResult recover(const RecoveryProblem& problem) = 0;
  /// Whether it solves problems that have a `RecoveryProblem::background`.
  virtual bool takes_background() const { return false; }
  /// Record `RecoveryResult::trace` from now on.
  virtual void trace(bool on) { (void)on; }
};

}  // namespace cairn
