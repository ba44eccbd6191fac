// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cairn/linear/graph_marginals.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/sparsification/recovery.hpp"
#include "cairn/sparsification/sparsifier.hpp"
#include "cairn/sparsification/topology.hpp"
#include "constraint_model.hpp"
#include "fit.hpp"
#include "local_problem.hpp"
#include "work_graph.hpp"

namespace cairn::sparsify {

/// Which nodes leave together (T 4.5).
enum class Scheme {
  single,  ///< none
  runs,    ///< those that follow each other in the order of the graph and are connected
  multi,   ///< all that are connected
};
constexpr auto enum_names(Scheme) {
  return std::to_array<EnumName<Scheme>>(
      {{Scheme::single, "single"}, {Scheme::runs, "runs"}, {Scheme::multi, "multi"}});
}

/// Where a cropped problem that was solved by itself is linearised.
enum class LinearizeAt { graph, local };
constexpr auto enum_names(LinearizeAt) {
  return std::to_array<EnumName<LinearizeAt>>(
      {{LinearizeAt::graph, "graph"}, {LinearizeAt::local, "local"}});
}

/// What becomes of a pose whose neighbours would be left open by the factors that leave with it, as
/// where its position in the world is measured and its orientation is not.
enum class Open { refuse, reduce };
constexpr auto enum_names(Open) {
  return std::to_array<EnumName<Open>>({{Open::refuse, "refuse"}, {Open::reduce, "reduce"}});
}

struct SparsifyOptions {
  std::string topology = "ekld";
  Population population{};
  std::string recovery = "ncfd";
  Scheme scheme = Scheme::single;
  Projection projection = Projection::node;
  bool resolve = true;  ///< the cropped problem is solved by itself
  LinearizeAt linearize = LinearizeAt::graph;
  Open open = Open::refuse;
  Fit fit = Fit::blanket;
  std::string linear_solver = "block_cholesky";  ///< for `fit`

  static auto fields() {
    using O = SparsifyOptions;
    return OptionFields<O>()
        .component<Topology>("topology", &O::topology, "which nodes new factors relate")
        .text(
            "population", &O::population, Population::parse,
            [](const Population& value) { return value.text(); },
            "how many: tree:γ times as many as a tree, fill:α of all pairs, loss:KLD as few as "
            "keep the divergence below that [nats]")
        .component<FactorRecovery>("recovery", &O::recovery, "method that finds their information")
        .choice("scheme", &O::scheme,
                "nodes leave one by one, those that follow each other together, or all that are "
                "connected together")
        .choice("projection", &O::projection,
                "coordinates where Λ is singular: relative to a node, or its eigenvectors")
        .boolean("resolve", &O::resolve, "solve the cropped problem by itself first (not with glc)")
        .choice("linearize", &O::linearize,
                "then linearise at the states of the graph, or at the minimum found (the thesis)")
        .choice("open", &O::open,
                "a pose without which its neighbours are not determined, as by a measured position "
                "alone, stays, or leaves factors of lower rank")
        .choice("fit", &O::fit,
                "information of new factors by the covariance of the cropped problem alone (the "
                "thesis), the same scaled so that the whole graph is as certain as it was, or by "
                "the covariance in the whole graph (ncfd and fd)")
        .component<LinearSolver>("linear_solver", &O::linear_solver,
                                 "factorises the whole graph, for fit");
  }
};

/// The whole process (T figure 4.2): crop, marginalise, choose a topology, recover its factors.
class Sparsify final : public Sparsifier {
 public:
  /// `solver`: for the covariance of blankets in the whole graph, which `Fit::blanket` does not
  /// need. Throws `Error` (usage) for a `Fit` that the others cannot follow.
  Sparsify(std::unique_ptr<Topology> topology, std::unique_ptr<FactorRecovery> recovery,
           SparsifyOptions options, std::unique_ptr<LinearSolver> solver = nullptr);

  Sparsification remove(const Graph& graph, std::span<const int> nodes,
                        const std::function<bool(int)>& step) override;
  void observe(SparsificationObserver observer) override { observer_ = std::move(observer); }
  std::vector<double> losses(const Graph& graph, std::span<const int> nodes) override;

 private:
  /// How one blanket came out.
  struct Solved {
    Marginal marginal;
    std::vector<FactorChoice> topology;
    RecoveryResult recovery;
    std::vector<std::vector<double>> information;  ///< of the new factors, packed
    std::vector<std::string> notes;                ///< of the topology, and of `known_in_graph`
  };
  /// How a blanket is recovered.
  struct Recovered {
    Matrix own_covariance;              ///< `own_covariance` in the whole graph; empty: not used
    std::optional<DenseBlanket> whole;  ///< `within_graph`, where factors are fitted to it
    BlanketProjection coordinates;
  };
  LocalProblem cropped(const WorkGraph& work, std::vector<int> group) const;
  /// What is known in the whole graph, for `Fit` other than `blanket`: as it was a little before,
  /// since what leaves hardly changes the covariances of the others, and each factorisation takes
  /// as long as the graph is large.
  struct WholeGraph {
    WholeGraph(Graph now, LinearSolver& solver)
        : graph(std::move(now)), marginals(graph, solver), regular(marginals.factorize().ok) {}
    Graph graph;
    GraphMarginals marginals;
    bool regular;
  };
  /// `in_graph`: as `SparsifyOptions::fit` says; otherwise by the cropped problem alone.
  Solved solve(const WorkGraph& work, const LocalProblem& local, SparsificationSeconds& seconds,
               bool in_graph);
  void check_fit() const;
  WholeGraph& whole_graph(const WorkGraph& work);
  Matrix known_in_graph(const WorkGraph& work, const LocalProblem& local, Solved& solved,
                        SparsificationSeconds& seconds);
  Recovered prepared(const DenseBlanket& dense, Matrix own_covariance,
                     SparsificationSeconds& seconds) const;
  void recover(const Recovered& of, Solved& solved, SparsificationSeconds& seconds);
  static void collect(const WorkGraph& work, Sparsification& result);
  void add_factors(WorkGraph& work, const LocalProblem& local, const Solved& solved);
  std::shared_ptr<const FactorType> pair_type(const std::shared_ptr<const FactorType>& relative,
                                              const std::vector<std::array<int, 2>>& between);
  void take_out(WorkGraph& work, std::vector<int> group, Sparsification& result);
  std::vector<std::vector<int>> groups(const WorkGraph& work, std::span<const int> nodes) const;

  std::unique_ptr<Topology> topology_;
  std::unique_ptr<FactorRecovery> recovery_;
  SparsifyOptions options_;
  std::unique_ptr<LinearSolver> solver_;
  std::unique_ptr<WholeGraph> whole_;  ///< of the graph that nodes are removed from
  SparsificationObserver observer_;
  struct PairType {
    std::shared_ptr<const FactorType> relative;
    std::vector<std::array<int, 2>> between;
    std::shared_ptr<const FactorType> type;
  };
  std::vector<PairType> pair_types_;
  LinearConstraints constraints_;
};

}  // namespace cairn::sparsify
