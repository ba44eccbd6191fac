// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/update/elimination.hpp"
#include "cost_rounding.hpp"
#include "covariances.hpp"
#include "gauge_watch.hpp"
#include "models.hpp"
#include "motions.hpp"
#include "revisits.hpp"
#include "states.hpp"
#include "substitution.hpp"
#include "system.hpp"
#include "tree.hpp"
#include "variable_set.hpp"

namespace cairn::incremental {

/// A graph that is copied with what refers to it.
class OwnGraph {
 public:
  explicit OwnGraph(Graph graph) : graph_(std::move(graph)) {}
  OwnGraph(const OwnGraph& other) : graph_(other.graph_.clone()) {}
  OwnGraph(OwnGraph&&) = default;
  OwnGraph& operator=(const OwnGraph&) = delete;
  OwnGraph& operator=(OwnGraph&&) = default;
  ~OwnGraph() = default;

  Graph& operator*() { return graph_; }
  const Graph& operator*() const { return graph_; }
  const Graph* operator->() const { return &graph_; }

 private:
  Graph graph_;
};

/// When variables were last joined by a factor, in solutions.
struct Visits {
  std::int64_t now = 0;
  std::vector<std::int64_t> last;  ///< by variable
  Revisits revisits;

  void note(std::int32_t v);
};

/// What is to be solved for.
struct Change {
  std::vector<std::int32_t> touched;   ///< variables whose part of H has changed
  VariableSet sources;                 ///< or the right-hand side alone
  std::vector<std::int32_t> retiring;  ///< variables that are to leave the tree
  bool of_structure = false;           ///< blocks of H have come or gone
  bool must_look = false;  ///< something has been removed or changed: factors are to be evaluated
  int factors = 0;         ///< that were admitted
};

/// A nonlinear least-squares problem that changes, in all its forms: the graph, the states, the
/// linear models of its factors, their normal equations and the tree of their Cholesky factor; and
/// what has changed in these since they were last solved.
///
/// Variables and factors are numbered as in the graph. What leaves the graph keeps its number, but
/// is not `live`. Factors become a part of the normal equations when they are admitted, in their
/// order. A variable is `held`, constant, as long as it has no factor, and where the gauge would be
/// free without that.
class Problem {
 public:
  explicit Problem(const block::Kernels& kernels) : Problem(kernels, Graph()) {}
  /// Another graph with everything numbered anew, linearised at its states; its factors have these
  /// ids. Time, the covariances to be kept and `Change::must_look` are as here. What factors answer
  /// is kept in `answers`, if not null.
  Problem anew(Graph graph, std::span<const FactorId> ids, Answers* answers) const;

  const Graph& graph() const { return *graph_; }
  Graph& edit() { return *graph_; }
  /// To be called for what has been added at the end of the graph.
  void add_variable();
  void add_factor(FactorId id);
  int waiting() const { return models.size() - admitted_; }
  int admitted() const { return admitted_; }
  void admit_waiting();
  /// A measurement has been replaced.
  void change_factor(int f);
  void remove_factor(int f);
  /// All its factors must have been removed.
  void remove_variable(int v);
  bool live_factor(int f) const { return factors_[f].live; }
  bool live_variable(int v) const { return variables_[v].live; }
  int live_factors() const { return live_factors_; }
  /// Variables and factors that have been removed.
  int dead() const { return dead_; }
  /// The graph without these, at an estimate.
  Graph clean_graph(const Estimate& estimate) const;
  const std::vector<std::int32_t>& factors_of(int v) const { return variables_[v].factors; }
  /// The factor's number in the graph, or -1.
  std::int32_t place_of(FactorId id) const;
  std::vector<FactorId> live_ids() const;

  bool held(int v) const { return held_[v]; }
  bool is_free(int v) const { return live_variable(v) && !held(v); }
  bool gauge_is_old() const { return gauge_is_old_; }
  void settle_gauge();
  std::vector<std::int32_t> take_anchored() { return std::exchange(anchored_, {}); }
  std::vector<std::int32_t> take_disconnected();
  Elimination eliminate(std::span<const int> leaving);

  /// x_v with what is deferred of its motions. Changes nothing.
  std::vector<double> x(int v) const;
  void settle(std::int32_t v) { motions.settle(tree, states, v); }
  void settle_all() { motions.settle_all(tree, states); }
  /// Applies the deferred steps to a variable: before its factors change.
  void follow(std::int32_t v);
  /// Moves some of the variables that `steps` has changed.
  void move(std::span<const std::int32_t> variables);
  /// Corrects the models of what joins the variable of a turn with the subtree.
  void turn_models(const Motions::Turn& turn);
  /// The factors of all variables that have moved since this was last asked.
  std::vector<std::int32_t> take_moved_factors();

  /// Σ ρ(‖r‖²) over the factors, each when it was last evaluated, and what rounding may do to it.
  double cost() const { return cost_; }
  double rounding();
  /// Evaluates factors that are alike again. Where a factor type throws, nothing has changed.
  void evaluate(std::span<const std::int32_t> factors);
  void relinearize(int f);
  // All of them: `follow_and_touch` all variables, `clear_values`, then `linearize` all factors.
  void follow_and_touch(int v);
  void clear_values();
  void linearize(int f);
  /// Whether a factor is anything but a relative one between variables of a group.
  bool is_other(int f) const;
  /// Factors of several variables that are.
  int others() const { return others_; }

  /// What has come since the last solution is to be solved for; states can be undone to here.
  void begin_solution();
  void right_hand_side(std::int32_t v) {
    settle(v);
    models.right_hand_side(system, states, v);
  }
  /// Where something is taken out, what was little may have become much.
  void bring_back();
  /// Marks what has been touched, and what is to retire, as affected in the tree.
  void mark_affected();
  /// The tree's structure is up to date: what has been touched is to be solved for.
  void take_touched();

  MarginalsBy update_covariances() { return covariances.update(system, tree, substitution, held_); }
  std::int64_t doubles() const { return system.doubles() + models.doubles() + tree.doubles(); }

  System system;
  States states;
  Models models;
  Tree tree;
  Substitution substitution;
  Motions motions;
  Steps steps;  ///< none between calls
  Covariances covariances;
  Visits visits;
  Change change;

 private:
  struct VariableRecord {
    std::vector<std::int32_t> factors;
    bool live = true;
  };
  struct FactorRecord {
    FactorId id;
    bool live = true;
    bool is_collected = false;
  };

  Problem(const block::Kernels& kernels, Graph graph) : tree(kernels), graph_(std::move(graph)) {}
  void admit();
  void touch(std::int32_t v) { change.touched.push_back(v); }
  void hold(std::int32_t v, bool held);
  void watch_gauge_anew();
  void put_in(int f);
  void take_out(int f);
  void sum_anew(std::int32_t v);
  void count_bonds(int f, std::int32_t sign);
  void add_source(std::int32_t v);
  Values values_of(const Estimate& estimate) const;

  OwnGraph graph_;
  std::vector<VariableRecord> variables_;
  std::vector<FactorRecord> factors_;  // their ids rise
  std::vector<std::uint8_t> held_;     // by variable
  GaugeWatch gauge_;
  bool gauge_is_old_ = false;  // factors have been removed or changed
  std::vector<std::int32_t> anchored_;
  std::vector<std::int32_t> disconnected_;  // some may have new factors since, or be gone
  VariableSet moved_;                       // by steps since factors were last evaluated
  int admitted_ = 0;                        // so many factors are in H
  int live_factors_ = 0;                    // of them
  int others_ = 0;                          // of them
  int dead_ = 0;
  double cost_ = 0.0;
  CostRounding rounding_;
};

}  // namespace cairn::incremental
