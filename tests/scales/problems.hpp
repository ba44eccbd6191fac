// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/plugin/registry.hpp"

namespace cairn::scales {

/// What determines where a graph is in the world.
enum class Hold {
  nothing,  ///< its first pose is anchored, or the gauge is left free
  first,    ///< its first pose is fixed; of cameras the first two, which fixes the scale as well
  prior,    ///< a prior on its first pose
  priors,   ///< priors on every tenth pose
};

/// A generated graph that all optimizers are tried on.
struct Problem {
  std::string name;
  std::string generator;  ///< with its options
  std::uint64_t seed = 1;
  Hold hold = Hold::nothing;
  /// Robust loss on all factors, with the whitened norm at which it turns robust; "": none.
  std::string loss = {};
  double width = 1.0;
};

/// The 32 graphs: all kinds of the project's generators, in the plane and in space, with landmarks
/// and cameras, of at most a few hundred poses.
std::vector<Problem> all_problems();

/// A few of them, each of another kind, for the suite of tests.
std::vector<Problem> few_problems();

/// The graph at the generator's initial estimate, without its loss, which depends on the scale.
/// Throws `Error` (plugin) where the build lacks what it is made with.
Graph make_graph(const Problem& problem, Registry& registry);

}  // namespace cairn::scales
