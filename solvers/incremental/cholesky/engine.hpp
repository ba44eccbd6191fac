// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/update/elimination.hpp"
#include "covariances.hpp"
#include "factorization.hpp"
#include "gauge_watch.hpp"
#include "job.hpp"
#include "models.hpp"
#include "motions.hpp"
#include "pace.hpp"
#include "revisits.hpp"
#include "states.hpp"
#include "substitution.hpp"
#include "system.hpp"
#include "tree.hpp"

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

/// What a factor's chi2 may be off by rounding, where its information is ordinary.
inline constexpr double kRounding = 1e-18;

/// The fallback optimizer for when Gauss-Newton diverges. Copies of an engine share it, in all
/// threads.
struct Rescuer {
  std::unique_ptr<Optimizer> optimizer;
  std::mutex mutex;
};

/// A new variable that waits: where it is from another one, which moves while it waits.
struct Follower {
  std::int32_t variable, leader;
  std::vector<double> relative;  ///< x_leader⁻¹ x_variable, both of one Lie group
};

/// What an engine knows from one update to the next, but for the graph and the tree.
struct EngineState {
  EngineState(const Settings& settings, std::shared_ptr<Rescuer> rescuer,
              const block::Kernels& kernels)
      : settings_(settings), rescuer_(std::move(rescuer)), kernels_(&kernels), tree_(kernels) {}

  Settings settings_;
  std::shared_ptr<Rescuer> rescuer_;
  const block::Kernels* kernels_;
  System system_;
  States states_;
  Tree tree_;
  Factorization factorization_;
  Substitution substitution_;
  Motions motions_;
  Models models_;
  GaugeWatch gauge_;
  Covariances covariances_;
  std::vector<std::uint8_t> held_;
  std::vector<std::uint8_t> live_variable_, live_factor_;
  std::vector<std::vector<std::int32_t>> factors_of_;
  std::vector<std::int64_t> touched_at_;  // by variable: update
  Revisits revisits_;
  std::vector<Expected> expected_;  // soon
  std::int64_t prepared_ = 0;       // variables so far
  std::vector<std::int32_t>
      touched_;  // variables whose part of H has changed since the last solution
  std::vector<std::int32_t> sources_;  // … or of the right-hand side alone
  Steps steps_;                        // none between calls
  std::vector<std::int32_t>
      moved_;  // variables that steps have moved since factors were last evaluated
  std::vector<std::uint8_t> has_moved_;  // by variable: whether it is one of them
  std::vector<std::int32_t> retiring_;
  std::vector<std::int64_t> checked_at_;  // by factor: to visit each once
  std::int64_t check_ = 0;
  std::int64_t time_ = 0;
  bool structure_changed_ = false;
  bool broken_ = false;
  bool undetermined_ = false;  // see `set_undetermined`
  std::int64_t loads_ = 0;     // so many times everything was numbered anew
  bool exhausted_ = false;     // the last solution has used up its iterations
  bool gauge_is_old_ = false;
  int dead_ = 0;
  int live_factors_ = 0;
  double rounding_scale_ = 0.0;                                   // of `rounding`: sum over factors
  bool rounding_is_old_ = false;                                  // that sum is to be taken anew
  std::map<const VariableType*, std::vector<double>> positions_;  // see `Engine::position`
  double cost_ = 0.0;                                             // sum over factors
  double gained_ = 0.0;        // of the cost, by steps since factors were evaluated
  bool must_look_ = false;     // something has been removed or changed: `gained_` is
                               // no measure then
  int others_ = 0;             // factors of several variables that depend on rigid
                               // motions of these
  double left_share_ = 1.0;    // how much of the shortfall was left to gain
  double decrease_ = 0.0;      // of the last solution: gᵀH⁻¹g
  std::vector<FactorId> ids_;  // by factor, rising
  FactorId next_id_ = 0;
  std::vector<std::uint8_t> is_source_;  // by variable
  Pace pace_;
  Job job_;
  std::int32_t admitted_ = 0;  // so many factors are in H; the others wait for the job to end
  int unsolved_ = 0;           // of them, since the last job began
  std::vector<Follower> followers_;
  /// The estimate as it is to be seen while what the engine has is not proven.
  std::optional<Estimate> shown_;
  std::vector<double> gradients_;       // g of `sources_` after the last evaluation, as in `System`
  std::vector<std::int32_t> looked_;    // factors of the last evaluation
  std::vector<std::int32_t> together_;  // those of them that are evaluated at a time
  double looked_at_ = 0.0;              // what steps had gained before the last evaluation
  double mismatch_ = 0.0;   // of factors on several variables that are not relative, then
  double shortfall_ = 0.0;  // by how much more than expected the cost was then
};

/// Solves the nonlinear least-squares problem of a graph that changes: keeps its linear models,
/// their normal equations and the Cholesky factor, and brings all three up to date with what has
/// changed.
///
/// Variables and factors are numbered as in `graph()`. Nothing is solved before `solve` is called.
class Engine : private EngineState {
 public:
  Engine(const Settings& settings, std::shared_ptr<Rescuer> rescuer);
  Engine(const Engine& other);
  Engine& operator=(const Engine&) = delete;

  /// The graph: structure and measurements are current, its states are those at which it was loaded
  /// (see `write_back`).
  const Graph& graph() const { return graph_; }
  /// x_v at the current estimate, ambient_size doubles. Changes nothing.
  std::vector<double> x(int v) const;
  /// All states at the current estimate. Changes nothing.
  Estimate current() const { return shown_ ? *shown_ : settled(tree_, states_); }
  /// The factor's number in the graph, or -1.
  std::int32_t place_of(FactorId id) const {
    const auto found = std::ranges::lower_bound(ids_, id);
    const auto f = found - ids_.begin();
    const bool there = found != ids_.end() && *found == id;
    return there && f < std::ssize(live_factor_) && live_factor_[f] ? static_cast<std::int32_t>(f)
                                                                    : -1;
  }
  FactorId next_id() const { return next_id_; }
  /// Takes what has been removed out of the graph: everything is numbered and linearised anew.
  void compact();
  /// Whether most of the graph has been removed: arrays are twice as large as they need to be, and
  /// `compact` costs no more for each variable and factor that has left than adding one does.
  bool mostly_dead() const { return 2 * dead_ > states_.size() + models_.size(); }

  /// To be called for what has been added at the end of the graph, by `edit`.
  Graph& edit() { return graph_; }
  void added_variable();
  void added_factor();
  /// A measurement has been replaced.
  void changed_factor(int f);
  void remove_factor(int f);
  /// All its factors must have been removed.
  void remove_variable(int v);
  bool live_factor(int f) const { return live_factor_[f]; }
  bool live_variable(int v) const { return live_variable_[v]; }
  const std::vector<std::int32_t>& factors_of(int v) const { return factors_of_[v]; }
  bool held(int v) const { return held_[v]; }
  /// Whether factors have been removed or changed since it was last found out what is held.
  bool gauge_is_old() const { return gauge_is_old_; }
  /// Finds it out.
  void settle_gauge();
  /// What takes the place of these variables (`cairn::eliminate`), linearised at the current
  /// estimate. Changes nothing, also where it throws.
  Elimination eliminate(std::span<const int> variables);
  /// Variables that have been anchored to fix the gauge since this was last asked.
  std::vector<std::int32_t> take_anchored() { return std::exchange(anchored_, {}); }
  /// Variables whose last factor has been removed since this was last asked, and that are still
  /// there without any.
  std::vector<std::int32_t> take_disconnected();
  /// Gives the selected factors a loss, and all others none.
  void set_loss(const std::shared_ptr<const Loss>& loss, const FactorSelector& which);
  /// Ids of the factors that are there, rising.
  std::vector<FactorId> live_ids() const;

  /// Solves until the estimate is as accurate as it is to be, or the iterations are up.
  ///
  /// With a limit of time [s] (0: none) the work stops where the next piece of it would exceed the
  /// limit, and is continued by the next call. Until it has ended, factors that are added wait for
  /// it, and their new variables move with those that they are joined with; the estimate is the
  /// last one whose chi2 was evaluated. What is `owed` then counts the factors that this is about,
  /// and those that wait.
  void solve(double max_seconds, UpdateReport& report);
  /// Whether the tree is the factor of all that has been added; if not, there is a job or something
  /// to be solved for. Nothing may be removed or changed while there is a job: solve without a
  /// limit before.
  bool up_to_date() const { return !busy() && touched_.empty(); }
  bool busy() const { return job_.stage != Job::Stage::none; }
  /// The clock that limits refer to, for tests.
  void set_clock(Pace::Clock clock) { pace_.set_clock(std::move(clock)); }
  const Pace& pace() const { return pace_; }
  void set_pace(const Pace& pace) { pace_ = pace; }
  /// What factors, the fallback optimizer and the clock answer is recorded there, or taken from
  /// there; null: neither. A copy of the engine does neither.
  void keep_answers(Answers* answers);
  /// Whether the factors leave something free: then no factorisation of H is trusted, whatever
  /// rounding makes of its pivots, and the estimate is that of the fallback optimizer.
  void set_undetermined(bool undetermined) {
    undetermined_ = undetermined;
    broken_ = broken_ || undetermined;
  }
  /// Whether factors that were added wait for a job to end.
  bool has_waiting() const { return admitted_ < models_.size(); }
  /// Changes whenever variables and factors are numbered anew.
  std::int64_t loads() const { return loads_; }
  /// Relinearises everything at the current estimate, with a new order, until it has converged.
  void solve_fully(UpdateReport& report);
  /// Σ ρ(‖r‖²) at the current estimate.
  double chi2() const;
  /// A graph of its own of what is live, at the current estimate.
  Graph snapshot() const;
  /// The graph's states become the current estimate.
  void write_back();

  std::int64_t doubles() const { return system_.doubles() + models_.doubles() + tree_.doubles(); }

  /// Which covariances are to be kept up to date; by `update_covariances`, after solving.
  Covariances& covariances() { return covariances_; }
  MarginalsBy update_covariances() {
    return covariances_.update(system_, tree_, substitution_, held_);
  }
  /// Σ_ab of steps as seen from the poses (x ⊕ δ), size_a × size_b, column-major: a kept block or
  /// by solving. False if H is singular, if only to rounding.
  bool covariance(int a, int b, double* block);
  /// The rows of Σ_vb for all of `rows`, one below the other, by solving.
  bool covariance_column(std::span<const std::int32_t> rows, int b, double* column);
  /// So many times a variable was detached since it was expected soon.
  std::int64_t prepared() const { return prepared_; }
  const Tree& tree() const { return tree_; }
  const System& system() const { return system_; }
  const Models& models() const { return models_; }
  const States& states() const { return states_; }

 private:
  /// Whether variances of v, in its frame, have digits (`kFewestDigits`): those of its unknowns
  /// from `first` on, `step` doubles apart.
  bool have_digits(int v, std::int32_t first, std::int32_t count, const double* variances,
                   std::int64_t step) const;
  void load(Graph graph, std::vector<FactorId> ids);
  Elimination eliminate_here(std::span<const int> variables);
  void optimize(Graph& graph, double tolerance, UpdateReport& report);
  void watch_gauge_anew();
  void hold(std::int32_t v, bool held);
  bool is_other(int f) const;
  void put_in(int f);
  void take_out(int f);
  void sum_anew(std::int32_t v);
  void relinearize(int f);
  void relinearize_all();
  void touch(std::int32_t v);
  void follow(std::int32_t v);
  void settle(std::int32_t v) { motions_.settle(tree_, states_, v); }
  void apply_steps();
  void move_states(std::span<const std::int32_t> variables);
  void turn_models(const Motions::Turn& turn);
  void collect_moved_factors();
  void count_bonds(int f, std::int32_t sign);
  void admit();
  bool admit_waiting();
  bool follows(std::int32_t v) const;
  void note_follower(int f);
  void place_followers();
  void show_what_is_proven();
  // What a job consists of (see `Job`): `…_more` goes on, and is false if there was no time for
  // all.
  bool begin_job(UpdateReport& report);
  bool go_on(UpdateReport& report);
  bool advance(UpdateReport& report);
  void end_job();
  bool order_affected(UpdateReport& report);
  void prepare_for_revisits();
  bool factorize_more(UpdateReport& report);
  void factorized(UpdateReport& report);
  void not_positive_definite(UpdateReport& report);
  bool set_right_hand_side_more();
  bool move_more();
  void look(UpdateReport& report);
  bool evaluate_more();
  void evaluate(std::span<const std::int32_t> factors);
  void evaluated(UpdateReport& report);
  void prove();
  void improve(UpdateReport& report);
  bool set_aside_more();
  bool relinearize_more(UpdateReport& report);
  void begin_relinearizing_all();
  bool relinearize_all_more();
  void linearized_all(UpdateReport& report);
  void diverged(UpdateReport& report);
  void damp_more();
  void give_up();
  void judge(UpdateReport& report);
  // Parts of it at once, without a limit.
  bool bring_factor_up_to_date(UpdateReport& report);
  void step_and_look(UpdateReport& report);
  bool step_fully(UpdateReport& report);
  bool negligible();
  /// Σ ρ(‖r‖²), as far as it is known.
  double cost() const { return std::max(cost_ - gained_, 0.0); }
  double share(double part) const;
  /// What rounding may do to the cost.
  double rounding();
  double rounding_scale(int f);
  std::pair<std::span<const double>, double> position(std::int32_t v);
  void touch_all();
  void bring_back();
  void step_back();
  void rescue(UpdateReport& report, double tolerance);
  class Turn;
  void as_seen_from(std::span<const std::int32_t> rows, int b, double* blocks,
                    std::int64_t stride) const;
  void add_source(std::int32_t v);
  Graph clean_graph() const;
  void remove_dead(Graph& graph) const;
  Values values_of(const Estimate& estimate) const;

  AnswersKept answers_;
  std::vector<std::int32_t> anchored_;
  std::vector<std::int32_t> disconnected_;  // some may have new factors since, or be gone

  Graph graph_;
};

}  // namespace cairn::incremental
