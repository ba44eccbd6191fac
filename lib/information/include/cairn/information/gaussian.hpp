// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "cairn/runtime/api.hpp"

// Information measures of Gaussians given by dense matrices. (T n) is an equation of J. Vallvé,
// Information metrics for localization and mapping (thesis, UPC Barcelona 2018), chapter 3; where
// its text lacks a factor of ½, the definitions here are the standard ones. All results are in
// nats. Matrices are symmetric, which is not checked. Throws `Error`: (usage) for sizes that do
// not fit, (numerical) for a matrix that is not positive definite, or not finite, where it must be.
//
// Entropy is a differential one: it depends on the units of the coordinates (metres or
// millimetres), may be negative, and only differences of it between Gaussians in the same
// coordinates have a meaning. Mutual information, information gain and divergence do not depend on
// units, nor on any linear change of coordinates.

namespace cairn {

/// A matrix, or a block or map of one.
using MatrixView = Eigen::Ref<const Eigen::MatrixXd>;

/// N(μ, Σ).
struct Gaussian {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};

/// The same by its information matrix Λ = Σ⁻¹ and information vector η = Λ μ.
struct InformationForm {
  Eigen::VectorXd vector;
  Eigen::MatrixXd matrix;
};

// Entropy -----------------------------------------------------------------------------------------

/// H(x) = ½ ln((2πe)ⁿ |Σ|) (T 3.2).
CAIRN_API double entropy(const MatrixView& covariance);
/// The same of n = `size` coordinates by ln |Λ|, such as a linear solver has (`LogDeterminant`):
/// ½ (n ln 2πe − ln |Λ|).
CAIRN_API double entropy_of_information(std::int64_t size, double log_determinant);
/// H(a|b) = H(a, b) − H(b), a the first `size_a` coordinates of a joint covariance and b the rest:
/// the entropy of a once b is known.
CAIRN_API double conditional_entropy(const MatrixView& joint, int size_a);

// Mutual information ------------------------------------------------------------------------------

/// I(a; b) = ½ ln(|Σ_a| |Σ_b| / |Σ|), a the first `size_a` coordinates and b the rest, of a joint
/// covariance (T 3.7). The joint information matrix gives the same (T 3.8), and may be passed
/// instead.
///
/// It is computed as −½ ln |I − W Wᵀ| with W = L_a⁻¹ Σ_ab L_b⁻ᵀ, whose singular values are the
/// canonical correlations of a and b: a small one keeps its digits. Zero where one of the two has
/// no coordinates; where one of the two determines a part of the other, infinity if rounding shows
/// it, else a large number. A marginal that is singular is an `Error` (numerical).
CAIRN_API double mutual_information(const MatrixView& joint, int size_a);

/// ½ ln |I + R⁻¹ S| = ½ ln(|R + S| / |R|): the information gain of measuring, with a noise of
/// covariance R, what has the covariance S so far; the entropy that the state loses by it. S may be
/// singular, and indefinite by rounding; the result is never negative. Without allocation for sizes
/// up to 6.
CAIRN_API double information_gain(const MatrixView& S, const MatrixView& R);
/// The same of a measurement with Jacobian J by a state with covariance Σ: S = J Σ Jᵀ.
CAIRN_API double information_gain(const MatrixView& J, const MatrixView& covariance,
                                  const MatrixView& R);

// Divergence --------------------------------------------------------------------------------------

/// A divergence and its two parts; neither is negative.
struct Divergence {
  double covariance = 0.0;  ///< what remains where the means agree
  double mean = 0.0;        ///< that of the means
  double total() const { return covariance + mean; }
};

/// The Kullback-Leibler divergence D(p‖q) = ½ (tr(Σ_q⁻¹ Σ_p) − ln |Σ_q⁻¹ Σ_p| − n
/// + ‖μ_q − μ_p‖²_Λq) (T 3.4): what is lost where q is used in place of p. Of Gaussians that are
/// nearly the same it is computed from the difference of the two matrices, and keeps its digits.
CAIRN_API Divergence kullback_leibler(const Gaussian& p, const Gaussian& q);
CAIRN_API Divergence kullback_leibler(const InformationForm& p, const InformationForm& q);
/// The symmetric one, D(p‖q) + D(q‖p) (Jeffreys; T 3.9): a sum, not a mean.
CAIRN_API Divergence jeffreys(const Gaussian& p, const Gaussian& q);
/// −∫ p ln q = H(p) + D(p‖q).
CAIRN_API double cross_entropy(const Gaussian& p, const Gaussian& q);

}  // namespace cairn
