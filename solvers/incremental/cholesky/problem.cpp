// SPDX-License-Identifier: BSD-3-Clause
#include "problem.hpp"

#include <algorithm>
#include <cassert>
#include <utility>

namespace cairn::incremental {
namespace {

/// A variable that no factor has joined for more than so many solutions is one of long ago.
constexpr std::int64_t kLongAgo = 8;

}  // namespace

void Visits::note(std::int32_t v) {
  if (now - last[v] > kLongAgo) revisits.note(v);
  last[v] = now;
}

// --- what is added ---

Problem Problem::anew(Graph graph, std::span<const FactorId> ids, Answers* answers) const {
  std::vector<std::int32_t> now;
  for (int v = 0; v < graph_->variable_count(); ++v) {
    const auto found = graph.find(graph_->id(v));
    now.push_back(found && live_variable(v) ? static_cast<std::int32_t>(*found) : -1);
  }
  const int variables = graph.variable_count();
  Problem next(tree.kernels(), std::move(graph));
  next.covariances = covariances.renumbered(now);
  next.visits.now = visits.now;
  next.change.must_look = change.must_look;
  next.models.keep_answers(answers);
  while (next.states.size() < variables) next.add_variable();
  for (const FactorId id : ids) next.add_factor(id);
  next.admit_waiting();
  next.settle_gauge();
  return next;
}

void Problem::add_variable() {
  const int v = states.size();
  const Graph& graph = *graph_;
  const VariableType& type = graph.type(v);
  system.add_variable(type.tangent_size());
  tree.add_variable();
  states.add(graph.type_of(v), graph.state(v));
  steps.values.resize(static_cast<std::size_t>(system.scalars()), 0.0);
  gauge_.add_variable(type.tangent_size(), type.lie_group() != nullptr, graph.fixed(v));
  held_.push_back(1);  // until it has a factor
  covariances.note_variable(v);
  variables_.emplace_back();
  visits.last.push_back(visits.now);
  moved_.add_variable();
  change.sources.add_variable();
}

void Problem::add_factor(FactorId id) {
  models.add(*graph_, models.size());
  factors_.push_back({.id = id});
}

void Problem::admit_waiting() {
  while (waiting() > 0) admit();
}

/// The next factor that is there becomes a part of the system.
void Problem::admit() {
  const int f = admitted_++;
  const Graph& graph = *graph_;
  const auto variables = graph.factor_variables(f);
  gauge_.add_factor(variables.data(), static_cast<int>(variables.size()), graph.absolute_size(f));
  settle_gauge();
  for (const std::int32_t v : variables) follow(v);
  for (const std::int32_t v : variables) variables_[v].factors.push_back(f);
  ++live_factors_;
  ++change.factors;
  models.linearize(f, graph, states);
  rounding_.add(graph, states, models, f);
  cost_ += models.cost(f);
  put_in(f);
}

// --- what is changed and removed ---

void Problem::change_factor(int f) {
  change.must_look = true;
  rounding_.forget();
  if (graph_->factor_type(f).absolute_size() > 0) gauge_is_old_ = true;  // its rank may be another
  relinearize(f);
}

void Problem::remove_factor(int f) {
  assert(live_factor(f));
  for (const std::int32_t v : models.variables(f)) follow(v);
  take_out(f);
  factors_[f].live = false;
  rounding_.forget();
  cost_ -= models.cost(f);
  for (const std::int32_t v : models.variables(f)) {
    std::erase(variables_[v].factors, f);
    if (factors_of(v).empty()) disconnected_.push_back(v);
  }
  for (const std::int32_t v : models.variables(f)) sum_anew(v);
  --live_factors_;
  ++dead_;
  gauge_is_old_ = true;
}

std::vector<std::int32_t> Problem::take_disconnected() {
  std::vector<std::int32_t> all = std::exchange(disconnected_, {});
  std::ranges::sort(all);
  all.erase(std::unique(all.begin(), all.end()), all.end());
  std::erase_if(all, [&](std::int32_t v) { return !live_variable(v) || !factors_of(v).empty(); });
  return all;
}

void Problem::remove_variable(int v) {
  variables_[v].live = false;
  if (!held_[v]) {
    covariances.note_variable(v);  // to be eliminated from what its factors have said
    touch(v);
    change.retiring.push_back(v);
    held_[v] = 1;
  }
  ++dead_;
}

Elimination Problem::eliminate(std::span<const int> leaving) {
  Graph& graph = *graph_;
  std::vector<int> factors;
  for (const int v : leaving)
    factors.insert(factors.end(), factors_of(v).begin(), factors_of(v).end());
  std::ranges::sort(factors);
  factors.erase(std::unique(factors.begin(), factors.end()), factors.end());
  // Only the states around the variables are read, so only these are brought up to date.
  Values values = graph.values();
  for (const int f : factors) {
    for (const std::int32_t v : models.variables(f)) {
      const std::vector<double> now = x(v);
      std::ranges::copy(now, values.pools[graph.pool(v)].begin() + graph.slot(v) * std::ssize(now));
    }
  }
  const std::vector<bool> held(held_.begin(), held_.end());
  Values before = graph.values();
  graph.set_values(std::move(values));
  try {
    Elimination result = cairn::eliminate(graph, leaving, held, factors);
    graph.set_values(std::move(before));
    return result;
  } catch (...) {
    graph.set_values(std::move(before));
    throw;
  }
}

// --- what is held ---

void Problem::settle_gauge() {
  if (gauge_is_old_) watch_gauge_anew();
  gauge_.settle([&](std::int32_t v, bool held) { hold(v, held); });
}

/// Components may have come apart: whom to hold is found out from what is left.
void Problem::watch_gauge_anew() {
  gauge_is_old_ = false;
  const Graph& graph = *graph_;
  gauge_ = GaugeWatch();
  for (int v = 0; v < states.size(); ++v) {
    const VariableType& type = graph.type(v);
    gauge_.add_variable(live_variable(v) ? type.tangent_size() : 0, type.lie_group() != nullptr,
                        graph.fixed(v));
  }
  for (int f = 0; f < models.size(); ++f) {
    if (!live_factor(f)) continue;
    const auto variables = models.variables(f);
    gauge_.add_factor(variables.data(), static_cast<int>(variables.size()), graph.absolute_size(f));
  }
}

void Problem::hold(std::int32_t v, bool held) {
  if (held && gauge_.anchored(v)) anchored_.push_back(v);
  if (!live_variable(v) || (held_[v] != 0) == held) return;
  const auto factors = factors_of(v);
  if (!factors.empty()) covariances.note_everything();
  for (const std::int32_t f : factors) {
    for (const std::int32_t other : models.variables(f)) follow(other);
  }
  for (const std::int32_t f : factors) take_out(f);
  system.clear_gradient(v);
  if (held) {
    touch(v);
    change.retiring.push_back(v);
  } else {
    std::erase(change.retiring, v);
  }
  held_[v] = held;
  covariances.note_variable(v);
  for (const std::int32_t f : factors) put_in(f);
}

// --- H and the gradient ---

void Problem::follow_and_touch(int v) {
  if (!is_free(v)) return;
  follow(v);
  touch(v);
}

void Problem::take_touched() {
  change.retiring.clear();
  change.of_structure = false;
  for (const std::int32_t v : change.touched) add_source(v);
  change.touched.clear();
}

void Problem::add_source(std::int32_t v) {
  if (!held_[v]) change.sources.insert(v);
}

void Problem::bring_back() {
  for (int v = 0; v < states.size(); ++v) {
    if (held_[v] || tree.node_of(v) < 0 || !system.has_set_aside(v)) continue;
    system.count_all(v);
    add_source(v);
  }
}

void Problem::begin_solution() {
  settle_gauge();
  ++visits.now;
  states.remember();
}

void Problem::mark_affected() {
  for (const std::int32_t v : change.touched) {
    if (!held_[v] || tree.node_of(v) >= 0) tree.touch(v);
  }
  for (const std::int32_t v : change.retiring) tree.retire(v);
}

/// Makes the factor a part of H and g.
void Problem::put_in(int f) {
  const auto variables = models.variables(f);
  for (std::size_t a = 0; a < variables.size(); ++a) {
    if (held_[variables[a]]) continue;
    touch(variables[a]);
    visits.note(variables[a]);
    for (std::size_t b = a + 1; b < variables.size(); ++b) {
      if (!held_[variables[b]]) system.connect(variables[a], variables[b]);
    }
  }
  models.add_to(system, states, f, 1.0, held_);
  covariances.note(models, system, f, 1.0, held_);
  count_bonds(f, 1);
  change.of_structure = true;
}

bool Problem::is_other(int f) const {
  return !models.relative(f) || std::ranges::any_of(models.variables(f), [&](std::int32_t v) {
    return !states.type(v).lie_group();
  });
}

/// A factor binds its variables to the world unless it is a relative one between some that move.
void Problem::count_bonds(int f, std::int32_t sign) {
  const auto variables = models.variables(f);
  bool binds = is_other(f);
  if (binds && variables.size() > 1) others_ += sign;
  for (const std::int32_t v : variables) binds = binds || held_[v];
  if (!binds) return;
  for (const std::int32_t v : variables) tree.bind(v, sign);
}

void Problem::take_out(int f) {
  change.must_look = true;
  count_bonds(f, -1);
  covariances.note(models, system, f, -1.0, held_);
  models.add_to(system, states, f, -1.0, held_);
  const auto variables = models.variables(f);
  for (std::size_t a = 0; a < variables.size(); ++a) {
    if (held_[variables[a]]) continue;
    touch(variables[a]);
    for (std::size_t b = a + 1; b < variables.size(); ++b) {
      if (!held_[variables[b]]) system.disconnect(variables[a], variables[b]);
    }
  }
  change.of_structure = true;
}

/// A variable's part of H from its factors, without what subtracting has left of rounding.
void Problem::sum_anew(std::int32_t v) {
  if (held_[v]) return;
  const std::int32_t size = system.size(v);
  std::fill_n(system.diagonal(v), size * size, 0.0);
  for (const System::Link& link : system.links(v))
    std::fill_n(system.block(link.entry), size * system.size(link.other), 0.0);
  for (const std::int32_t f : factors_of(v)) models.add_row(system, f, v, held_);
}

void Problem::relinearize(int f) {
  for (const std::int32_t v : models.variables(f)) follow(v);
  covariances.note(models, system, f, -1.0, held_);
  models.add_to(system, states, f, -1.0, held_);
  cost_ -= models.cost(f);
  models.linearize(f, *graph_, states);
  cost_ += models.cost(f);
  models.add_to(system, states, f, 1.0, held_);
  covariances.note(models, system, f, 1.0, held_);
  for (const std::int32_t v : models.variables(f)) {
    if (!held_[v]) touch(v);
  }
}

void Problem::clear_values() {
  moved_.clear();
  change.sources.clear();
  system.clear_values();
  cost_ = 0.0;
}

void Problem::linearize(int f) {
  models.linearize(f, *graph_, states);
  cost_ += models.cost(f);
  models.add_to(system, states, f, 1.0, held_);
}

void Problem::evaluate(std::span<const std::int32_t> factors) {
  double before = 0.0, now = 0.0;
  for (const std::int32_t f : factors) {
    for (const std::int32_t v : models.variables(f)) {
      if (change.sources.contains(v)) continue;
      settle(v);
      add_source(v);
    }
    before += models.cost(f);
  }
  models.correct(factors, *graph_, states, system, held_);
  for (const std::int32_t f : factors) now += models.cost(f);
  cost_ += now - before;
}

double Problem::rounding() {
  if (!rounding_.is_known()) {
    rounding_.clear();
    for (int f = 0; f < admitted_; ++f)
      if (live_factor(f)) rounding_.add(*graph_, states, models, f);
  }
  return rounding_.value();
}

// --- the estimate ---

std::vector<double> Problem::x(int v) const {
  std::vector<double> x(static_cast<std::size_t>(states.ambient(v)));
  if (!motions.read(tree, states, v, x.data())) std::copy_n(states.x(v), x.size(), x.begin());
  return x;
}

/// These states as the pools of the graph hold them.
Values Problem::values_of(const Estimate& estimate) const {
  const Graph& graph = *graph_;
  Values values = graph.values();
  for (int v = 0; v < estimate.size(); ++v) {
    const std::int32_t ambient = states.ambient(v);
    std::copy_n(estimate.x(v), ambient,
                values.pools[graph.pool(v)].begin() + std::ptrdiff_t{graph.slot(v)} * ambient);
  }
  return values;
}

void Problem::follow(std::int32_t v) {
  substitution.follow(system, tree, states, motions, v, steps);
  if (steps.changed.empty()) return;
  move(steps.changed);
  steps.clear(system);
}

void Problem::move(std::span<const std::int32_t> variables) {
  for (const std::int32_t v : variables) {
    if (held_[v]) std::fill_n(steps.values.data() + system.offset(v), system.size(v), 0.0);
    moved_.insert(v);
  }
  states.move(variables, steps.values.data());
}

void Problem::turn_models(const Motions::Turn& turn) {
  for (const std::int32_t f : factors_of(turn.variable)) {
    const auto below = [&](std::int32_t v) { return tree.below(v, turn.node); };
    if (std::ranges::any_of(models.variables(f), below))
      models.move(f, turn.variable, motions.turned_steps().data() + turn.step);
  }
}

std::vector<std::int32_t> Problem::take_moved_factors() {
  std::vector<std::int32_t> factors;
  factors.reserve(2 * moved_.list().size());
  for (const std::int32_t v : moved_.list()) {
    for (const std::int32_t f : factors_of(v)) {
      if (!std::exchange(factors_[f].is_collected, true)) factors.push_back(f);
    }
  }
  for (const std::int32_t f : factors) factors_[f].is_collected = false;
  moved_.clear();
  return factors;
}

// --- what is there ---

std::int32_t Problem::place_of(FactorId id) const {
  const auto found = std::ranges::lower_bound(factors_, id, {}, &FactorRecord::id);
  const bool there = found != factors_.end() && found->id == id && found->live;
  return there ? static_cast<std::int32_t>(found - factors_.begin()) : -1;
}

std::vector<FactorId> Problem::live_ids() const {
  std::vector<FactorId> ids;
  for (const FactorRecord& factor : factors_) {
    if (factor.live) ids.push_back(factor.id);
  }
  return ids;
}

Graph Problem::clean_graph(const Estimate& estimate) const {
  Graph graph = graph_->clone();
  graph.set_values(values_of(estimate));
  if (dead_ == 0) return graph;
  std::vector<bool> factors, variables;
  for (const FactorRecord& factor : factors_) factors.push_back(!factor.live);
  for (const VariableRecord& variable : variables_) variables.push_back(!variable.live);
  graph.remove(factors, variables);
  return graph;
}

}  // namespace cairn::incremental
