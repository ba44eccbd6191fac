// SPDX-License-Identifier: BSD-3-Clause
#include "linearized_estimator.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <utility>

#include <fmt/core.h>

#include "before.hpp"
#include "cairn/evaluation/batch_step.hpp"
#include "cairn/geometry/pose.hpp"
#include "cairn/graph/id_text.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"
#include "cairn/types/factor_call.hpp"
#include "cairn/types/loss.hpp"
#include "cairn/update/marginal_prior.hpp"

namespace cairn::linearized {
namespace {

using Clock = std::chrono::steady_clock;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A filter has converged where a step would lower chi2 by less than this fraction.
constexpr double kTolerance = 1e-10;
/// A step of this share of the states is their rounding.
constexpr double kRounding = 1e-14;

/// ρ′ of a factor.
double weight_of(const Graph& graph, int factor, double squared_norm) {
  double weight = 1.0;
  const FactorRef at = graph.ref(factor);
  graph.weigh(at.pool, static_cast<std::size_t>(at.entry), {&squared_norm, 1}, {}, {&weight, 1});
  return weight;
}

bool is_finite(std::span<const double> numbers) {
  return std::ranges::all_of(numbers, [](double x) { return std::isfinite(x); });
}

/// x moved by δ.
std::vector<double> moved(const VariableType& type, std::span<const double> x,
                          const VectorXd& delta) {
  std::vector<double> result(x.size());
  const std::int64_t offset = 0;
  type.retract(1, x.data(), &offset, delta.data(), result.data());
  return result;
}

template <class T>
void keep_those_that_stay(const std::vector<std::int32_t>& now, std::vector<T>& all) {
  std::size_t next = 0;
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (now[k] >= 0) std::swap(all[next++], all[k]);
  }
  all.resize(next);
}

}  // namespace

// The state --------------------------------------------------------------------------------------

LinearizedEstimator::State LinearizedEstimator::State::clone() const {
  return {graph.clone(), ids, losses, models, displacements, origins, rebuild};
}

Rows LinearizedEstimator::State::linearize(int factor, bool at_origins) const {
  const FactorType& type = graph.factor_type(factor);
  const auto on = graph.factor_variables(factor);
  Rows rows;
  std::vector<const double*> x;
  int columns = 0;
  for (const std::int32_t v : on) {
    const auto k = static_cast<std::size_t>(v);
    rows.variables.push_back(graph.id(v));
    rows.sizes.push_back(graph.type(v).tangent_size());
    columns += rows.sizes.back();
    x.push_back(at_origins ? origins[k].data() : graph.state(v).data());
  }
  rows.J.resize(type.residual_size(), columns);
  rows.c.resize(type.residual_size());
  std::vector<double*> J;
  int at = 0;
  for (const int size : rows.sizes) {
    J.push_back(rows.J.col(at).data());
    at += size;
  }
  call_factor(
      type, [&] { return graph.describe_factor(factor); },
      [&] {
        type.evaluate(x.data(), graph.measurement(factor).data(),
                      graph.sqrt_information(factor).data(), rows.c.data(), J.data());
      });
  const double root = std::sqrt(weight_of(graph, factor, rows.c.squaredNorm()));
  rows.J *= root;
  rows.c *= root;
  if (!rows.J.allFinite() || !rows.c.allFinite()) {
    throw Error(ErrorCode::numerical, fmt::format("{}: its residual or Jacobian is not finite",
                                                  graph.describe_factor(factor)));
  }
  if (at_origins) return rows;
  at = 0;  // the displacement of the estimate is not zero
  for (std::size_t k = 0; k < rows.sizes.size(); ++k) {
    rows.c -= rows.J.middleCols(at, rows.sizes[k]) * displacements[static_cast<std::size_t>(on[k])];
    at += rows.sizes[k];
  }
  return rows;
}

/// Puts a variable of that factor where it sees it, if it is the variable's only one and its model
/// says nothing of it where it is, as of a landmark in the pose that saw it.
void LinearizedEstimator::State::place_unseen(int factor, bool at_origins) {
  const Rows rows = models[static_cast<std::size_t>(factor)].rows;
  if (rows.c.isZero(0.0)) return;
  const auto on = graph.factor_variables(factor);
  Eigen::Index at = 0;
  for (std::size_t k = 0; k < on.size(); at += rows.sizes[k++]) {
    if (!rows.J.middleCols(at, rows.sizes[k]).isZero(0.0)) continue;
    const int v = on[k];
    if (graph.fixed(v) || graph.factors_of(v).size() > 1) continue;
    std::vector<const double*> x;
    for (const std::int32_t other : on) x.push_back(graph.state(other).data());
    const std::vector<double> before(graph.state(v).begin(), graph.state(v).end());
    std::vector<double> placed = before;
    const FactorType& type = graph.factor_type(factor);
    const bool can = call_factor(
        type, [&] { return graph.describe_factor(factor); },
        [&] {
          return type.propagate(static_cast<int>(k), x.data(), graph.measurement(factor).data(),
                                placed.data());
        });
    if (!can || !is_finite(placed)) continue;
    graph.set_state(v, placed);
    origins[static_cast<std::size_t>(v)] = placed;
    try {
      models[static_cast<std::size_t>(factor)] = {linearize(factor, at_origins)};
      return;
    } catch (const Error&) {  // it is not finite there
      graph.set_state(v, before);
      origins[static_cast<std::size_t>(v)] = before;
    }
  }
}

/// Follows what an update changes, linearising what is new as it comes.
class LinearizedEstimator::Target final : public UpdateTarget {
 public:
  Target(State& state, bool filter) : state_(state), filter_(filter) {}

  Graph& graph() override { return state_.graph; }
  FactorId next_factor() const override { return state_.ids.next(); }
  std::optional<int> position(FactorId id) const override { return state_.ids.position(id); }
  void added_variable() override {
    const int v = state_.graph.variable_count() - 1;
    const auto x = state_.graph.state(v);
    state_.displacements.push_back(VectorXd::Zero(state_.graph.type(v).tangent_size()));
    state_.origins.emplace_back(x.begin(), x.end());
  }
  void added_factor() override {
    state_.ids.add();
    state_.models.push_back({state_.linearize(state_.graph.factor_count() - 1, !filter_)});
  }
  void changed_factor(int position) override {
    state_.models[static_cast<std::size_t>(position)] = {state_.linearize(position, !filter_)};
    state_.rebuild = true;
  }
  Elimination eliminate(std::span<const int> variables) override;
  void remove(std::span<const int> factors, std::span<const int> variables) override {
    std::vector<bool> factor_leaves(static_cast<std::size_t>(state_.graph.factor_count()), false);
    std::vector<bool> variable_leaves(static_cast<std::size_t>(state_.graph.variable_count()),
                                      false);
    for (const int f : factors) factor_leaves[f] = true;
    for (const int v : variables) variable_leaves[v] = true;
    for (int f = 0; !variables.empty() && f < state_.graph.factor_count(); ++f) {
      for (const std::int32_t v : state_.graph.factor_variables(f))
        factor_leaves[f] = factor_leaves[f] || variable_leaves[v];
    }
    const Renumbering now = state_.graph.remove(factor_leaves, variable_leaves);
    state_.ids.remove(now);
    keep_those_that_stay(now.factor, state_.models);
    keep_those_that_stay(now.variable, state_.displacements);
    keep_those_that_stay(now.variable, state_.origins);
    state_.rebuild = true;
  }

 private:
  State& state_;
  bool filter_;
};

/// A filter marginalises its linear models. As factors that are linear about the estimate they are
/// eliminated like all others.
Elimination LinearizedEstimator::Target::eliminate(std::span<const int> variables) {
  const Graph& graph = state_.graph;
  const std::vector<bool> held = resolve_gauge(graph).held;
  if (!filter_) return cairn::eliminate(graph, variables, held);
  Graph linear;
  std::vector<bool> leaves(static_cast<std::size_t>(graph.variable_count()), false);
  for (const int v : variables) leaves[static_cast<std::size_t>(v)] = true;
  for (int v = 0; v < graph.variable_count(); ++v) linear.add(graph.variable(v));
  std::vector<int> replaced;
  for (int f = 0; f < graph.factor_count(); ++f) {
    const auto on = graph.factor_variables(f);
    if (std::ranges::none_of(on, [&](std::int32_t v) { return leaves[v]; })) continue;
    const Rows& rows = state_.models[static_cast<std::size_t>(f)].rows;
    std::vector<MarginalPrior::Variable> at;
    VectorXd residual = rows.c;
    int column = 0;
    for (const std::int32_t v : on) {
      const VectorXd& d = state_.displacements[static_cast<std::size_t>(v)];
      residual += rows.J.middleCols(column, d.size()) * d;
      column += static_cast<int>(d.size());
      at.push_back({graph.type_of(v), {graph.state(v).begin(), graph.state(v).end()}});
    }
    residual = -residual;
    const auto type = std::make_shared<MarginalPrior>(
        std::move(at),
        LinearResidual{static_cast<int>(rows.J.rows()),
                       static_cast<int>(rows.J.cols()),
                       {rows.J.data(), rows.J.data() + rows.J.size()},
                       {residual.begin(), residual.end()}},
        graph.absolute_size(f));
    linear.add(Factor{type, rows.variables, {}, type->unit_information()});
    replaced.push_back(f);
  }
  Elimination result = cairn::eliminate(linear, variables, held);
  result.replaced = std::move(replaced);
  return result;
}

// Updates ----------------------------------------------------------------------------------------

LinearizedEstimator::LinearizedEstimator(std::unique_ptr<GaussianForm> form,
                                         std::optional<BatchSteps> batch)
    : form_(std::move(form)), batch_(std::move(batch)) {}

UpdateReport LinearizedEstimator::update(const GraphUpdate& update, const UpdateOptions& options) {
  const auto begin = Clock::now();
  GraphUpdate checked = update;
  check_update(state_.graph, state_.ids, checked);
  std::int64_t size = state_.graph.tangent_size();
  for (const Variable& variable : checked.variables) size += variable.type->tangent_size();
  form_->check_size(size);
  Before before(*this, checked, options);
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

bool LinearizedEstimator::is_batch_step(const GraphUpdate& update,
                                        const UpdateOptions& options) const {
  if (!batch_ || (options.defer && !options.full)) return false;
  return options.full || must_batch_ || !only_adds(update) || since_batch_ + 1 >= batch_->every;
}

void LinearizedEstimator::carry_out(const GraphUpdate& update, const UpdateOptions& options,
                                    UpdateReport& report) {
  const auto begin = Clock::now();
  const bool batch = is_batch_step(update, options);
  Target target(state_, !batch_);
  const int factors = state_.graph.factor_count();
  const AppliedUpdate applied = cairn::carry_out(update, state_.losses, target);
  for (int f = only_adds(update) ? factors : state_.graph.factor_count();
       f < state_.graph.factor_count(); ++f)
    state_.place_unseen(f, batch_.has_value());
  report.first_factor = applied.first_factor;
  report.priors = applied.priors;
  report.seconds.linearize = seconds_since(begin);
  must_batch_ = must_batch_ || !only_adds(update);
  ++since_batch_;
  if (batch) return batch_step(options, report);
  try {
    if (options.defer && !options.full) return take_models();
    if (options.full) form_->recover_fully();
    solve(report);
  } catch (...) {  // of memory: the form may have taken a part of what is new
    state_.rebuild = true;
    throw;
  }
  if (options.full) check_converged(report);
}

void LinearizedEstimator::linearize_all() {
  for (int f = 0; f < state_.graph.factor_count(); ++f)
    state_.models[static_cast<std::size_t>(f)] = {state_.linearize(f, batch_.has_value())};
  state_.rebuild = true;
}

Rows LinearizedEstimator::free_rows(const Model& model) const {
  Rows rows;
  rows.c = model.rows.c;
  rows.J.resize(model.rows.J.rows(), model.rows.J.cols());
  int from = 0, to = 0;
  for (std::size_t k = 0; k < model.rows.variables.size(); ++k) {
    const int size = model.rows.sizes[k], v = *state_.graph.find(model.rows.variables[k]);
    const auto J = model.rows.J.middleCols(from, size);
    from += size;
    if (is_held(v)) {
      rows.c += J * state_.displacements[static_cast<std::size_t>(v)];
      continue;
    }
    rows.variables.push_back(model.rows.variables[k]);
    rows.sizes.push_back(size);
    rows.J.middleCols(to, size) = J;
    to += size;
  }
  rows.J.conservativeResize(Eigen::NoChange, to);
  return rows;
}

void LinearizedEstimator::take_models() {
  gauge_ = resolve_gauge(state_.graph);
  for (int v = 0; v < state_.graph.variable_count(); ++v) {
    state_.rebuild = state_.rebuild || (is_held(v) && form_->has(state_.graph.id(v)));
    // A variable that was constant, and has factors that were taken so.
    state_.rebuild =
        state_.rebuild || (!is_held(v) && !form_->has(state_.graph.id(v)) &&
                           !state_.displacements[static_cast<std::size_t>(v)].isZero());
  }
  std::vector<Rows> rows;
  for (std::size_t f = 0; f < state_.models.size(); ++f) {
    if (state_.models[f].taken && !state_.rebuild) {
      // Whether one of its variables was constant when it was taken.
      for (const Id id : state_.models[f].rows.variables) {
        if (!form_->has(id) && !is_held(*state_.graph.find(id))) state_.rebuild = true;
      }
    }
  }
  for (std::size_t f = 0; f < state_.models.size(); ++f) {
    if (state_.models[f].taken && !state_.rebuild) continue;
    Rows each = free_rows(state_.models[f]);
    if (!each.variables.empty()) rows.push_back(std::move(each));
  }
  std::vector<Id> variables;
  std::vector<int> sizes;
  for (int v = 0; v < state_.graph.variable_count(); ++v) {
    if (is_held(v) || (!state_.rebuild && form_->has(state_.graph.id(v)))) continue;
    variables.push_back(state_.graph.id(v));
    sizes.push_back(state_.graph.type(v).tangent_size());
  }
  if (state_.rebuild) {
    watch_.forget();
    form_->begin(variables, sizes, rows);
  } else {
    for (std::size_t k = 0; k < variables.size(); ++k) form_->add_variable(variables[k], sizes[k]);
  }
  for (const Rows& each : rows) form_->add(each);
  for (Model& model : state_.models) model.taken = true;
  state_.rebuild = false;
  for (int v = state_.graph.variable_count(); v-- > 0;) {
    if (is_point(state_.graph.type(v)) && v > 0) continue;
    form_->set_newest(state_.graph.id(v));
    break;
  }
  look_for_freedom();
  determined_ = form_->settle() && watch_.free().empty();
}

void LinearizedEstimator::look_for_freedom() {
  watch_.look({.graph = state_.graph,
               .held = [this](int v) { return is_held(v); },
               .live = [](int) { return true; },
               .jacobian =
                   [this](int f, std::span<double> J) {
                     std::ranges::copy(state_.models[static_cast<std::size_t>(f)].rows.J.reshaped(),
                                       J.begin());
                   }});
}

/// Every update after which something is free says what.
void LinearizedEstimator::report_free(UpdateReport& report) const {
  if (watch_.free().empty()) return;
  report.ok = false;
  // In the words of all others: where the factors are now, not where they were linearised.
  std::string sentence = find_free_directions(state_.graph).describe(state_.graph);
  if (sentence.empty()) sentence = watch_.free().describe(state_.graph);
  if (std::ranges::find(report.notes, sentence) == report.notes.end())
    report.notes.push_back(std::move(sentence));
}

void LinearizedEstimator::move_estimate() {
  const std::span<const double> d = form_->displacement();
  const auto next = [&](int v) {
    return Eigen::Map<const VectorXd>(d.data() + form_->offset(state_.graph.id(v)),
                                      state_.graph.type(v).tangent_size());
  };
  std::vector<std::vector<double>> states(state_.displacements.size());  // all, or none moves
  for (int v = 0; v < state_.graph.variable_count(); ++v) {
    if (is_held(v)) continue;
    const auto k = static_cast<std::size_t>(v);
    const VariableType& type = state_.graph.type(v);
    states[k] = batch_ ? moved(type, state_.origins[k], next(v))
                       : moved(type, state_.graph.state(v), next(v) - state_.displacements[k]);
  }
  for (int v = 0; v < state_.graph.variable_count(); ++v) {
    if (is_held(v)) continue;
    state_.graph.set_state(v, states[static_cast<std::size_t>(v)]);
    state_.displacements[static_cast<std::size_t>(v)] = next(v);
  }
}

void LinearizedEstimator::solve(UpdateReport& report) {
  const auto begin = Clock::now();
  take_models();
  if (state_.graph.factor_count() == 0) return;
  report.ok = determined_;
  if (const std::string gauge = gauge_.describe(state_.graph); !gauge.empty()) note(gauge, report);
  if (report.ok && !is_finite(form_->displacement())) {
    report.converged = false;
    note("not converged: the estimate is not finite, and stays as it was", report);
  } else if (report.ok) {
    move_estimate();
    report.iterations = 1;
    report.affected_variables = state_.graph.variable_count();
  } else {
    if (watch_.free().empty()) {
      const int variable = *state_.graph.find(form_->undetermined());
      note(fmt::format("{} is not determined: the estimate stays until it is",
                       state_.graph.describe_variable(variable)),
           report);
    }
    report_free(report);
  }
  report.seconds.factorize = seconds_since(begin);
}

void LinearizedEstimator::batch_step(const UpdateOptions& options, UpdateReport& report) {
  if (state_.graph.factor_count() == 0) return take_models();
  Stop stop = batch_->stop;
  stop.max_seconds = options.max_seconds;
  Summary summary;
  {
    const std::lock_guard lock(*batch_->mutex);
    summary = batch_->optimizer->optimize(state_.graph, stop);
  }
  for (const std::string& sentence : summary.notes) note(sentence, report);
  report.doubts = summary.doubts;
  const std::string why =
      report_batch_step(summary, batch_->stop, options, state_.graph.factor_count(), report);
  if (!why.empty()) doubt(why, report, options.full);
  report.affected_variables = report.iterations * state_.graph.variable_count();
  report.relinearized_factors = state_.graph.factor_count();
  report.seconds.linearize += summary.seconds.linearize + summary.seconds.update;
  report.seconds.order += summary.seconds.analyze;
  report.seconds.factorize += summary.seconds.factorize;
  report.seconds.solve += summary.seconds.solve;
  for (int v = 0; v < state_.graph.variable_count(); ++v) {
    const auto x = state_.graph.state(v);
    state_.origins[static_cast<std::size_t>(v)].assign(x.begin(), x.end());
    state_.displacements[static_cast<std::size_t>(v)].setZero();
  }
  linearize_all();
  take_models();
  report_free(report);
  since_batch_ = 0;
  must_batch_ = report.owed > 0;
}

void LinearizedEstimator::check_converged(UpdateReport& report) {
  if (!report.ok || state_.graph.factor_count() == 0) return;
  const auto [decrease, norm] = newton_step();
  const double chi2 = this->chi2();
  double squares = 0.0;
  for (const AlignedVector& pool : state_.graph.values().pools) {
    for (const double x : pool) squares += x * x;
  }
  report.converged = decrease <= kTolerance * chi2 || norm <= kRounding * std::sqrt(squares);
  if (!report.converged) {
    report.doubt(
        fmt::format("not converged: a filter linearises each factor once; a step from here would "
                    "lower chi2 by about {:.3g} of {:.6g}",
                    decrease, chi2));
  }
}

LinearizedEstimator::Step LinearizedEstimator::newton_step() {
  const auto n = static_cast<std::size_t>(form_->size());
  std::vector<double> g(n, 0.0), step(n, 0.0);
  for (int f = 0; f < state_.graph.factor_count(); ++f) {
    Model model{state_.linearize(f, false)};
    int at = 0;
    const auto on = state_.graph.factor_variables(f);
    for (std::size_t k = 0; k < on.size(); ++k) {  // the residual itself
      const int size = model.rows.sizes[k];
      model.rows.c +=
          model.rows.J.middleCols(at, size) * state_.displacements[static_cast<std::size_t>(on[k])];
      at += size;
    }
    at = 0;
    for (std::size_t k = 0; k < on.size(); ++k) {
      const int size = model.rows.sizes[k];
      if (!is_held(on[k])) {
        Eigen::Map<VectorXd>(g.data() + form_->offset(model.rows.variables[k]), size) -=
            model.rows.J.middleCols(at, size).transpose() * model.rows.c;
      }
      at += size;
    }
  }
  form_->multiply_covariance(g, step);
  const Eigen::Map<const VectorXd> gradient(g.data(), std::ssize(g)),
      delta(step.data(), std::ssize(g));
  return {gradient.dot(delta), delta.norm()};
}

void LinearizedEstimator::note(const std::string& sentence, UpdateReport& report, bool again) {
  if (reported_.insert(sentence).second || again) report.notes.push_back(sentence);
}

void LinearizedEstimator::doubt(const std::string& sentence, UpdateReport& report, bool again) {
  report.doubts.push_back(sentence);
  note(sentence, report, again);
}

void LinearizedEstimator::set_loss(std::shared_ptr<const Loss> loss, const FactorSelector& which) {
  State before = state_.clone();
  try {
    state_.graph.set_loss(loss, which);
    state_.losses = LossRule(std::move(loss), which, state_.graph);
    linearize_all();
  } catch (...) {
    state_ = std::move(before);
    throw;
  }
  take_models();
  must_batch_ = true;
}

// Covariances ------------------------------------------------------------------------------------

bool LinearizedEstimator::covariance(Id a, Id b, std::span<double> block) {
  const std::array rows{a};
  const int size =
      state_.graph.type(index(a)).tangent_size() * state_.graph.type(index(b)).tangent_size();
  if (std::ssize(block) != size) {
    throw Error(ErrorCode::usage,
                fmt::format("the covariance of {} and {} is a block of {} numbers, not {}",
                            state_.graph.describe_variable(index(a)),
                            state_.graph.describe_variable(index(b)), size, block.size()));
  }
  return covariance_column(b, rows, block);
}

bool LinearizedEstimator::covariance_column(Id id, std::span<const Id> variables,
                                            std::span<double> out) {
  const int column = index(id), columns = state_.graph.type(column).tangent_size();
  std::int64_t height = 0;
  for (const Id row : variables) height += state_.graph.type(index(row)).tangent_size();
  if (std::ssize(out) != height * columns) {
    throw Error(ErrorCode::usage,
                fmt::format("that column of the covariance has {} numbers, not {}",
                            height * columns, out.size()));
  }
  if (!determined_) return false;
  std::ranges::fill(out, 0.0);
  if (is_held(column)) return true;
  std::vector<double> unit(static_cast<std::size_t>(form_->size()), 0.0), whole(unit.size());
  auto to = out.begin();
  for (int c = 0; c < columns; ++c) {
    const std::size_t at =
        static_cast<std::size_t>(form_->offset(id)) + static_cast<std::size_t>(c);
    unit[at] = 1.0;
    form_->multiply_covariance(unit, whole);
    unit[at] = 0.0;
    for (const Id row : variables) {
      const int v = index(row), size = state_.graph.type(v).tangent_size();
      if (!is_held(v)) std::copy_n(whole.begin() + form_->offset(row), size, to);
      to += size;
    }
  }
  return true;
}

void LinearizedEstimator::keep_cross(Id a, Id b) {
  index(a);
  index(b);
}

// What it holds ----------------------------------------------------------------------------------

int LinearizedEstimator::index(Id id) const {
  if (const auto v = state_.graph.find(id)) return *v;
  throw Error(ErrorCode::usage, "there is no variable " + id_text(id));
}

std::vector<Id> LinearizedEstimator::variables() const {
  std::vector<Id> ids;
  for (int v = 0; v < state_.graph.variable_count(); ++v) ids.push_back(state_.graph.id(v));
  return ids;
}

std::vector<FactorId> LinearizedEstimator::factors() const {
  std::vector<FactorId> ids;
  for (int f = 0; f < state_.graph.factor_count(); ++f) ids.push_back(state_.ids.id(f));
  return ids;
}

Factor LinearizedEstimator::factor(FactorId id) const {
  if (const auto f = state_.ids.position(id)) return state_.graph.factor(*f);
  throw Error(ErrorCode::usage, fmt::format("there is no factor {}", id));
}

/// The loss is an option too.
void LinearizedEstimator::reset() {
  LossRule losses = std::move(state_.losses);
  losses.clear();
  state_ = {};
  state_.losses = std::move(losses);
  form_->begin({}, {}, {});
  gauge_ = {};
  watch_.forget();
  since_batch_ = 0;
  must_batch_ = determined_ = true;
  reported_.clear();
}

std::unique_ptr<Estimator> LinearizedEstimator::clone() const {
  auto copy = std::make_unique<LinearizedEstimator>(form_->clone(), batch_);
  copy->state_ = state_.clone();
  copy->must_batch_ = must_batch_;
  copy->determined_ = determined_;
  copy->since_batch_ = since_batch_;
  copy->gauge_ = gauge_;
  copy->watch_ = watch_;
  copy->reported_ = reported_;
  return copy;
}

}  // namespace cairn::linearized
