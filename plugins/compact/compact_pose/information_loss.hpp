// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/graph/elements.hpp"
#include "cairn/graph/update.hpp"
#include "cairn/solve/estimator.hpp"

namespace cairn::compact {

/// Rows R of a linear system J δ, δ = (δ_t, δ_C) with δ_t its first `count` elements, when δ_t is
/// eliminated: what is orthogonal to its columns, so that RᵀR is the Schur complement of JᵀJ.
Eigen::MatrixXd eliminate(const Eigen::MatrixXd& J, Eigen::Index count);

/// The information that measurements have about a set S of variables, given all others: I(z; S) = ½
/// ln |Σ'_S| / |Σ_S| [nats], with Σ'_S what the covariance of S would be without them. z are
/// whitened rows R on variables C, some of which may not be in S; then
///
///     I(z; S) = ½ ln |I − R Σ_{C|S} Rᵀ| − ½ ln |I − R Σ_CC Rᵀ|,
///
/// by the chain rule, I(z; everything) − I(z; everything | S). `S` is Σ_CC with z, `S_given` the
/// covariance Σ_{C|S} of C with z where S is known, zero for C in S. Infinite if S would not be
/// determined.
double information_about(const Eigen::MatrixXd& R, const Eigen::MatrixXd& S,
                         const Eigen::MatrixXd& S_given);

/// A factor at the estimate.
struct LinearFactor {
  FactorId id = 0;
  Factor factor;
  std::vector<Eigen::MatrixXd> J{};  ///< whitened and weighted by its loss, by each variable

  bool is_on(Id variable) const;
};

/// What would be lost without measurements [nats].
struct InformationLoss {
  double map = 0.0;     ///< about the poses that stay, and the landmarks
  double newest = 0.0;  ///< about the newest pose, where the map is known
};

/// Poses that may leave, and the newest.
struct LeavingPoses {
  std::vector<Id> others;    ///< but the newest, in the order of arrival
  std::optional<Id> newest;  ///< if it is one of them; else it belongs to the map
};

/// What would be lost without that which the pose `leaving`, one of `poses`, measured: `all`, or of
/// landmarks alone. `factors`: those on any of these poses; `pose_size`: the tangent space of one.
InformationLoss information_loss(Id leaving, bool all, const LeavingPoses& poses,
                                 std::span<const LinearFactor> factors, Eigen::Index pose_size,
                                 Estimator& estimator);

}  // namespace cairn::compact
