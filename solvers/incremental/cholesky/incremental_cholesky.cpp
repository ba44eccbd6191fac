// SPDX-License-Identifier: BSD-3-Clause
#include "incremental_cholesky.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/graph/id_text.hpp"
#include "cairn/memory/small_pages.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"
#include "cairn/types/factor_call.hpp"
#include "cairn/types/never_throws.hpp"
#include "cairn/update/elimination.hpp"
#include "cairn/update/graph_update.hpp"
#include "cairn/update/initial_states.hpp"
#include "record.hpp"

namespace cairn::incremental {
namespace {

using Clock = std::chrono::steady_clock;

/// So many states are read one by one.
constexpr int kFew = 8;

/// Whether an update does more than add.
bool takes_out(const GraphUpdate& update) {
  return !update.changed.empty() || !update.marginalized.empty() ||
         !update.removed_factors.empty() || !update.removed_variables.empty();
}

}  // namespace

IncrementalCholesky::IncrementalCholesky(const IncrementalCholeskyOptions& options,
                                         std::shared_ptr<Rescuer> rescuer)
    : options_(options),
      rescuer_(std::move(rescuer)),
      engine_(std::make_unique<Engine>(options.settings, rescuer_)) {}

IncrementalCholesky::IncrementalCholesky(const IncrementalCholesky& other)
    : options_(other.options_),
      rescuer_(other.rescuer_),
      engine_(std::make_unique<Engine>(other.engine())),
      variables_(other.variables_),
      factors_(other.factors_),
      losses_(other.losses_),
      since_solved_(other.since_solved_),
      since_full_(other.since_full_),
      kept_(other.kept_),
      told_(other.told_),
      has_removed_(other.has_removed_),
      watch_(other.watch_),
      watched_load_(other.watched_load_),
      may_throw_(other.may_throw_) {}

IncrementalCholesky::~IncrementalCholesky() = default;

void IncrementalCholesky::refuse_if_lost() const {
  if (!lost_) [[likely]]
    return;
  throw Error(ErrorCode::usage,
              "an earlier update of this estimator has failed half-way, where it could not be "
              "undone; reset it, or go on with a copy from before");
}

void IncrementalCholesky::keep_answers(Answers* answers) {
  answers_.in(answers);
  engine_->keep_answers(answers);
}

// --- updates ---

UpdateReport IncrementalCholesky::update(const GraphUpdate& update, const UpdateOptions& options) {
  refuse_if_lost();
  may_throw_ = may_throw_ || may_throw(update);
  if (may_throw_) begin_step(options);
  try {
    UpdateReport report = carry_out(update, options);
    keep_answers(nullptr);
    before_.reset();
    return report;
  } catch (...) {
    forget_step();
    if (std::exchange(changes_, false)) go_back();
    before_.reset();
    throw;
  }
}

UpdateReport IncrementalCholesky::carry_out(const GraphUpdate& update,
                                            const UpdateOptions& options) {
  const Clock::time_point begin = Clock::now();
  const bool full =
      options.full || (options_.full_every > 0 && since_full_ + 1 >= options_.full_every);
  const double max_seconds = options.max_seconds > 0.0 ? options.max_seconds : options_.budget;
  std::optional<memory::SmallPages> small_pages;
  if (!full && max_seconds > 0.0) small_pages.emplace();
  UpdateReport report;
  const double of_solution = change_graph(update, full, !full && max_seconds > 0.0, report);
  report.seconds.linearize += seconds_since(begin) - of_solution;

  ++since_solved_;
  ++since_full_;
  if (full || (!options.defer && since_solved_ >= options_.solve_every)) look_for_freedom();
  if (full) {
    engine_->solve_fully(report);
    since_full_ = since_solved_ = 0;
  } else if (!options.defer && since_solved_ >= options_.solve_every) {
    const auto left = [&] { return std::max(1e-9, max_seconds - seconds_since(begin)); };
    double limit = 0.0;
    if (max_seconds > 0.0) limit = answers_ ? answers_->number(left) : left();
    engine_->solve(limit, report);
    since_solved_ = 0;
  }
  small_pages.reset();
  report_free(report);
  if (report.ok && since_solved_ == 0 && engine_->up_to_date() &&
      engine_->problem().covariances.keeps_anything()) {
    const Clock::time_point covariances_begin = Clock::now();
    report.marginals_by = engine_->problem().update_covariances();
    report.seconds.marginals += seconds_since(covariances_begin);
  }
  note_gauge(report);
  changes_ = false;
  report.seconds.total = seconds_since(begin);
  return report;
}

/// Before a solution: whether there is one.
void IncrementalCholesky::look_for_freedom() {
  if (engine_->problem().waiting() > 0) return;
  if (std::exchange(watched_load_, engine_->loads()) != engine_->loads()) watch_.forget();
  engine_->problem().settle_gauge();
  const auto jacobian = [this](int f, std::span<double> J) {
    const Graph& graph = engine_->graph();
    const FactorType& type = graph.factor_type(f);
    std::vector<std::vector<double>> x;
    std::vector<const double*> at;
    std::vector<double*> blocks;
    std::vector<double> residual(static_cast<std::size_t>(type.residual_size()));
    double* next = J.data();
    const auto on = graph.factor_variables(f);
    for (std::size_t k = 0; k < on.size(); ++k) {
      at.push_back(x.emplace_back(engine_->x(on[k])).data());
      blocks.push_back(next);
      next += residual.size() * static_cast<std::size_t>(type.tangent_size(static_cast<int>(k)));
    }
    const auto evaluate = [&] {
      call_factor(
          type, [&] { return graph.describe_factor(f); },
          [&] {
            type.evaluate(at.data(), graph.measurement(f).data(), graph.sqrt_information(f).data(),
                          residual.data(), blocks.data());
          });
      if (!graph.loss(f)) return;
      double norm = 0.0, weight = 1.0;
      for (const double r : residual) norm += r * r;
      const FactorRef ref = graph.ref(f);
      graph.weigh(ref.pool, static_cast<std::size_t>(ref.entry), {&norm, 1}, {}, {&weight, 1});
      for (double& entry : J) entry *= std::sqrt(weight);
    };
    if (answers_)
      answers_->write({J}, evaluate);
    else
      evaluate();
  };
  watch_.look({.graph = engine_->graph(),
               .held = [this](int v) { return engine_->problem().held(v); },
               .live = [this](int f) { return engine_->problem().live_factor(f); },
               .jacobian = jacobian});
  engine_->set_undetermined(!watch_.free().empty());
}

/// Every update after which something is free, or H singular, says what.
void IncrementalCholesky::report_free(UpdateReport& report) {
  if (report.ok && watch_.free().empty()) return;
  if (answers_ && answers_->repeats()) return;
  const Graph graph = engine_->snapshot();
  const std::string sentence = find_free_directions(graph).describe(graph);
  if (sentence.empty()) return;
  report.ok = false;
  if (std::ranges::find(report.notes, sentence) == report.notes.end())
    report.notes.push_back(sentence);
}

/// The update with its new variables placed by the estimate, if it is one that can be carried out.
GraphUpdate IncrementalCholesky::placed(const GraphUpdate& update) {
  const auto place = [&] {
    GraphUpdate result = update;
    const auto state_of = [this](Id id) {
      const auto v = find(id);
      return v ? state(id) : std::span<const double>();
    };
    place_variables(result, state_of);
    check_update(engine_->graph(),
                 {.position = [this](FactorId id) { return position(id); },
                  .next = engine_->next_id(),
                  .variable = [this](Id id) { return find(id); }},
                 result);
    if (options_.hints)
      replace_poor_states(result, state_of, losses_.empty() ? Deciding::all : Deciding::first);
    return result;
  };
  GraphUpdate result = answers_ ? answers_->object(place) : place();
  forget_what_was_read();
  return result;
}

/// Ends a solution that an update with a time limit has left, before new variables are placed by
/// its states, or something is taken out. How it ended and what it cost are in the report; a full
/// step, which follows, says itself whether all has converged. Returns the seconds that it took.
double IncrementalCholesky::end_solution(bool full, UpdateReport& report) {
  const Clock::time_point begin = Clock::now();
  engine_->solve(0.0, report);
  forget_what_was_read();
  if (full) {
    report.converged = true;
    report.owed = 0;
    report.notes.clear();
    report.doubts.clear();
  }
  return seconds_since(begin);
}

/// The engine as what an update is carried out on.
class IncrementalCholesky::Target final : public UpdateTarget {
 public:
  Target(IncrementalCholesky& owner, std::optional<Elimination> foreseen)
      : owner_(owner), engine_(*owner.engine_), foreseen_(std::move(foreseen)) {}

  Graph& graph() override { return engine_.problem().edit(); }
  FactorId next_factor() const override { return engine_.next_id(); }
  std::optional<int> position(FactorId id) const override { return owner_.position(id); }
  void added_variable() override {
    engine_.added_variable();
    ++owner_.variables_;
  }
  void added_factor() override {
    engine_.added_factor();
    ++owner_.factors_;
  }
  void changed_factor(int position) override { engine_.problem().change_factor(position); }
  Elimination eliminate(std::span<const int> variables) override;
  void remove(std::span<const int> factors, std::span<const int> variables) override;

 private:
  void remove_factor(int f) {
    engine_.problem().remove_factor(f);
    --owner_.factors_;
  }

  IncrementalCholesky& owner_;
  Engine& engine_;
  std::optional<Elimination> foreseen_;
};

Elimination IncrementalCholesky::Target::eliminate(std::span<const int> variables) {
  if (foreseen_) return std::move(*foreseen_);
  engine_.problem().settle_gauge();
  return engine_.eliminate(variables);
}

void IncrementalCholesky::Target::remove(std::span<const int> factors,
                                         std::span<const int> variables) {
  for (const int f : factors) remove_factor(f);
  for (const int v : variables) {
    const std::vector<std::int32_t> on_it = engine_.problem().factors_of(v);
    for (const std::int32_t f : on_it) remove_factor(f);
    engine_.problem().remove_variable(v);
    --owner_.variables_;
    engine_.problem().covariances.drop(v);
  }
}

/// Brings the graph of the engine to where the update wants it. Marginalising may fail, on numbers:
/// it is computed before anything changes, or else there is a copy or a record to go back to.
/// Returns the seconds that it took to end the solution that a time limit has left.
double IncrementalCholesky::change_graph(const GraphUpdate& update, bool full, bool limited,
                                         UpdateReport& report) {
  GraphUpdate checked = placed(update);
  const bool returns = brings_back(checked);
  const bool ends = engine_->busy() && (full || returns || takes_out(checked));
  const bool goes_on = engine_->busy() && !ends;
  const bool compacts = returns || (!goes_on && compaction_is_due(limited));
  std::optional<Elimination> foreseen;
  if (!checked.marginalized.empty()) {
    if (!ends && !compacts && can_be_foreseen(checked)) {
      std::vector<int> leaving;
      for (const Id id : checked.marginalized) leaving.push_back(index(id));
      foreseen = engine_->eliminate(leaving);
    } else if (!may_throw_) {
      before_ = std::make_unique<IncrementalCholesky>(*this);
    }
  }
  changes_ = true;
  if (takes_out(checked)) watch_.forget();
  double of_solution = 0.0;
  if (ends) {
    of_solution = end_solution(full, report);
    checked = placed(update);
  }
  if (compacts) compact();
  Target target(*this, std::move(foreseen));
  AppliedUpdate applied = cairn::carry_out(checked, losses_, target);
  report.first_factor = applied.first_factor;
  report.priors = std::move(applied.priors);
  if (!checked.removed_factors.empty() || !checked.removed_variables.empty()) has_removed_ = true;
  return of_solution;
}

/// Whether what has left is to be taken out of the engine's arrays, where no solution goes on,
/// which would begin anew. That linearises everything at once, and all is factorised after it: with
/// a time limit what was removed stays where it is, as what was marginalised does, until it is most
/// of all.
bool IncrementalCholesky::compaction_is_due(bool limited) const {
  return engine_->mostly_dead() || (has_removed_ && !limited);
}

/// Takes what has left out of the engine's arrays.
void IncrementalCholesky::compact() {
  engine_->compact();
  has_removed_ = false;
  forget_what_was_read();
}

/// Whether a new variable has the id of one that has been removed and is still in the graph.
bool IncrementalCholesky::brings_back(const GraphUpdate& update) const {
  return std::ranges::any_of(update.variables, [&](const Variable& variable) {
    return engine_->graph().find(variable.id).has_value();
  });
}

/// Whether nothing else in the update changes what the marginalised variables leave.
bool IncrementalCholesky::can_be_foreseen(const GraphUpdate& update) const {
  if (!update.changed.empty() || engine_->problem().gauge_is_old()) return false;
  return std::ranges::all_of(update.marginalized, [&](Id id) {
    const std::optional<int> v = find(id);
    return v && !engine_->problem().held(*v) &&
           std::ranges::none_of(update.factors, [&](const Factor& f) {
             return std::ranges::find(f.variables, id) != f.variables.end();
           });
  });
}

void IncrementalCholesky::note_gauge(UpdateReport& report) {
  for (const std::int32_t v : engine_->problem().take_anchored()) {
    if (!engine_->problem().live_variable(v) || engine_->graph().fixed(v)) continue;
    if (!engine_->problem().held(v)) continue;  // what followed in the same update determines it
    if (!told_.insert(engine_->graph().id(v)).second) continue;
    report.notes.push_back(
        fmt::format("the pose of the component of {0} is not determined: anchored {0}",
                    engine_->graph().describe_variable(v)));
  }
  for (const std::int32_t v : engine_->problem().take_disconnected()) {
    if (engine_->graph().fixed(v)) continue;
    report.notes.push_back(fmt::format("{} has no factor left: it is constant, without covariance",
                                       engine_->graph().describe_variable(v)));
  }
}

void IncrementalCholesky::set_loss(std::shared_ptr<const Loss> loss, const FactorSelector& which) {
  auto next = std::make_unique<Engine>(engine());
  next->set_loss(loss, which);
  may_throw_ = may_throw_ || which.kind() == FactorSelector::Kind::predicate ||
               (loss && !dynamic_cast<const NeverThrows*>(loss.get()));
  losses_ = LossRule(std::move(loss), which, next->graph());
  engine_ = std::move(next);
  record_.reset();
  forget_what_was_read();
  watch_.forget();
  has_removed_ = false;
}

// --- what is known ---

std::optional<int> IncrementalCholesky::find(Id id) const {
  const auto v = engine().graph().find(id);
  return v && engine_->problem().live_variable(*v) ? v : std::nullopt;
}

int IncrementalCholesky::index(Id id) const {
  if (const auto v = find(id)) return *v;
  throw Error(ErrorCode::usage, "there is no variable " + id_text(id));
}

std::optional<int> IncrementalCholesky::position(FactorId id) const {
  const int place = engine().problem().place_of(id);
  return place < 0 ? std::nullopt : std::optional<int>(place);
}

std::vector<Id> IncrementalCholesky::variables() const {
  std::vector<Id> ids;
  for (int v = 0; v < engine().graph().variable_count(); ++v) {
    if (engine_->problem().live_variable(v)) ids.push_back(engine_->graph().id(v));
  }
  return ids;
}

std::shared_ptr<const VariableType> IncrementalCholesky::type(Id id) const {
  return engine_->graph().type_of(index(id));
}

Factor IncrementalCholesky::factor(FactorId id) const {
  if (const auto f = position(id)) return engine_->graph().factor(*f);
  throw Error(ErrorCode::usage, fmt::format("there is no factor {}", id));
}

std::span<const double> IncrementalCholesky::state(Id id) {
  // Most read one variable after the other, in the order in which they have come.
  const Graph& graph = engine().graph();
  const bool next = next_to_read_ < graph.variable_count() && graph.id(next_to_read_) == id &&
                    engine_->problem().live_variable(next_to_read_);
  const int v = next ? next_to_read_ : index(id);
  next_to_read_ = v + 1;
  // Where many are read, most likely all will be: together they are cheaper.
  if (!all_ && std::ssize(read_) >= kFew) all_ = engine_->current();
  const auto size = static_cast<std::size_t>(engine_->problem().states.ambient(v));
  if (all_) return {all_->x(v), size};
  const auto known = read_.find(v);
  return known != read_.end() ? known->second : read_.emplace(v, engine_->x(v)).first->second;
}

int IncrementalCholesky::block_size(int a, int b) const {
  return engine_->graph().type(a).tangent_size() * engine_->graph().type(b).tangent_size();
}

void IncrementalCholesky::keep_marginals(KeptMarginals kept) {
  engine().problem().covariances.keep(kept);
  kept_ = kept;
  if (record_)
    record_->steps.emplace_back([kept](IncrementalCholesky& also) { also.keep_marginals(kept); });
}

void IncrementalCholesky::keep_cross(Id a, Id b) {
  engine().problem().covariances.keep(index(a), index(b));
  if (record_)
    record_->steps.emplace_back([a, b](IncrementalCholesky& also) { also.keep_cross(a, b); });
}

bool IncrementalCholesky::covariance(Id a, Id b, std::span<double> block) {
  const int va = index(a), vb = index(b);
  if (std::ssize(block) != block_size(va, vb)) {
    throw Error(ErrorCode::usage, fmt::format("the covariance of {} and {} has {} numbers, not {}",
                                              a, b, block_size(va, vb), block.size()));
  }
  Engine& engine = solved();
  return engine.covariance(place_in(engine, a), place_in(engine, b), block.data());
}

bool IncrementalCholesky::covariance_column(Id id, std::span<const Id> variables,
                                            std::span<double> out) {
  const int column = index(id);
  const Rows& rows = rows_of(variables);
  const std::int64_t size = rows.height * engine_->graph().type(column).tangent_size();
  if (std::ssize(out) != size) {
    throw Error(
        ErrorCode::usage,
        fmt::format("this column of the covariance has {} numbers, not {}", size, out.size()));
  }
  Engine& engine = solved();
  if (&engine == engine_.get()) return engine.covariance_column(rows.places, column, out.data());
  std::vector<std::int32_t> places;
  for (const Id row : variables) places.push_back(place_in(engine, row));
  return engine.covariance_column(places, place_in(engine, id), out.data());
}

/// Where these variables are in the engine. Columns are asked for many at a time, with the same
/// rows.
const IncrementalCholesky::Rows& IncrementalCholesky::rows_of(std::span<const Id> variables) {
  if (std::ranges::equal(variables, rows_.ids)) return rows_;
  Rows rows{{variables.begin(), variables.end()}, {}, 0};
  for (const Id id : variables) {
    rows.places.push_back(index(id));
    rows.height += engine_->graph().type(rows.places.back()).tangent_size();
  }
  return rows_ = std::move(rows);
}

/// The number of a variable that is there, in the engine or in a copy that may have renumbered.
int IncrementalCholesky::place_in(const Engine& engine, Id id) const {
  return &engine == engine_.get() ? index(id) : static_cast<int>(*engine.graph().find(id));
}

/// What covariances are read from: where work is left from the last update, a copy that has done
/// it.
Engine& IncrementalCholesky::solved() {
  if (!engine_->busy() && (since_solved_ > 0 || engine_->up_to_date())) return *engine_;
  if (!finished_) {
    auto copy = std::make_unique<Engine>(*engine_);
    UpdateReport report;
    copy->solve(0.0, report);
    if (report.ok && copy->up_to_date() && copy->problem().covariances.keeps_anything())
      copy->problem().update_covariances();
    finished_ = std::move(copy);
  }
  return *finished_;
}

void IncrementalCholesky::reset() {
  auto fresh = std::make_unique<Engine>(options_.settings, rescuer_);
  lost_ = may_throw_ = false;
  record_.reset();
  engine_ = std::move(fresh);
  engine_->problem().covariances.keep(kept_);
  variables_ = factors_ = since_solved_ = since_full_ = 0;
  has_removed_ = false;
  watch_.forget();
  losses_.clear();
  told_.clear();
  forget_what_was_read();
}

std::unique_ptr<Estimator> IncrementalCholesky::clone() const {
  return std::make_unique<IncrementalCholesky>(*this);
}

}  // namespace cairn::incremental
