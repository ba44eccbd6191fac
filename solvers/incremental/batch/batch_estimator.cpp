// SPDX-License-Identifier: BSD-3-Clause
#include "batch_estimator.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include <fmt/core.h>

#include "cairn/evaluation/batch_step.hpp"
#include "cairn/graph/free_directions.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/graph/id_text.hpp"
#include "cairn/linear/normal_equations.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"
#include "cairn/types/loss.hpp"

namespace cairn {
namespace {

using Clock = std::chrono::steady_clock;

bool only_adds(const GraphUpdate& update) {
  return update.changed.empty() && update.marginalized.empty() && update.removed_factors.empty() &&
         update.removed_variables.empty();
}

constexpr const char* kStepNotFinite =
    "not converged: the step is not finite, and the estimate stays";

bool is_finite(std::span<const double> numbers) {
  return std::ranges::all_of(numbers, [](double x) { return std::isfinite(x); });
}

void add_seconds(const Seconds& from, UpdateSeconds& to) {
  to.linearize += from.linearize + from.update;
  to.order += from.analyze;
  to.factorize += from.factorize;
  to.solve += from.solve;
}

}  // namespace

BatchEstimator::BatchEstimator(int every, const Stop& stop, std::shared_ptr<BatchTools> tools)
    : every_(every), stop_(stop), tools_(std::move(tools)) {}

/// All that an update changes, to go back to where it fails half-way: on numbers, or since a factor
/// throws while it is evaluated. What an update only adds is taken out again; for any other the
/// graph is copied.
class BatchEstimator::Before {
 public:
  Before(BatchEstimator& of, const GraphUpdate& update)
      : adds_(only_adds(update)),
        variables_(of.graph_.variable_count()),
        factors_(of.graph_.factor_count()),
        values_(of.graph_.values()),
        ids_(of.ids_),
        linearized_at_(of.linearized_at_),
        since_batch_(of.since_batch_),
        must_batch_(of.must_batch_),
        unsolved_factors_(of.unsolved_factors_),
        last_(of.last_),
        told_(of.told_),
        memory_(of.memory_),
        diagonal_(std::exchange(of.diagonal_, {})),  // no update keeps them
        diagonal_begin_(std::exchange(of.diagonal_begin_, {})),
        blocks_(std::exchange(of.blocks_, {})) {
    if (adds_) return;
    graph_ = of.graph_.clone();
    losses_ = of.losses_;
    crosses_ = of.crosses_;
  }

  void restore(BatchEstimator& to) {
    if (adds_) {
      take_out_what_is_new(to);
    } else {
      to.graph_ = std::move(graph_);
      to.losses_ = std::move(losses_);
      to.crosses_ = std::move(crosses_);
    }
    to.ids_ = std::move(ids_);
    to.linearized_at_ = std::move(linearized_at_);
    to.since_batch_ = since_batch_;
    to.must_batch_ = must_batch_;
    to.unsolved_factors_ = unsolved_factors_;
    to.last_ = last_;
    to.told_ = std::move(told_);
    to.memory_ = memory_;
    to.covariances_.reset();  // the solver has another factorisation by now
    to.tools_->user = nullptr;
    to.diagonal_ = std::move(diagonal_);
    to.diagonal_begin_ = std::move(diagonal_begin_);
    to.blocks_ = std::move(blocks_);
  }

 private:
  void take_out_what_is_new(BatchEstimator& to) {
    Graph& graph = to.graph_;
    std::vector<bool> factors(static_cast<std::size_t>(graph.factor_count()), false);
    std::vector<bool> variables(static_cast<std::size_t>(graph.variable_count()), false);
    std::fill(factors.begin() + factors_, factors.end(), true);
    std::fill(variables.begin() + variables_, variables.end(), true);
    for (int v = variables_; v < graph.variable_count(); ++v) to.losses_.removed_variable(graph, v);
    graph.remove(factors, variables);
    values_.pools.resize(graph.values().pools.size());  // types that were new keep theirs, empty
    graph.set_values(std::move(values_));
  }

  bool adds_;
  int variables_, factors_;
  Values values_;
  FactorIds ids_;
  Values linearized_at_;
  int since_batch_;
  bool must_batch_;
  int unsolved_factors_;
  Id last_;
  std::set<std::string> told_;
  std::int64_t memory_;
  std::vector<double> diagonal_;
  std::vector<std::size_t> diagonal_begin_;
  std::map<std::pair<Id, Id>, std::vector<double>> blocks_;
  // Of an update that does more than add:
  Graph graph_;
  LossRule losses_;
  std::set<std::pair<Id, Id>> crosses_;
};

UpdateReport BatchEstimator::update(const GraphUpdate& update, const UpdateOptions& options) {
  const auto begin = Clock::now();
  const std::lock_guard lock(tools_->mutex);
  GraphUpdate checked = update;
  check_update(graph_, ids_, checked);
  Before before(*this, checked);
  UpdateReport report;
  try {
    carry_out(checked, options, report);
  } catch (...) {
    before.restore(*this);
    throw;
  }
  report.seconds.total = seconds_since(begin);
  return report;
}

void BatchEstimator::carry_out(const GraphUpdate& update, const UpdateOptions& options,
                               UpdateReport& report) {
  if (!update.variables.empty()) last_ = update.variables.back().id;
  const AppliedUpdate applied = apply_update(update, graph_, ids_, losses_);
  forget_covariances();
  report.first_factor = applied.first_factor;
  report.priors = applied.priors;
  must_batch_ = must_batch_ || !only_adds(update);
  unsolved_factors_ += static_cast<int>(std::ssize(update.factors));
  ++since_batch_;
  if (options.defer && !options.full) return;
  if (options.full || must_batch_ || since_batch_ >= every_) {
    batch_step(options, report);
  } else {
    linear_step(report);
  }
  if (report.ok) compute_kept(report);
}

void BatchEstimator::batch_step(const UpdateOptions& options, UpdateReport& report) {
  if (graph_.factor_count() == 0) return;
  Stop stop = stop_;
  stop.max_seconds = options.max_seconds;
  tools_->user = nullptr;
  const Summary summary = tools_->optimizer->optimize(graph_, stop);
  for (const std::string& sentence : summary.notes) note(sentence, report);
  report.doubts = summary.doubts;
  const std::string why = report_batch_step(summary, stop_, options, graph_.factor_count(), report);
  if (!why.empty()) doubt(why, report, options.full);
  report_free(find_free_directions(graph_), report);
  report.affected_variables = report.iterations * graph_.variable_count();
  if (report.iterations > 0)
    report.relinearized_factors = std::max(0, graph_.factor_count() - unsolved_factors_);
  add_seconds(summary.seconds, report.seconds);
  memory_ = std::max(memory_, 8 * summary.solver.factor_nonzeros);
  linearized_at_ = graph_.values();
  since_batch_ = 0;
  unsolved_factors_ = 0;
  must_batch_ = report.owed > 0;
}

/// The step from the points of linearisation, of all variables, that the linear system of all
/// factors asks for.
void BatchEstimator::linear_step(UpdateReport& report) {
  extend_linearization_points();
  tools_->user = nullptr;
  NormalEquations equations(graph_, *tools_->solver);
  if (const std::string gauge = equations.gauge().describe(graph_); !gauge.empty())
    note(gauge, report);
  if (equations.size() == 0) return;
  equations.linearize(linearized_at_);
  report_free(find_free_directions(graph_, equations.gauge(), linearized_at_), report);
  const Factorization factorization = equations.factorize();
  report.ok = report.ok && factorization.ok;
  if (report.ok) {
    std::vector<double> step(static_cast<std::size_t>(equations.size()));
    equations.solve(step);
    report.iterations = 1;
    report.converged = is_finite(step);
    if (!report.converged) return doubt(kStepNotFinite, report);
    Values values;
    equations.retract(linearized_at_, step, values);
    graph_.set_values(std::move(values));
    report.affected_variables = graph_.variable_count();
    unsolved_factors_ = 0;
  } else if (!factorization.ok) {
    doubt(equations.explain(factorization), report);
  }
  add_seconds(equations.seconds(), report.seconds);
  memory_ = std::max(memory_, 8 * tools_->solver->stats().factor_nonzeros);
}

void BatchEstimator::extend_linearization_points() {
  const Values& states = graph_.values();
  linearized_at_.pools.resize(states.pools.size());
  for (std::size_t p = 0; p < states.pools.size(); ++p) {
    AlignedVector& points = linearized_at_.pools[p];
    points.insert(points.end(),
                  states.pools[p].begin() + static_cast<std::ptrdiff_t>(points.size()),
                  states.pools[p].end());
  }
}

void BatchEstimator::note(const std::string& sentence, UpdateReport& report, bool again) {
  if (told_.insert(sentence).second || again) report.notes.push_back(sentence);
}

void BatchEstimator::doubt(const std::string& sentence, UpdateReport& report, bool again) {
  report.doubts.push_back(sentence);
  note(sentence, report, again);
}

/// An update after which something is free is not ok, and every one says what.
void BatchEstimator::report_free(const FreeDirections& free, UpdateReport& report) {
  if (free.empty()) return;
  report.ok = false;
  std::string sentence = find_free_directions(graph_).describe(graph_);
  if (sentence.empty()) sentence = free.describe(graph_);
  if (std::ranges::find(report.notes, sentence) == report.notes.end())
    report.notes.push_back(std::move(sentence));
}

void BatchEstimator::compute_kept(UpdateReport& report) {
  std::erase_if(crosses_, [&](const auto& pair) { return !has(pair.first) || !has(pair.second); });
  if ((kept_ == KeptMarginals::none && crosses_.empty()) || graph_.variable_count() == 0) return;
  const auto begin = Clock::now();
  report.marginals_by = MarginalsBy::recomputation;
  if (GraphMarginals* all = covariances()) {
    std::set<std::pair<Id, Id>> wanted = crosses_;
    if (kept_ == KeptMarginals::last && has(last_)) wanted.emplace(last_, last_);
    for (const auto& [a, b] : wanted) {
      const std::pair<int, int> pair(index(a), index(b));
      blocks_[{a, b}] = all->blocks({&pair, 1});
    }
    if (kept_ == KeptMarginals::diagonal) keep_diagonal(*all);
  }
  report.seconds.marginals += seconds_since(begin);
}

void BatchEstimator::keep_diagonal(GraphMarginals& all) {
  diagonal_ = all.diagonal();
  diagonal_begin_.clear();
  std::size_t next = 0;
  for (int v = 0; v < graph_.variable_count(); ++v) {
    diagonal_begin_.push_back(next);
    next += block_size(v, v);
  }
}

GraphMarginals* BatchEstimator::covariances() {
  require_marginals();
  if (!covariances_ || tools_->user != this) {
    tools_->user = this;
    covariances_.emplace(graph_, *tools_->solver);
    determined_ = covariances_->factorize().ok;
  }
  return determined_ ? &*covariances_ : nullptr;
}

void BatchEstimator::require_marginals() const {
  if (query<Marginals>(*tools_->solver)) return;
  throw Error(ErrorCode::usage,
              "the estimator's linear solver cannot give covariances (it lacks the ability "
              "'marginals'); linear_solver=block_cholesky can");
}

void BatchEstimator::keep_marginals(KeptMarginals kept) {
  if (kept != KeptMarginals::none) require_marginals();
  kept_ = kept;
}

std::size_t BatchEstimator::block_size(int a, int b) const {
  return static_cast<std::size_t>(graph_.type(a).tangent_size()) * graph_.type(b).tangent_size();
}

int BatchEstimator::index(Id id) const {
  if (const auto v = graph_.find(id)) return *v;
  throw Error(ErrorCode::usage, "there is no variable " + id_text(id));
}

void BatchEstimator::keep_cross(Id a, Id b) {
  require_marginals();
  index(a);
  index(b);
  crosses_.emplace(a, b);
}

bool BatchEstimator::covariance(Id a, Id b, std::span<double> block) {
  const int row = index(a), column = index(b);
  if (block.size() != block_size(row, column)) {
    throw Error(ErrorCode::usage,
                fmt::format("the covariance of {} and {} is a block of {} numbers, not {}",
                            graph_.describe_variable(row), graph_.describe_variable(column),
                            block_size(row, column), block.size()));
  }
  if (const auto kept = blocks_.find({a, b}); kept != blocks_.end()) {
    std::ranges::copy(kept->second, block.begin());
    return true;
  }
  if (a == b && !diagonal_.empty()) {
    std::copy_n(diagonal_.begin() + static_cast<std::ptrdiff_t>(diagonal_begin_[row]), block.size(),
                block.begin());
    return true;
  }
  const std::lock_guard lock(tools_->mutex);
  GraphMarginals* all = covariances();
  const std::pair<int, int> pair(row, column);
  if (all) std::ranges::copy(all->blocks({&pair, 1}), block.begin());
  return all != nullptr;
}

bool BatchEstimator::covariance_column(Id id, std::span<const Id> variables,
                                       std::span<double> out) {
  const int column = index(id), columns = graph_.type(column).tangent_size();
  std::vector<std::int64_t> begin;  // of each variable's rows in a whole column
  std::int64_t rows = 0, height = 0;
  for (int v = 0; v < graph_.variable_count(); ++v) {
    begin.push_back(rows);
    rows += graph_.type(v).tangent_size();
  }
  for (const Id row : variables) height += graph_.type(index(row)).tangent_size();
  if (std::ssize(out) != height * columns) {
    throw Error(ErrorCode::usage,
                fmt::format("that column of the covariance has {} numbers, not {}",
                            height * columns, out.size()));
  }
  const std::lock_guard lock(tools_->mutex);
  GraphMarginals* all = covariances();
  if (!all) return false;
  const std::vector<double> whole = all->column(column);
  auto to = out.begin();
  for (int c = 0; c < columns; ++c) {
    for (const Id row : variables) {
      const int v = index(row);
      to = std::copy_n(whole.begin() + c * rows + begin[v], graph_.type(v).tangent_size(), to);
    }
  }
  return true;
}

void BatchEstimator::set_loss(std::shared_ptr<const Loss> loss, const FactorSelector& which) {
  graph_.set_loss(loss, which);
  losses_ = LossRule(std::move(loss), which, graph_);
  forget_covariances();
  must_batch_ = true;
}

std::vector<Id> BatchEstimator::variables() const {
  std::vector<Id> ids;
  for (int v = 0; v < graph_.variable_count(); ++v) ids.push_back(graph_.id(v));
  return ids;
}

std::vector<FactorId> BatchEstimator::factors() const {
  std::vector<FactorId> ids;
  for (int f = 0; f < graph_.factor_count(); ++f) ids.push_back(ids_.id(f));
  return ids;
}

Factor BatchEstimator::factor(FactorId id) const {
  if (const auto f = ids_.position(id)) return graph_.factor(*f);
  throw Error(ErrorCode::usage, fmt::format("there is no factor {}", id));
}

void BatchEstimator::forget_covariances() {
  covariances_.reset();
  diagonal_.clear();
  blocks_.clear();
}

/// The loss is an option too.
void BatchEstimator::reset() {
  graph_ = {};
  losses_.clear();
  ids_ = {};
  linearized_at_ = {};
  since_batch_ = unsolved_factors_ = 0;
  must_batch_ = true;
  crosses_.clear();
  told_.clear();
  forget_covariances();
}

std::unique_ptr<Estimator> BatchEstimator::clone() const {
  auto copy = std::make_unique<BatchEstimator>(every_, stop_, tools_);
  copy->graph_ = graph_.clone();
  copy->losses_ = losses_;
  copy->ids_ = ids_;
  copy->linearized_at_ = linearized_at_;
  copy->since_batch_ = since_batch_;
  copy->must_batch_ = must_batch_;
  copy->unsolved_factors_ = unsolved_factors_;
  copy->last_ = last_;
  copy->kept_ = kept_;
  copy->diagonal_ = diagonal_;
  copy->diagonal_begin_ = diagonal_begin_;
  copy->blocks_ = blocks_;
  copy->crosses_ = crosses_;
  copy->told_ = told_;
  copy->memory_ = memory_;
  return copy;
}

}  // namespace cairn
