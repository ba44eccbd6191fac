// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "approximation.hpp"
#include "cairn/sparsification/sparsification.hpp"

namespace cairn::sparsify {

/// How the mutual information of two nodes is computed where Λ is singular.
enum class Regularization {
  covariance,   ///< of Σ̂ = (Λ + εI)⁻¹ (T 4.18)
  information,  ///< of Λ, all other nodes marginalised, with εI in each determinant (T 4.17)
};

struct TopologyOptions {
  Regularization regularization = Regularization::covariance;
  double epsilon = 0.01;        ///< ε as a fraction of Λ's mean diagonal
  bool exact_downdate = false;  ///< dmi: Σ̂ without the tree, exactly, instead of by (T 4.23)
  double l1_weight = 0.1;  ///< λ of (T 4.19), as a fraction of the largest off-diagonal of Σ̂
  std::int64_t most = 200000;  ///< best: so many topologies at most
};

/// Mutual information of each pair of nodes [nats]; n × n.
Matrix mutual_information(const DenseBlanket& blanket, const TopologyOptions& options);

/// Chow-Liu tree: the spanning tree with the largest sum of mutual information.
class ChowLiuTree : public Topology {
 public:
  explicit ChowLiuTree(TopologyOptions options) : options_(options) {}
  std::vector<FactorChoice> choose(const DenseBlanket& blanket, int population) override;

 protected:
  TopologyOptions options_;
};

/// That tree, and the pairs with the next largest mutual information.
class MutualInformation final : public ChowLiuTree {
 public:
  using ChowLiuTree::ChowLiuTree;
  std::vector<FactorChoice> choose(const DenseBlanket& blanket, int population) override;
};

/// That tree, and the pairs with the largest mutual information once the information of the tree
/// has been subtracted (T 4.23).
class DowndatedInformation final : public ChowLiuTree {
 public:
  using ChowLiuTree::ChowLiuTree;
  std::vector<FactorChoice> choose(const DenseBlanket& blanket, int population) override;
};

/// That tree, and one by one the factor that lowers the KLD most by one step of factor descent.
class ExpectedDivergence final : public ChowLiuTree {
 public:
  using ChowLiuTree::ChowLiuTree;
  std::vector<FactorChoice> choose(const DenseBlanket& blanket, int population) override;
};

/// Pairs by |det Λ_ij|, a spanning tree first.
class OffDiagonalDeterminant final : public Topology {
 public:
  std::vector<FactorChoice> choose(const DenseBlanket& blanket, int population) override;
};

/// Pairs by ‖Λ̆_ij‖ of the Λ̆ that minimises tr(Λ̆Σ̂) − ln |Λ̆| + λ‖Λ̆‖₁ (T 4.19; Eckenhoff, Paull
/// and Huang 2016), a spanning tree first. By the alternating direction method of multipliers.
class SparseInverse final : public ChowLiuTree {
 public:
  using ChowLiuTree::ChowLiuTree;
  std::vector<FactorChoice> choose(const DenseBlanket& blanket, int population) override;
};

/// The Chow-Liu tree with its edges in correlated pairs that share a node (Mazuran, Burgard and
/// Tipaldi 2016): the errors of a pair have one information matrix, which a tree's closed form
/// finds.
class Cliquey final : public ChowLiuTree {
 public:
  using ChowLiuTree::ChowLiuTree;
  std::vector<FactorChoice> choose(const DenseBlanket& blanket, int population) override;
};

/// Every topology of that population is tried, and the one with the least KLD taken.
class Exhaustive final : public ChowLiuTree {
 public:
  using ChowLiuTree::ChowLiuTree;
  std::vector<FactorChoice> choose(const DenseBlanket& blanket, int population) override;
};

}  // namespace cairn::sparsify
