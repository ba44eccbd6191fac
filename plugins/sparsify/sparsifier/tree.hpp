// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "cairn/sparsification/blanket.hpp"

namespace cairn::sparsify {

/// The model of a pair of nodes, and how important it is.
struct Pair {
  int model;
  double weight;
};

/// ln |A| of a positive semidefinite matrix; −691 where A is singular.
double log_determinant(const Eigen::MatrixXd& A);

/// The models of pairs of nodes; of several between the same two nodes the first.
std::vector<int> pair_models(const DenseBlanket& blanket);

/// The models of single nodes, the first of each: priors.
std::vector<int> prior_models(const DenseBlanket& blanket);

/// Adds pairs that are not chosen yet, in their order, until `population` factors are.
void fill_up(const DenseBlanket& blanket, const std::vector<Pair>& pairs, int population,
             std::vector<FactorChoice>& chosen);

/// Of a spanning tree, with the prior that an absolute blanket needs besides.
int tree_size(const DenseBlanket& blanket);

/// The spanning tree with the largest sum of weights, of pairs that are sorted, and, in an absolute
/// blanket, the best prior; then the other pairs in their order. With landmarks or a prior the tree
/// is the one of the least divergence, and the prior is that of the least ln |J Σ Jᵀ|, which is the
/// best whatever the relative factors are: it alone measures where the whole is, so its information
/// is (J Σ Jᵀ)⁻¹ by proposition 3.
/// Throws `Error` (usage) if the pairs do not connect all nodes.
std::vector<FactorChoice> tree_first(const DenseBlanket& blanket, const std::vector<Pair>& pairs,
                                     int population);

}  // namespace cairn::sparsify
