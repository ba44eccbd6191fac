// SPDX-License-Identifier: BSD-3-Clause
#include "incremental_cholesky.hpp"

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/memory/small_pages.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"
#include "cairn/update/elimination.hpp"
#include "cairn/update/graph_update.hpp"
#include "cairn/update/initial_states.hpp"

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
      engine_(std::make_unique<Engine>(*other.engine_)),
      variables_(other.variables_),
      factors_(other.factors_),
      losses_(other.losses_),
      since_solved_(other.since_solved_),
      since_full_(other.since_full_),
      kept_(other.kept_),
      told_(other.told_),
      has_removed_(other.has_removed_) {}

// --- updates ---

UpdateReport IncrementalCholesky::update(const GraphUpdate& update, const UpdateOptions& options) {
  const Clock::time_point begin = Clock::now();
  const bool full =
      options.full || (options_.full_every > 0 && since_full_ + 1 >= options_.full_every);
  const double max_seconds = options.max_seconds > 0.0 ? options.max_seconds : options_.budget;
  std::optional<memory::SmallPages> small_pages;
  if (!full && max_seconds > 0.0) small_pages.emplace();
  UpdateReport report;
  const double of_solution =
      carry_out_or_not_at_all(update, full, !full && max_seconds > 0.0, report);
  report.seconds.linearize += seconds_since(begin) - of_solution;

  ++since_solved_;
  ++since_full_;
  if (full) {
    engine_->solve_fully(report);
    since_full_ = since_solved_ = 0;
  } else if (!options.defer && since_solved_ >= options_.solve_every) {
    const double left =
        max_seconds > 0.0 ? std::max(1e-9, max_seconds - seconds_since(begin)) : 0.0;
    engine_->solve(left, report);
    since_solved_ = 0;
  }
  small_pages.reset();
  if (report.ok && since_solved_ == 0 && engine_->up_to_date() &&
      engine_->covariances().keeps_anything()) {
    const Clock::time_point covariances_begin = Clock::now();
    report.marginals_by = engine_->update_covariances();
    report.seconds.marginals += seconds_since(covariances_begin);
  }
  note_gauge(report);
  report.seconds.total = seconds_since(begin);
  return report;
}

/// The update with its new variables placed by the estimate, if it is one that can be carried out.
GraphUpdate IncrementalCholesky::placed(const GraphUpdate& update) {
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
  }
  return seconds_since(begin);
}

/// The engine as what an update is carried out on.
class IncrementalCholesky::Target final : public UpdateTarget {
 public:
  Target(IncrementalCholesky& owner, std::optional<Elimination> foreseen)
      : owner_(owner), engine_(*owner.engine_), foreseen_(std::move(foreseen)) {}

  Graph& graph() override { return engine_.edit(); }
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
  void changed_factor(int position) override { engine_.changed_factor(position); }
  Elimination eliminate(std::span<const int> variables) override;
  void remove(std::span<const int> factors, std::span<const int> variables) override;

 private:
  void remove_factor(int f) {
    engine_.remove_factor(f);
    --owner_.factors_;
  }

  IncrementalCholesky& owner_;
  Engine& engine_;
  std::optional<Elimination> foreseen_;
};

Elimination IncrementalCholesky::Target::eliminate(std::span<const int> variables) {
  if (foreseen_) return std::move(*foreseen_);
  engine_.settle_gauge();
  return engine_.eliminate(variables);
}

void IncrementalCholesky::Target::remove(std::span<const int> factors,
                                         std::span<const int> variables) {
  for (const int f : factors) remove_factor(f);
  for (const int v : variables) {
    const std::vector<std::int32_t> on_it = engine_.factors_of(v);
    for (const std::int32_t f : on_it) remove_factor(f);
    engine_.remove_variable(v);
    --owner_.variables_;
    engine_.covariances().drop(v);
  }
}

/// Marginalising may fail, on numbers. Then everything is as before, to the last bit: a journal
/// does not have what was refused. So it is computed before anything changes, or else on a copy.
/// Returns the seconds that it took to end the solution that a time limit has left.
double IncrementalCholesky::carry_out_or_not_at_all(const GraphUpdate& update, bool full,
                                                    bool limited, UpdateReport& report) {
  GraphUpdate checked = placed(update);
  const bool returns = brings_back(checked);
  const bool ends = engine_->busy() && (full || returns || takes_out(checked));
  const bool goes_on = engine_->busy() && !ends;
  const bool compacts = returns || (!goes_on && compaction_is_due(limited));
  std::optional<Elimination> foreseen;
  std::unique_ptr<IncrementalCholesky> before;
  if (!checked.marginalized.empty()) {
    if (!ends && !compacts && can_be_foreseen(checked)) {
      std::vector<int> leaving;
      for (const Id id : checked.marginalized) leaving.push_back(index(id));
      foreseen = engine_->eliminate(leaving);
    } else {
      before = std::make_unique<IncrementalCholesky>(*this);
    }
  }
  double of_solution = 0.0;
  try {
    if (ends) {
      of_solution = end_solution(full, report);
      checked = placed(update);
    }
    if (compacts) compact();
    Target target(*this, std::move(foreseen));
    AppliedUpdate applied = carry_out(checked, losses_, target);
    report.first_factor = applied.first_factor;
    report.priors = std::move(applied.priors);
    if (!update.removed_factors.empty() || !update.removed_variables.empty()) has_removed_ = true;
  } catch (...) {
    if (before) {
      engine_ = std::move(before->engine_);
      variables_ = before->variables_;
      factors_ = before->factors_;
      losses_ = before->losses_;
      has_removed_ = before->has_removed_;
      forget_what_was_read();
    }
    throw;
  }
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
  if (!update.changed.empty() || engine_->gauge_is_old()) return false;
  return std::ranges::all_of(update.marginalized, [&](Id id) {
    const std::optional<int> v = find(id);
    return v && !engine_->held(*v) && std::ranges::none_of(update.factors, [&](const Factor& f) {
             return std::ranges::find(f.variables, id) != f.variables.end();
           });
  });
}

void IncrementalCholesky::note_gauge(UpdateReport& report) {
  for (const std::int32_t v : engine_->take_anchored()) {
    if (!engine_->live_variable(v) || engine_->graph().fixed(v)) continue;
    if (!engine_->held(v)) continue;  // what followed in the same update determines it
    if (!told_.insert(engine_->graph().id(v)).second) continue;
    report.notes.push_back(
        fmt::format("the pose of the component of {0} is not determined: anchored {0}",
                    engine_->graph().describe_variable(v)));
  }
  for (const std::int32_t v : engine_->take_disconnected()) {
    if (engine_->graph().fixed(v)) continue;
    report.notes.push_back(fmt::format("{} has no factor left: it is constant, without covariance",
                                       engine_->graph().describe_variable(v)));
  }
}

void IncrementalCholesky::set_loss(std::shared_ptr<const Loss> loss, const FactorSelector& which) {
  forget_what_was_read();
  engine_->set_loss(loss, which);
  has_removed_ = false;
  losses_ = LossRule(std::move(loss), which, engine_->graph());
}

// --- what is known ---

std::optional<int> IncrementalCholesky::find(Id id) const {
  const auto v = engine_->graph().find(id);
  return v && engine_->live_variable(*v) ? v : std::nullopt;
}

int IncrementalCholesky::index(Id id) const {
  if (const auto v = find(id)) return *v;
  throw Error(ErrorCode::usage, fmt::format("there is no variable {}", id));
}

std::optional<int> IncrementalCholesky::position(FactorId id) const {
  const int place = engine_->place_of(id);
  return place < 0 ? std::nullopt : std::optional<int>(place);
}

std::vector<Id> IncrementalCholesky::variables() const {
  std::vector<Id> ids;
  for (int v = 0; v < engine_->graph().variable_count(); ++v) {
    if (engine_->live_variable(v)) ids.push_back(engine_->graph().id(v));
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
  const Graph& graph = engine_->graph();
  const bool next = next_to_read_ < graph.variable_count() && graph.id(next_to_read_) == id &&
                    engine_->live_variable(next_to_read_);
  const int v = next ? next_to_read_ : index(id);
  next_to_read_ = v + 1;
  // Where many are read, most likely all will be: together they are cheaper.
  if (!all_ && std::ssize(read_) >= kFew) all_ = engine_->current();
  const auto size = static_cast<std::size_t>(engine_->states().ambient(v));
  if (all_) return {all_->x(v), size};
  const auto known = read_.find(v);
  return known != read_.end() ? known->second : read_.emplace(v, engine_->x(v)).first->second;
}

int IncrementalCholesky::block_size(int a, int b) const {
  return engine_->graph().type(a).tangent_size() * engine_->graph().type(b).tangent_size();
}

void IncrementalCholesky::keep_marginals(KeptMarginals kept) {
  kept_ = kept;
  engine_->covariances().keep(kept);
}

void IncrementalCholesky::keep_cross(Id a, Id b) {
  engine_->covariances().keep(index(a), index(b));
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
    finished_ = std::make_unique<Engine>(*engine_);
    UpdateReport report;
    finished_->solve(0.0, report);
    if (report.ok && finished_->up_to_date() && finished_->covariances().keeps_anything())
      finished_->update_covariances();
  }
  return *finished_;
}

void IncrementalCholesky::reset() {
  engine_ = std::make_unique<Engine>(options_.settings, rescuer_);
  engine_->covariances().keep(kept_);
  variables_ = factors_ = since_solved_ = since_full_ = 0;
  has_removed_ = false;
  losses_.clear();
  told_.clear();
  forget_what_was_read();
}

std::unique_ptr<Estimator> IncrementalCholesky::clone() const {
  return std::make_unique<IncrementalCholesky>(*this);
}

}  // namespace cairn::incremental
