// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "budget.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/runtime/enum_names.hpp"
#include "cairn/sparsification/edge_selection.hpp"

namespace cairn::edges {

/// What all selections have.
struct PartOptions {
  double part = 0.5;  ///< of the loop closures, those that stay

  static auto fields() {
    return OptionFields<PartOptions>().real("part", &PartOptions::part, 0.0, 1.0,
                                            "of the loop closures, those that stay");
  }
};

/// A selection of a part of the loop closures, rounded to a whole number.
class SelectionByPart : public EdgeSelection {
 public:
  explicit SelectionByPart(const PartOptions& options) : part_(options.part) {}
  EdgeChoice choose(const Graph& graph, std::span<const int> candidates, const Step& step) final;

 protected:
  /// `count` of the candidates: more than none, and not all.
  virtual EdgeChoice choose(const Graph& graph, std::span<const int> candidates, int count,
                            const Step& step) = 0;

 private:
  double part_;
};

/// A selection by a relaxation that is rounded.
struct RelaxationOptions {
  PartOptions part{};
  int iterations = 200;
  double tolerance = 1e-3;
  Rounding rounding{};
  std::string linear_solver = "block_cholesky";

  static auto fields() {
    using O = RelaxationOptions;
    const auto rounding =
        OptionFields<Rounding>()
            .integer("samples", &Rounding::samples, 0, 1e6, "random roundings besides the nearest")
            .integer("seed", &Rounding::seed, 0, 9e15, "of these");
    return OptionFields<O>()
        .part(&O::part)
        .integer("iterations", &O::iterations, 1, 1e6, "of the Frank-Wolfe method, at most")
        .real("tolerance", &O::tolerance, 0.0, 1.0, "ends where the relative gap is below this")
        .part(&O::rounding, rounding)
        .component<LinearSolver>("linear_solver", &O::linear_solver, "solves and factorises");
  }
};

// Algebraic connectivity --------------------------------------------------------------------------

struct ConnectivityOptions {
  RelaxationOptions relaxation{};
  EdgeWeight weight = EdgeWeight::rotation;

  static auto fields() {
    using O = ConnectivityOptions;
    return OptionFields<O>()
        .part(&O::relaxation)
        .choice("weight", &O::weight, "the information of which part weighs an edge");
  }
};

/// Maximises the algebraic connectivity λ2 of the Laplacian of all relative factors that stay (MAC:
/// Doherty, Rosen and Leonard, Spectral Measurement Sparsification for Pose-Graph SLAM, IROS 2022).
/// λ2 is concave in the weights; its relaxation 0 ≤ w ≤ 1 is solved by the method of Frank and
/// Wolfe, the supergradient being κ_k (v_a − v_b)² with the Fiedler vector v. The weights are
/// rounded to the nearest choice and to random ones (Madow), of which the best stays; the dual
/// bound of the relaxation is a bound on every choice. Throws `Error` (input) if the relative
/// factors do not connect all poses.
class MaximalConnectivity final : public SelectionByPart {
 public:
  MaximalConnectivity(const ConnectivityOptions& options, std::unique_ptr<LinearSolver> solver)
      : SelectionByPart(options.relaxation.part),
        options_(options.relaxation),
        weight_(options.weight),
        solver_(std::move(solver)) {}

 protected:
  EdgeChoice choose(const Graph& graph, std::span<const int> candidates, int count,
                    const Step& step) override;

 private:
  RelaxationOptions options_;
  EdgeWeight weight_;
  std::unique_ptr<LinearSolver> solver_;
};

// Determinants ------------------------------------------------------------------------------------

struct TreeOptions {
  PartOptions part{};
  std::string linear_solver = "block_cholesky";

  static auto fields() {
    using O = TreeOptions;
    return OptionFields<O>().part(&O::part).component<LinearSolver>(
        "linear_solver", &O::linear_solver, "solves with the Laplacians");
  }
};

/// Greedily the factors that increase n_t ln |L_t| + n_r ln |L_r| most, with the grounded
/// Laplacians of translation and rotation and their dimensions: |L| is the weighted number of
/// spanning trees (Khosoussi, Giamou, Sukhatme, Huang, Dissanayake and How, Reliable Graphs for
/// SLAM, IJRR 2019). It depends on which poses are joined and how precisely, not on where they are.
class GreedyTreeConnectivity final : public SelectionByPart {
 public:
  /// Of the same kind: one for each Laplacian.
  GreedyTreeConnectivity(const TreeOptions& options, std::unique_ptr<LinearSolver> first,
                         std::unique_ptr<LinearSolver> second)
      : SelectionByPart(options.part), solvers_{std::move(first), std::move(second)} {}

 protected:
  EdgeChoice choose(const Graph& graph, std::span<const int> candidates, int count,
                    const Step& step) override;

 private:
  std::array<std::unique_ptr<LinearSolver>, 2> solvers_;
};

/// What a factor is worth to `GreedyGain`.
enum class GainObjective {
  information,  ///< ½ ln |I + J Σ Jᵀ|, the information gain
  divergence,   ///< by how much it reduces the divergence from the whole graph
};
constexpr auto enum_names(GainObjective) {
  return std::to_array<EnumName<GainObjective>>(
      {{GainObjective::information, "information"}, {GainObjective::divergence, "divergence"}});
}

struct GainOptions {
  PartOptions part{};
  GainObjective objective = GainObjective::information;
  std::string linear_solver = "block_cholesky";

  static auto fields() {
    using O = GainOptions;
    return OptionFields<O>()
        .part(&O::part)
        .choice("objective", &O::objective,
                "what is greatest: the information gain, or what the divergence is reduced by")
        .component<LinearSolver>("linear_solver", &O::linear_solver,
                                 "solves with the information matrix");
  }
};

/// Greedily the factors with the largest information gain ½ ln |I + J_k Σ J_kᵀ| given all that stay
/// so far, J_k whitened: the real factors where they are. ln |Λ| is submodular in the set of
/// factors. With `divergence` ½ tr(J_k Σ₁ J_kᵀ) is subtracted, Σ₁ being the covariance with all
/// factors: the sum is what the divergence of the covariances, ½ (tr(Λ_S Σ₁) − ln |Λ_S Σ₁| − d), is
/// reduced by.
class GreedyGain final : public SelectionByPart {
 public:
  GreedyGain(const GainOptions& options, std::unique_ptr<LinearSolver> solver)
      : SelectionByPart(options.part), objective_(options.objective), solver_(std::move(solver)) {}

 protected:
  EdgeChoice choose(const Graph& graph, std::span<const int> candidates, int count,
                    const Step& step) override;

 private:
  GainObjective objective_;
  std::unique_ptr<LinearSolver> solver_;
};

/// A rounding of the weights with which a sparse graph has the smallest divergence: w minimises ½
/// (tr(Λ(w) Σ₁) − ln |Λ(w) Σ₁| − d), Λ(w) the information with the candidates weighted by w, Σ₁ the
/// covariance with all of them, under 0 ≤ w ≤ 1 and Σ w = count. That is the ℓ1-regularised problem
/// of Huang, Kaess and Leonard (Consistent sparsification for graph optimization, ECMR 2013) with
/// weights of factors for unknowns and the ℓ1 norm as a constraint instead of a penalty: for each
/// count there is a penalty with the same minimum, the multiplier of the constraint. w ≤ 1 is their
/// condition of consistency, Λ(w) ⪯ Λ. The minimum is a bound on the divergence of every choice of
/// as many factors. It is found by the method of Frank and Wolfe, and rounded to the nearest choice
/// and to random ones, of which that with the least divergence stays.
class SparseWeights final : public SelectionByPart {
 public:
  SparseWeights(const RelaxationOptions& options, std::unique_ptr<LinearSolver> solver)
      : SelectionByPart(options.part), options_(options), solver_(std::move(solver)) {}

 protected:
  EdgeChoice choose(const Graph& graph, std::span<const int> candidates, int count,
                    const Step& step) override;

 private:
  RelaxationOptions options_;
  std::unique_ptr<LinearSolver> solver_;
};

// -------------------------------------------------------------------------------------------------

struct RandomOptions {
  PartOptions part{};
  std::int64_t seed = 1;

  static auto fields() {
    using O = RandomOptions;
    return OptionFields<O>().part(&O::part).integer("seed", &O::seed, 0, 9e15,
                                                    "of the random numbers");
  }
};

/// Any, all choices with the same probability: what the others are to be compared with.
class RandomEdges final : public SelectionByPart {
 public:
  explicit RandomEdges(const RandomOptions& options)
      : SelectionByPart(options.part), seed_(options.seed) {}

 protected:
  EdgeChoice choose(const Graph& graph, std::span<const int> candidates, int count,
                    const Step& step) override;

 private:
  std::int64_t seed_;
};

}  // namespace cairn::edges
