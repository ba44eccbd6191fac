// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "cairn/graph/graph.hpp"

namespace cairn::test {

// Small graphs with factors of their own, differentiated automatically: these tests need no types
// plugin.

/// Poses on a ring with relative poses between neighbours and across; measurements and estimate
/// noisy. `outliers` of the measurements across are grossly wrong.
Graph ring_of_poses(int poses, double noise, int outliers = 0);

/// Poses in a row that see points: blocks of 3 and 2 in one graph.
Graph poses_and_points(int poses, double noise);

/// As `poses_and_points`, but held by one point alone: the whole may turn about it.
Graph held_by_a_point(int poses = 8);

/// Poses in steps of 100 m along x, with relative poses of so much information between neighbours,
/// and an absolute pose of information 1 of the first.
Graph stiff_chain(int poses, double strong);

/// One point with r = (atan(10 x), y) and x far out: Gauss-Newton overshoots farther at every step.
Graph overshooting(double x);

/// Rosenbrock's valley, r = (10 (y − x²), 1 − x), from the usual start (−1.2, 1): chi2 = 0 at (1,
/// 1).
Graph rosenbrock();

/// Two residuals that cannot both vanish, r = (x + 1, λ x² + x − 1): large residuals at the minimum
/// x ≈ 0, so that Gauss-Newton converges only linearly, at the rate |λ|.
Graph large_residuals(double lambda);

/// A ring of poses, every one of them fixed.
Graph everything_held();

/// The lowest chi2 that whole Gauss-Newton steps with dense algebra reach from the graph's
/// estimate: slow, simple, and independent of what is tested. The graph's states are left alone.
double dense_minimum(const Graph& graph);

/// Σ ρ(‖r‖²) at the graph's states, factor by factor.
double chi2_of(const Graph& graph);

}  // namespace cairn::test
