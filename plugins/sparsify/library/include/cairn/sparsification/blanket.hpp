// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// A measurement model that could become a factor of the approximation.
struct FactorModel {
  std::vector<int> nodes;        ///< of the blanket, those it measures
  int size = 0;                  ///< m, of its residual
  std::vector<double> jacobian;  ///< J: dr/dδ where r = 0, not whitened; m × d
};

/// What marginalising leaves on a Markov blanket: N(0, Λ⁻¹) in the tangent space of its nodes,
/// whose sizes add up to d. Λ is singular where only relative measurements led to it.
struct DenseBlanket {
  /// Tangent size of each node: first the poses, which are all of one size, then the landmarks,
  /// which are smaller.
  std::vector<int> node_sizes;
  std::vector<double> information;  ///< Λ, d × d
  /// What a topology can choose from: a whole measurement for each pair of nodes, and for single
  /// nodes where it is absolute, each followed by its parts if the topology asks for them.
  std::vector<FactorModel> models;
  /// An absolute measurement led to it, so Λ does not leave the pose of the whole open; there are
  /// models on single nodes (priors).
  bool absolute = false;

  bool is_landmark(int node) const { return node_sizes[node] < node_sizes.front(); }

  CAIRN_API int size() const;  ///< d
  /// First tangent coordinate of each node, and d at the end.
  CAIRN_API std::vector<int> offsets() const;
};

/// A factor of a topology: the models that it measures together, by number. Nearly always one; two
/// where their errors are correlated.
using FactorChoice = std::vector<int>;

}  // namespace cairn
