// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/graph/update.hpp"
#include "compact_graph.hpp"
#include "proximity.hpp"

namespace cairn::compact {

/// A measured loop closure, ready to be judged.
struct Link {
  int earlier = 0, later = 0;  ///< kept poses; `later` may be the newest before it is kept
  std::vector<Factor> factors;
  Motion motion{};      ///< measured, from `earlier` to `later`
  State mean{};         ///< of it
  Matrix covariance{};  ///< Σ_y of it
};

/// How consistent a link is with the estimate.
struct Fit {
  double innovation = 0.0;  ///< squared Mahalanobis distance, eᵀ S⁻¹ e
  double chance =
      0.0;  ///< how likely a false match, anywhere within the sensor's range, fits as well
  bool consistent = true;
};

/// The part of the right measurements that pass a test of their innovation; 0: there is no test.
struct Gate {
  double part = 0.0;

  bool on() const { return part > 0.0; }
  /// Whether an innovation is below the bound for so many degrees of freedom; if there is no test,
  /// whether it is finite.
  bool passes(double innovation, int dof) const;
};

/// Distinguishes false loop closures from correct ones. A false match contradicts the estimate, so
/// its apparent information gain is high; it is detected by its inconsistency.
///
/// The gate: e = log(d⁻¹ z) of a measurement z and the estimated displacement d must have eᵀ S⁻¹ e
/// < χ², S = Σ_d + Σ_y, with the quantile that so many right links stay below. Where Σ_d is large
/// that proves little: a false match, uniform over the sensor's range, passes with a probability of
/// the ellipsoid's volume over that of the range. If that is not small, another link has to agree:
/// two links between the same parts of the trajectory close a cycle with the odometry between their
/// ends (pairwise consistency, Mangelson et al. 2018), which must be the identity within its own
/// covariance.
class ConsistencyCheck {
 public:
  /// `trust`: a link needs another one's agreement if a false match would fit with more than this
  /// probability.
  ConsistencyCheck(const RigidGroup& group, const SensorRange& range, Gate gate, double trust);

  bool on() const { return limit_ > 0.0; }
  /// Takes the displacements that are expected as less certain from now on, Σ_d times the least
  /// power of two with which this link fits; returns by how much in all. None fits with any: one.
  double loosen_for(const Link& link, const Displacement& expected);
  /// Of a link with the displacement that was expected.
  Fit fit(const Link& link, const Displacement& expected) const;
  /// Whether two links close a cycle. `earlier` is the displacement from the first's earlier pose
  /// to the second's, `later` likewise.
  Fit agreement(const Link& first, const Link& second, const Displacement& earlier,
                const Displacement& later) const;
  bool needs_another(const Fit& fit) const { return on() && fit.chance > trust_; }

 private:
  Fit judge(const Vector& e, const Matrix& S) const;

  const RigidGroup* group_;
  double limit_ = 0.0;       ///< χ² quantile of the gate
  double log_volume_ = 0.0;  ///< ln of the ellipsoid's volume for S = I over the range's
  double trust_;
  double loose_ = 1.0;  ///< times Σ_d
};

}  // namespace cairn::compact
