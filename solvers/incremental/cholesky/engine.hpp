// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "answers.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/update/elimination.hpp"
#include "cost_prediction.hpp"
#include "factorization.hpp"
#include "pace.hpp"
#include "pending_poses.hpp"
#include "problem.hpp"
#include "solution.hpp"

namespace cairn::incremental {

/// What can be chosen about the engine.
struct Settings {
  /// By how much chi2 may be above what it would be if everything were relinearised and solved, as
  /// a fraction of it.
  double accuracy = 5e-3;
  /// What lowers chi2 by less than this, and by less than the accuracy allows, is put off until it
  /// adds up.
  double significance = 0.25;
  /// Linear systems solved in one update, at most.
  int iterations = 30;
  /// Variables touched within so many updates are ordered last.
  int recent = 4;
  /// Where a solution costs no more than this, by the cost model of factorisations [ns], it
  /// prepares for nothing: there is little to gain.
  double prepares_above = 1e5;
  std::string kernels = "auto";
};

/// The fallback optimizer for when Gauss-Newton diverges. Copies of an engine share it, in all
/// threads.
struct Rescuer {
  std::unique_ptr<Optimizer> optimizer;
  std::mutex mutex;
};

/// Solves the nonlinear least-squares problem of a graph that changes: brings the linear models of
/// the factors, their normal equations and the Cholesky factor up to date with what has changed,
/// and steps until the estimate is as accurate as it is to be.
///
/// Variables and factors are numbered as in `graph()`. Nothing is solved before `solve` is called.
class Engine {
 public:
  Engine(const Settings& settings, std::shared_ptr<Rescuer> rescuer);
  Engine(const Engine&) = default;
  Engine& operator=(const Engine&) = delete;

  /// What is being solved. By this something is changed or removed, and covariances are kept, but
  /// not while a solution goes on (`busy`): solve without a limit before.
  Problem& problem() { return problem_; }
  const Problem& problem() const { return problem_; }
  /// Structure and measurements are current, the states are those at which it was loaded.
  const Graph& graph() const { return problem_.graph(); }
  /// x_v at the current estimate, ambient_size doubles. Changes nothing.
  std::vector<double> x(int v) const;
  /// All states at the current estimate. Changes nothing.
  Estimate current() const { return shown_ ? *shown_ : settled(problem_.tree, problem_.states); }
  /// Σ ρ(‖r‖²) at the current estimate.
  double chi2() const;
  /// A graph of its own of what is live, at the current estimate.
  Graph snapshot() const { return problem_.clean_graph(current()); }

  /// To be called for what has been added at the end of the graph, by `Problem::edit`.
  void added_variable();
  void added_factor();
  FactorId next_id() const { return next_id_; }
  /// Takes what has been removed out of the graph: everything is numbered and linearised anew.
  void compact();
  /// Whether most of the graph has been removed: arrays are twice as large as they need to be, and
  /// `compact` costs no more for each variable and factor that has left than adding one does.
  bool mostly_dead() const;
  /// Changes whenever variables and factors are numbered anew.
  std::int64_t loads() const { return loads_; }
  /// What takes the place of these variables (`cairn::eliminate`), linearised at the current
  /// estimate. Changes nothing, also where it throws.
  Elimination eliminate(std::span<const int> variables);
  /// Gives the selected factors a loss, and all others none.
  void set_loss(const std::shared_ptr<const Loss>& loss, const FactorSelector& which);

  /// Solves until the estimate is as accurate as it is to be, or the iterations are up.
  ///
  /// With a limit of time [s] (0: none) the work stops where the next piece of it would exceed the
  /// limit, and is continued by the next call. Until it has ended, factors that are added wait for
  /// it, and their new variables move with those that they are joined with; the estimate is the
  /// last one whose chi2 was evaluated. What is `owed` then counts the factors that this is about,
  /// and those that wait.
  void solve(double max_seconds, UpdateReport& report);
  /// Relinearises everything at the current estimate, with a new order, until it has converged.
  void solve_fully(UpdateReport& report);
  /// Whether the tree is the factor of all that has been added; if not, a solution goes on, or
  /// there is something to be solved for.
  bool up_to_date() const { return !busy() && problem_.change.touched.empty(); }
  bool busy() const { return solution_.busy(); }
  /// Whether the factors leave something free: then no factorisation of H is trusted, whatever
  /// rounding makes of its pivots, and the estimate is that of the fallback optimizer.
  void set_undetermined(bool undetermined) {
    undetermined_ = undetermined;
    broken_ = broken_ || undetermined;
  }
  /// The clock that limits refer to, for tests.
  void set_clock(Pace::Clock clock) { pace_.set_clock(std::move(clock)); }
  const Pace& pace() const { return pace_; }
  void set_pace(const Pace& pace) { pace_ = pace; }
  /// What factors, the fallback optimizer and the clock answer is recorded there, or taken from
  /// there; null: neither. A copy of the engine does neither.
  void keep_answers(Answers* answers);

  /// See `covariance_blocks.hpp`; also false where H is not positive definite.
  bool covariance(int a, int b, double* block);
  bool covariance_column(std::span<const std::int32_t> rows, int b, double* column);
  /// So many times a variable was detached since it was expected soon.
  std::int64_t prepared() const { return prepared_; }

 private:
  using Stage = Solution::Stage;
  /// The stage that follows one, or nothing: there was no time for all of that one.
  using Next = std::optional<Stage>;

  bool begin(UpdateReport& report);
  bool go_on(UpdateReport& report);
  Stage end();
  // The stages of a solution:
  Next advance(UpdateReport& report);
  Next order(UpdateReport& report);
  Next factorize(UpdateReport& report);
  bool find_right_hand_side();
  Next set_right_hand_side();
  Next climb();
  Next descend();
  Next move_states();
  Next turn_models(UpdateReport& report);
  Next evaluate(UpdateReport& report);
  Next evaluate_gradients();
  Next decrement(UpdateReport& report);
  Next set_aside();
  Next relinearize(UpdateReport& report);
  Next follow_all();
  Next frame_all();
  Next linearize_all(UpdateReport& report);
  // What follows some of them:
  std::vector<Expected> prepare_for_revisits();
  Stage factorized(UpdateReport& report);
  Stage not_positive_definite(UpdateReport& report);
  Stage look(UpdateReport& report);
  Stage improve(UpdateReport& report);
  Stage begin_relinearizing_all();
  Stage diverged(UpdateReport& report);
  Stage judge(UpdateReport& report);
  void prove();
  void hide_unproven();
  void show_what_is_proven();
  bool negligible();
  bool usable_for(int v) const { return !broken_ || problem_.held(v); }
  double cost() const { return prediction_.cost(problem_.cost()); }
  // Parts of it at once, without a limit:
  void relinearize_all(UpdateReport& report);
  bool bring_factor_up_to_date(UpdateReport& report);
  void step_and_look(UpdateReport& report);
  bool step_fully(UpdateReport& report);
  // Where it does not come to an end:
  void step_back();
  void rescue(UpdateReport& report, double tolerance);
  void optimize(Graph& graph, double tolerance, UpdateReport& report);
  void load(Graph graph, std::span<const FactorId> ids);

  Settings settings_;
  std::shared_ptr<Rescuer> rescuer_;
  Problem problem_;
  Factorization factorization_;
  CostPrediction prediction_;
  Solution solution_;
  Pace pace_;
  PendingPoses pending_;
  /// The estimate as it is to be seen while what the engine has is not proven.
  std::optional<Estimate> shown_;
  AnswersKept answers_;
  FactorId next_id_ = 0;
  std::int64_t loads_ = 0;
  std::int64_t prepared_ = 0;
  bool broken_ = false;  // the tree is not the factor of H, which is not positive definite
  bool undetermined_ = false;
  bool exhausted_ = false;  // the last solution has used up its iterations
};

}  // namespace cairn::incremental
