// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "approximation.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/sparsification/topology.hpp"

namespace cairn::sparsify {

/// How the mutual information of two nodes is computed where Λ is singular.
enum class Regularization {
  covariance,   ///< of Σ̂ = (Λ + εI)⁻¹ (T 4.18)
  information,  ///< of Λ, all other nodes marginalised, with εI in each determinant (T 4.17)
};
constexpr auto enum_names(Regularization) {
  return std::to_array<EnumName<Regularization>>(
      {{Regularization::covariance, "covariance"}, {Regularization::information, "information"}});
}

/// Options of every topology that begins with a Chow-Liu tree.
struct TopologyOptions {
  Regularization regularization = Regularization::covariance;
  double epsilon = 0.01;  ///< ε as a part of Λ's mean diagonal
  bool absolute = false;  ///< ε is in Λ's units, as (T 4.17, 4.18) have it

  static auto fields() {
    using O = TopologyOptions;
    return OptionFields<O>()
        .choice("regularization", &O::regularization,
                "mutual information where Λ is singular: of (Λ + εI)⁻¹, or with εI in each "
                "determinant of Λ's marginals")
        .real("epsilon", &O::epsilon, 1e-12, 1e9,
              "ε, as a fraction of Λ's mean diagonal unless it is absolute")
        .boolean("absolute", &O::absolute, "ε is in Λ's own units instead, as in the thesis");
  }
};

/// How the information of a tree is subtracted from Σ̂.
enum class Downdate {
  sum,    ///< by (T 4.23)
  exact,  ///< exactly
};
constexpr auto enum_names(Downdate) {
  return std::to_array<EnumName<Downdate>>({{Downdate::sum, "sum"}, {Downdate::exact, "exact"}});
}

struct DowndatedInformationOptions {
  TopologyOptions tree{};
  Downdate downdate = Downdate::sum;

  static auto fields() {
    using O = DowndatedInformationOptions;
    return OptionFields<O>().part(&O::tree).choice(
        "downdate", &O::downdate,
        "the information of the tree is subtracted by the sum of equation 4.23, or exactly");
  }
};

struct SparseInverseOptions {
  TopologyOptions tree{};
  double weight = 0.1;  ///< λ of (T 4.19), as a part of the largest off-diagonal of Σ̂

  static auto fields() {
    using O = SparseInverseOptions;
    return OptionFields<O>().part(&O::tree).real(
        "weight", &O::weight, 0.0, 1.0,
        "of the sum of absolute values, as a fraction of the largest correlation");
  }
};

/// What becomes of a blanket with more topologies than `best` may try.
enum class Beyond { ekld, refuse };
constexpr auto enum_names(Beyond) {
  return std::to_array<EnumName<Beyond>>({{Beyond::ekld, "ekld"}, {Beyond::refuse, "refuse"}});
}

struct ExhaustiveOptions {
  TopologyOptions tree{};
  std::int64_t most = 200000;  ///< topologies
  Beyond beyond = Beyond::ekld;

  static auto fields() {
    using O = ExhaustiveOptions;
    return OptionFields<O>()
        .part(&O::tree)
        .integer("most", &O::most, 1, 1000000000, "topologies to try")
        .choice("beyond", &O::beyond,
                "for a blanket that has more: the topology of ekld, or an error");
  }
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
  explicit DowndatedInformation(const DowndatedInformationOptions& options)
      : ChowLiuTree(options.tree), downdate_(options.downdate) {}
  std::vector<FactorChoice> choose(const DenseBlanket& blanket, int population) override;

 private:
  Downdate downdate_;
};

/// That tree, and one by one the factor that lowers the KLD most by one step of factor descent;
/// after each tenth of them the factors chosen so far are relaxed by two passes of it.
class ExpectedDivergence : public ChowLiuTree {
 public:
  using ChowLiuTree::ChowLiuTree;
  std::vector<FactorChoice> choose(const DenseBlanket& blanket, int population) override;

 protected:
  /// What a factor could be, and what it takes of the budget.
  struct Candidate {
    int model;
    int cost;
  };
  /// Adds candidates to a topology that connects all nodes, as long as the budget lasts: always the
  /// one with the largest gain for its cost of those left, whereupon those that it excludes go.
  std::vector<FactorChoice> grow(const DenseBlanket& blanket, std::vector<FactorChoice> chosen,
                                 const std::vector<Candidate>& candidates, int budget,
                                 const std::function<bool(int, int)>& excludes);
};

/// The same with factors of fewer rows as well: of a position, an orientation, a bearing or a range
/// alone, and, in an absolute blanket, more priors. The population is one of rows: as many as that
/// many whole factors have, and each candidate's gain is divided by its rows. The information of a
/// factor of a part is semidefinite.
class MixedParts final : public ExpectedDivergence {
 public:
  using ExpectedDivergence::ExpectedDivergence;
  std::vector<FactorChoice> choose(const DenseBlanket& blanket, int population) override;
  bool parts() const override { return true; }
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
  explicit SparseInverse(const SparseInverseOptions& options)
      : ChowLiuTree(options.tree), weight_(options.weight) {}
  std::vector<FactorChoice> choose(const DenseBlanket& blanket, int population) override;

 private:
  double weight_;
};

/// The Chow-Liu tree with its edges in correlated pairs that share a node (Mazuran, Burgard and
/// Tipaldi 2016): the errors of a pair have one information matrix, which a tree's closed form
/// finds.
class Cliquey final : public ChowLiuTree {
 public:
  using ChowLiuTree::ChowLiuTree;
  std::vector<FactorChoice> choose(const DenseBlanket& blanket, int population) override;
  std::string_view unwritable() const override {
    return "pairs of correlated factors (CORRELATED_PAIR)";
  }
};

/// One factor on the whole blanket, which loses nothing: the dense generic linear constraint of
/// Carlevaris-Bianco, Kaess and Eustice (T-RO 2014); see `LinearConstraint`.
class DenseConstraint final : public Topology {
 public:
  /// Throws `Error` (usage) for a blanket with models of its pairs.
  std::vector<FactorChoice> choose(const DenseBlanket& blanket, int population) override;
  bool whole() const override { return true; }
  std::string_view unwritable() const override {
    return "one factor on all neighbours of a node (LINEAR_CONSTRAINT)";
  }
};

/// Every topology of that population is tried, and the one with the least KLD taken; where there
/// are too many, that of `ekld`, with a note, or `choose` throws `Error` (usage).
class Exhaustive final : public ChowLiuTree {
 public:
  explicit Exhaustive(const ExhaustiveOptions& options)
      : ChowLiuTree(options.tree), most_(options.most), beyond_(options.beyond) {}
  std::vector<FactorChoice> choose(const DenseBlanket& blanket, int population) override;
  std::string note() const override;

 private:
  std::int64_t most_;
  Beyond beyond_;
  bool instead_ = false;  ///< the last blanket got the topology of ekld
};

}  // namespace cairn::sparsify
