// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/graph/elements.hpp"
#include "measured.hpp"
#include "rigid_group.hpp"

namespace cairn::compact {

/// An absolute measurement of a pose, such as a position from GPS: a factor on it alone.
class AbsoluteMeasurement {
 public:
  /// At a state: whitened residual, and its Jacobian by a step of the pose.
  struct Linear {
    Eigen::VectorXd residual;
    Eigen::MatrixXd J;
  };

  /// Throws `Error` (input) for a factor that is not on this pose alone, or that is not valid.
  AbsoluteMeasurement(const Factor& factor, Id pose, const VariableType& type);

  const Factor& factor() const { return measured_.factor(); }
  Id pose() const { return factor().variables.front(); }
  Linear at(const State& x) const;

 private:
  Measured measured_;
};

/// How it compares with the estimate of its pose.
MeasuredFit fit(const AbsoluteMeasurement::Linear& measurement, const Matrix& covariance);

/// A measurement, and the state of its pose.
struct PlacedMeasurement {
  const AbsoluteMeasurement* measurement = nullptr;
  State x{};
};

/// What absolute measurements of poses k say of where a graph is as a whole.
///
/// A rigid motion of all poses, x_k ← x exp(δ) x⁻¹ x_k, seen from a pose at x, is a step
/// A_k δ of pose k, A_k = Ad(x_k⁻¹ x). Before any measurement δ ~ N(0, M₀⁻¹), with standard
/// deviations of 1000 km and π: the graph may be anywhere. So the residuals, e, are those of a
/// linear model, e = G δ + H ε + noise, with the rows J_k A_k of G, J_k of the block diagonal H,
/// and the errors ε of the poses in a graph that the first one holds, whose joint covariance is Σ:
///
///     R = I + H Σ Hᵀ,  P = (Gᵀ R⁻¹ G + M₀)⁻¹, the covariance of δ.
///
/// Written so, nothing is the small difference of large numbers.
class FrameEstimate {
 public:
  /// Seen from x, the state of the pose that comes last in Σ, after those that were measured.
  FrameEstimate(const RigidGroup& group, std::vector<PlacedMeasurement> measurements,
                const State& x, Eigen::MatrixXd covariance);

  /// Of a measurement of that pose, given the others: with C = J Σ_x· Hᵀ, Q = J − C R⁻¹ G,
  /// V = I + J Σ_xx Jᵀ − C R⁻¹ Cᵀ + Q P Qᵀ.
  MeasuredFit fit(const AbsoluteMeasurement::Linear& measurement) const;
  /// Whether the measurements determine δ: the standard deviations of its rotation are below
  /// 0.2 rad, where J, which depends on the heading, is right.
  bool determined() const;
  /// The motion, x_k ← move x_k, that leaves the least Σ ‖e_k‖² (Levenberg-Marquardt).
  State best_move() const;

 private:
  /// e and G after all poses were moved.
  AbsoluteMeasurement::Linear rows(const State& move) const;

  const RigidGroup& group_;
  std::vector<PlacedMeasurement> measurements_;
  State x_;
  Eigen::MatrixXd Sigma_;
  Eigen::MatrixXd H_, R_, G_, P_;
  Eigen::VectorXd e_;
};

}  // namespace cairn::compact
