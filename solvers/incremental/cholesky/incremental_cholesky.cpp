// SPDX-License-Identifier: BSD-3-Clause
#include "incremental_cholesky.hpp"

#include <algorithm>
#include <chrono>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/runtime/error.hpp"
#include "cairn/update/elimination.hpp"
#include "cairn/update/graph_update.hpp"

namespace cairn::incremental {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// So many states are brought up to date one by one.
constexpr int kFew = 8;

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
      since_solved_(other.since_solved_),
      since_full_(other.since_full_),
      kept_(other.kept_),
      told_(other.told_) {}

// --- updates ---

UpdateReport IncrementalCholesky::update(const GraphUpdate& update, const UpdateOptions& options) {
  const Clock::time_point begin = Clock::now();
  asked_ = 0;
  if (engine_->dead() > 0) engine_->compact();
  GraphUpdate checked = update;
  place_variables(checked, [this](Id id) {
    const auto v = find(id);
    return v ? state(id) : std::span<const double>();
  });
  check_update(engine_->graph(),
               {.position = [this](FactorId id) -> std::optional<int> {
                  const int place = engine_->place_of(id);
                  return place < 0 ? std::nullopt : std::optional<int>(place);
                },
                .next = engine_->next_id()},
               checked);
  UpdateReport report;
  if (checked.marginalized.empty()) {
    apply(checked, report);
  } else {  // which may fail, on numbers
    const IncrementalCholesky before(*this);
    try {
      apply(checked, report);
    } catch (...) {
      engine_ = std::make_unique<Engine>(*before.engine_);
      variables_ = before.variables_;
      factors_ = before.factors_;
      throw;
    }
  }
  report.seconds.linearize += seconds_since(begin);

  ++since_solved_;
  ++since_full_;
  const double max_seconds = options.max_seconds > 0.0 ? options.max_seconds : options_.budget;
  if (options.full || (options_.full_every > 0 && since_full_ >= options_.full_every)) {
    engine_->solve_fully(report);
    since_full_ = since_solved_ = 0;
  } else if (!options.defer && since_solved_ >= options_.solve_every) {
    const double left =
        max_seconds > 0.0 ? std::max(1e-9, max_seconds - seconds_since(begin)) : 0.0;
    engine_->solve(left, report);
    since_solved_ = 0;
  }
  if (report.ok && since_solved_ == 0 && engine_->covariances().keeps_anything()) {
    const Clock::time_point covariances_begin = Clock::now();
    report.marginals_by = engine_->update_covariances();
    report.seconds.marginals += seconds_since(covariances_begin);
  }
  tell_of_anchors(report);
  report.seconds.total = seconds_since(begin);
  return report;
}

void IncrementalCholesky::apply(const GraphUpdate& update, UpdateReport& report) {
  Graph& graph = engine_->edit();
  report.first_factor = engine_->next_id();
  for (const Variable& variable : update.variables) {
    const int v = graph.add_variable(variable.type, variable.id, variable.state);
    if (variable.fixed) graph.set_fixed(v);
    engine_->added_variable();
    ++variables_;
  }
  std::vector<int> variables;
  for (const Factor& factor : update.factors) {
    variables.clear();
    for (const Id id : factor.variables) variables.push_back(index(id));
    graph.add_factor(factor.type, variables, factor.measurement, factor.information);
    engine_->added_factor();
    ++factors_;
  }
  for (const ChangedFactor& change : update.changed) {
    const int f = engine_->place_of(change.factor);
    graph.set_measurement(f, change.measurement, change.information);
    engine_->changed_factor(f);
  }
  if (!update.marginalized.empty()) marginalize(update.marginalized, report);
  for (const FactorId id : update.removed_factors) {
    const int f = engine_->place_of(id);
    if (f < 0) continue;  // went with a variable that was marginalised
    engine_->remove_factor(f);
    --factors_;
  }
  for (const Id id : update.removed_variables) {
    if (const auto v = find(id)) remove_variable(*v);
  }
}

void IncrementalCholesky::marginalize(const std::vector<Id>& ids, UpdateReport& report) {
  std::vector<int> leaving, factors;
  for (const Id id : ids) {
    leaving.push_back(index(id));
    const auto& on_it = engine_->factors_of(leaving.back());
    factors.insert(factors.end(), on_it.begin(), on_it.end());
  }
  std::ranges::sort(factors);
  factors.erase(std::unique(factors.begin(), factors.end()), factors.end());
  engine_->write_back();
  Graph& graph = engine_->edit();
  std::vector<bool> held(static_cast<std::size_t>(graph.variable_count()));
  for (std::size_t v = 0; v < held.size(); ++v) held[v] = engine_->held(static_cast<int>(v));
  const Elimination elimination = eliminate(graph, leaving, held, factors);
  for (const Factor& prior : elimination.priors) {
    std::vector<int> variables;
    for (const Id id : prior.variables) variables.push_back(index(id));
    report.priors.push_back(engine_->next_id());
    graph.add_factor(prior.type, variables, prior.measurement, prior.information);
    engine_->added_factor();
    ++factors_;
  }
  for (const int f : elimination.replaced) {
    engine_->remove_factor(f);
    --factors_;
  }
  for (const int v : leaving) remove_variable(v);
}

void IncrementalCholesky::remove_variable(int v) {
  const std::vector<std::int32_t> factors = engine_->factors_of(v);
  for (const std::int32_t f : factors) {
    engine_->remove_factor(f);
    --factors_;
  }
  engine_->remove_variable(v);
  --variables_;
  engine_->covariances().drop(v);
}

void IncrementalCholesky::tell_of_anchors(UpdateReport& report) {
  for (const std::int32_t v : engine_->take_anchored()) {
    if (!engine_->live_variable(v) || engine_->graph().fixed(v)) continue;
    if (!told_.insert(engine_->graph().id(v)).second) continue;
    report.notes.push_back(fmt::format("nothing says where the component of {0} is: anchored {0}",
                                       engine_->graph().describe_variable(v)));
  }
}

void IncrementalCholesky::set_loss(std::shared_ptr<const Loss> loss, LossScope scope) {
  engine_->set_loss(std::move(loss), scope);
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

std::span<const double> IncrementalCholesky::state(Id id) const {
  const int v = index(id);
  // Whoever asks for many most likely wants all: then they are brought up to date together.
  if (asked_ <= kFew && ++asked_ > kFew) engine_->settle_all();
  return {asked_ > kFew ? engine_->settled_x(v) : engine_->x(v),
          static_cast<std::size_t>(engine_->graph().type(v).ambient_size())};
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
  return engine_->covariance(va, vb, block.data());
}

bool IncrementalCholesky::covariance_column(Id id, std::span<const Id> variables,
                                            std::span<double> out) {
  const int column = index(id);
  std::vector<std::int32_t> rows;
  std::int64_t size = 0;
  for (const Id row : variables) {
    rows.push_back(index(row));
    size += block_size(rows.back(), column);
  }
  if (std::ssize(out) != size) {
    throw Error(
        ErrorCode::usage,
        fmt::format("this column of the covariance has {} numbers, not {}", size, out.size()));
  }
  return engine_->covariance_column(rows, column, out.data());
}

void IncrementalCholesky::reset() {
  engine_ = std::make_unique<Engine>(options_.settings, rescuer_);
  engine_->covariances().keep(kept_);
  variables_ = factors_ = since_solved_ = since_full_ = 0;
  told_.clear();
  asked_ = 0;
}

std::unique_ptr<Estimator> IncrementalCholesky::clone() const {
  return std::make_unique<IncrementalCholesky>(*this);
}

}  // namespace cairn::incremental
