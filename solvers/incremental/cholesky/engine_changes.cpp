// SPDX-License-Identifier: BSD-3-Clause
// What is added, removed, changed and held: brought into the models, H and the gradient.
#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "cairn/update/marginal_prior.hpp"
#include "engine.hpp"

namespace cairn::incremental {
namespace {

/// Up to here chi2 is rounded as if its residuals were of ordinary size.
constexpr double kOrdinaryInformation = 1e12;
/// Relative rounding of a difference of two positions, some operations later.
constexpr double kDigitsOfPositions = 2e-15;
/// A variable that no factor has joined for more than so many solutions is one of long ago.
constexpr std::int64_t kLongAgo = 8;

}  // namespace

/// Starts from a whole graph, at its states.
void Engine::load(Graph graph, std::vector<FactorId> ids) {
  std::vector<std::int32_t> now;
  for (int v = 0; v < graph_.variable_count(); ++v) {
    const auto found = graph.find(graph_.id(v));
    now.push_back(found && live_variable_[v] ? static_cast<std::int32_t>(*found) : -1);
  }
  covariances_.renumber(now);
  graph_ = std::move(graph);
  ids_ = std::move(ids);
  system_ = System();
  states_ = States();
  models_.clear();
  tree_ = Tree(*kernels_);
  factorization_ = {};
  substitution_ = {};
  motions_ = {};
  gauge_ = GaugeWatch();
  held_.clear();
  live_variable_.clear();
  live_factor_.clear();
  factors_of_.clear();
  touched_.clear();
  sources_.clear();
  is_source_.clear();
  steps_ = {};
  moved_.clear();
  has_moved_.clear();
  retiring_.clear();
  looked_.clear();
  followers_.clear();
  job_ = {};
  shown_.reset();
  admitted_ = unsolved_ = 0;
  anchored_.clear();
  disconnected_.clear();
  checked_at_.clear();
  positions_.clear();
  ++loads_;
  broken_ = exhausted_ = gauge_is_old_ = rounding_is_old_ = false;
  dead_ = live_factors_ = 0;
  cost_ = decrease_ = gained_ = rounding_scale_ = 0.0;
  others_ = 0;
  left_share_ = 1.0;
  touched_at_.clear();
  revisits_.clear();
  const int variables = graph_.variable_count(), factors = graph_.factor_count();
  while (states_.size() < variables) added_variable();
  while (models_.size() < factors) added_factor();
  settle_gauge();
}

void Engine::added_variable() {
  const int v = states_.size();
  const VariableType& type = graph_.type(v);
  system_.add_variable(type.tangent_size());
  tree_.add_variable();
  states_.add(graph_.type_of(v), graph_.state(v));
  if (shown_) shown_->add(graph_.state(v));
  steps_.values.resize(static_cast<std::size_t>(system_.scalars()), 0.0);
  gauge_.add_variable(type.tangent_size(), type.lie_group() != nullptr, graph_.fixed(v));
  held_.push_back(1);  // until it has a factor
  covariances_.note_variable(v);
  live_variable_.push_back(1);
  factors_of_.emplace_back();
  touched_at_.push_back(time_);
  has_moved_.push_back(0);
  is_source_.push_back(0);
}

void Engine::added_factor() {
  const int f = models_.size();
  if (f == std::ssize(ids_)) ids_.push_back(next_id_++);
  models_.add(graph_, f);
  live_factor_.push_back(1);
  checked_at_.push_back(-1);
  if (busy()) {
    note_follower(f);
  } else {
    admit();
  }
}

/// The next factor that is there becomes a part of the system.
void Engine::admit() {
  const int f = admitted_++;
  const auto variables = graph_.factor_variables(f);
  gauge_.add_factor(variables.data(), static_cast<int>(variables.size()), graph_.absolute_size(f));
  settle_gauge();
  for (const std::int32_t v : variables) follow(v);
  for (const std::int32_t v : variables) factors_of_[v].push_back(f);
  ++live_factors_;
  ++unsolved_;
  models_.linearize(f, graph_, states_);
  rounding_scale_ += rounding_scale(f);
  cost_ += models_.cost(f);
  put_in(f);
}

/// Below and above what is ordinary, the rounding of a factor's chi2 goes with its information, and
/// far from the origin with the digits that positions have left.
/// What marginalisation leaves has its weight in its Jacobian, and is no larger than what it
/// replaces.
double Engine::rounding_scale(int f) {
  const FactorType& type = graph_.factor_type(f);
  if (type.tag() == MarginalPrior::kTag) return 0.0;
  double largest = 0.0;
  const double* diagonal = graph_.information(f).data();
  for (int left = type.residual_size(); left > 0; diagonal += left--)
    largest = std::max(largest, *diagonal);
  const double ordinary = largest < 1.0 ? largest : std::max(1.0, largest / kOrdinaryInformation);
  double off = 0.0;  // squared, of the residual
  const double* J = models_.jacobian(f);
  for (const std::int32_t v : models_.variables(f)) {
    const auto [coordinates, length] = position(v);
    for (std::int32_t k = 0; k < system_.size(v); ++k) {
      for (std::int32_t row = 0; row < models_.rows(f); ++row, ++J) {
        const double by =
            coordinates[static_cast<std::size_t>(k)] * kDigitsOfPositions * length * *J;
        off += by * by;
      }
    }
  }
  return ordinary + off / kRounding;
}

/// For each coordinate of a variable's steps whether it moves its position, 1 or 0, and how far
/// from the origin that is.
std::pair<std::span<const double>, double> Engine::position(std::int32_t v) {
  const VariableType& type = states_.type(v);
  const Placement* place = type.placement();
  std::vector<double>& coordinates = positions_[&type];
  const auto size = static_cast<std::size_t>(type.tangent_size());
  if (coordinates.size() != size) {
    coordinates.assign(size, place && !place->has_orientation() ? 1.0 : 0.0);
    const LieGroup* group = type.lie_group();
    for (std::size_t k = 0; place && place->has_orientation() && group && k < size; ++k) {
      std::vector<double> step(size, 0.0), x(static_cast<std::size_t>(type.ambient_size()));
      step[k] = 0.1;
      group->exp(step.data(), x.data());
      double R[9] = {}, t[3] = {};
      place->split(x.data(), R, t);
      double trace = 0.0;
      for (int i = 0; i < place->dimension(); ++i) trace += R[i * (place->dimension() + 1)];
      coordinates[k] = trace > place->dimension() - 1e-6 ? 1.0 : 0.0;
    }
  }
  double R[9] = {}, t[3] = {};
  if (place) place->split(states_.x(v), R, t);
  return {coordinates, std::max({std::abs(t[0]), std::abs(t[1]), std::abs(t[2])})};
}

void Engine::changed_factor(int f) {
  must_look_ = rounding_is_old_ = true;
  if (graph_.factor_type(f).absolute_size() > 0) gauge_is_old_ = true;  // its rank may be another
  relinearize(f);
}

void Engine::remove_factor(int f) {
  assert(live_factor_[f]);
  for (const std::int32_t v : models_.variables(f)) follow(v);
  take_out(f);
  live_factor_[f] = 0;
  rounding_is_old_ = true;  // a difference of very unequal numbers would lose the small ones
  cost_ -= models_.cost(f);
  for (const std::int32_t v : models_.variables(f)) {
    std::erase(factors_of_[v], f);
    if (factors_of_[v].empty()) disconnected_.push_back(v);
  }
  for (const std::int32_t v : models_.variables(f)) sum_anew(v);
  --live_factors_;
  ++dead_;
  gauge_is_old_ = true;
}

std::vector<std::int32_t> Engine::take_disconnected() {
  std::vector<std::int32_t> all = std::exchange(disconnected_, {});
  std::ranges::sort(all);
  all.erase(std::unique(all.begin(), all.end()), all.end());
  std::erase_if(all, [&](std::int32_t v) { return !live_variable_[v] || !factors_of_[v].empty(); });
  return all;
}

void Engine::remove_variable(int v) {
  live_variable_[v] = 0;
  if (!held_[v]) {
    covariances_.note_variable(v);  // to be eliminated from what its factors have said
    touch(v);
    retiring_.push_back(v);
    held_[v] = 1;
  }
  ++dead_;
}

Elimination Engine::eliminate(std::span<const int> variables) {
  if (!answers_) return eliminate_here(variables);
  return answers_->object([&] { return eliminate_here(variables); });
}

Elimination Engine::eliminate_here(std::span<const int> variables) {
  std::vector<int> factors;
  for (const int v : variables)
    factors.insert(factors.end(), factors_of_[v].begin(), factors_of_[v].end());
  std::ranges::sort(factors);
  factors.erase(std::unique(factors.begin(), factors.end()), factors.end());
  // Only the states around the variables are read, so only these are brought up to date.
  Values values = graph_.values();
  for (const int f : factors) {
    for (const std::int32_t v : models_.variables(f)) {
      const std::vector<double> now = x(v);
      std::ranges::copy(now,
                        values.pools[graph_.pool(v)].begin() + graph_.slot(v) * std::ssize(now));
    }
  }
  const std::vector<bool> held(held_.begin(), held_.end());
  Values before = graph_.values();
  graph_.set_values(std::move(values));
  try {
    Elimination result = cairn::eliminate(graph_, variables, held, factors);
    graph_.set_values(std::move(before));
    return result;
  } catch (...) {
    graph_.set_values(std::move(before));
    throw;
  }
}

void Engine::settle_gauge() {
  if (gauge_is_old_) watch_gauge_anew();
  gauge_.settle([&](std::int32_t v, bool held) { hold(v, held); });
}

/// Components may have come apart: whom to hold is found out from what is left.
void Engine::watch_gauge_anew() {
  gauge_is_old_ = false;
  gauge_ = GaugeWatch();
  for (int v = 0; v < states_.size(); ++v) {
    const VariableType& type = graph_.type(v);
    gauge_.add_variable(live_variable_[v] ? type.tangent_size() : 0, type.lie_group() != nullptr,
                        graph_.fixed(v));
  }
  for (int f = 0; f < models_.size(); ++f) {
    if (!live_factor_[f]) continue;
    const auto variables = models_.variables(f);
    gauge_.add_factor(variables.data(), static_cast<int>(variables.size()),
                      graph_.absolute_size(f));
  }
}

void Engine::hold(std::int32_t v, bool held) {
  if (held && gauge_.anchored(v)) anchored_.push_back(v);
  if (!live_variable_[v] || (held_[v] != 0) == held) return;
  const auto factors = factors_of_[v];
  if (!factors.empty()) covariances_.note_everything();
  for (const std::int32_t f : factors) {
    for (const std::int32_t other : models_.variables(f)) follow(other);
  }
  for (const std::int32_t f : factors) take_out(f);
  system_.clear_gradient(v);
  if (held) {
    touch(v);
    retiring_.push_back(v);
  } else {
    std::erase(retiring_, v);
  }
  held_[v] = held;
  covariances_.note_variable(v);
  for (const std::int32_t f : factors) put_in(f);
}

void Engine::set_loss(const std::shared_ptr<const Loss>& loss, const FactorSelector& which) {
  Graph graph = snapshot();
  graph.set_loss(loss, which);
  load(std::move(graph), live_ids());
}

void Engine::touch(std::int32_t v) { touched_.push_back(v); }

/// Makes the factor a part of H and g.
void Engine::put_in(int f) {
  const auto variables = models_.variables(f);
  for (std::size_t a = 0; a < variables.size(); ++a) {
    if (held_[variables[a]]) continue;
    touch(variables[a]);
    if (time_ - touched_at_[variables[a]] > kLongAgo) revisits_.note(variables[a]);
    touched_at_[variables[a]] = time_;
    for (std::size_t b = a + 1; b < variables.size(); ++b) {
      if (!held_[variables[b]]) system_.connect(variables[a], variables[b]);
    }
  }
  models_.add_to(system_, states_, f, 1.0, held_);
  covariances_.note(models_, system_, f, 1.0, held_);
  count_bonds(f, 1);
  structure_changed_ = true;
}

/// Whether a factor is anything but a relative one between variables of a group.
bool Engine::is_other(int f) const {
  return !models_.relative(f) || std::ranges::any_of(models_.variables(f), [&](std::int32_t v) {
    return !states_.type(v).lie_group();
  });
}

/// A factor binds its variables to the world unless it is a relative one between some that move.
void Engine::count_bonds(int f, std::int32_t sign) {
  const auto variables = models_.variables(f);
  bool binds = is_other(f);
  if (binds && variables.size() > 1) others_ += sign;
  for (const std::int32_t v : variables) binds = binds || held_[v];
  if (!binds) return;
  for (const std::int32_t v : variables) tree_.bind(v, sign);
}

void Engine::take_out(int f) {
  must_look_ = true;
  count_bonds(f, -1);
  covariances_.note(models_, system_, f, -1.0, held_);
  models_.add_to(system_, states_, f, -1.0, held_);
  const auto variables = models_.variables(f);
  for (std::size_t a = 0; a < variables.size(); ++a) {
    if (held_[variables[a]]) continue;
    touch(variables[a]);
    for (std::size_t b = a + 1; b < variables.size(); ++b) {
      if (!held_[variables[b]]) system_.disconnect(variables[a], variables[b]);
    }
  }
  structure_changed_ = true;
}

/// A variable's part of H from its factors, without what subtracting has left of rounding.
void Engine::sum_anew(std::int32_t v) {
  if (held_[v]) return;
  const std::int32_t size = system_.size(v);
  std::fill_n(system_.diagonal(v), size * size, 0.0);
  for (const System::Link& link : system_.links(v))
    std::fill_n(system_.block(link.entry), size * system_.size(link.other), 0.0);
  for (const std::int32_t f : factors_of_[v]) models_.add_row(system_, f, v, held_);
}

void Engine::relinearize(int f) {
  for (const std::int32_t v : models_.variables(f)) follow(v);
  covariances_.note(models_, system_, f, -1.0, held_);
  models_.add_to(system_, states_, f, -1.0, held_);
  cost_ -= models_.cost(f);
  models_.linearize(f, graph_, states_);
  cost_ += models_.cost(f);
  models_.add_to(system_, states_, f, 1.0, held_);
  covariances_.note(models_, system_, f, 1.0, held_);
  for (const std::int32_t v : models_.variables(f)) {
    if (!held_[v]) touch(v);
  }
}

/// Whoever changes the factors of a variable must have followed first.
void Engine::follow(std::int32_t v) {
  substitution_.follow(system_, tree_, states_, motions_, v, steps_);
  if (!steps_.changed.empty()) apply_steps();
}

/// Moves the estimate by `steps_`.
void Engine::apply_steps() {
  move_states(steps_.changed);
  steps_.clear(system_);
}

void Engine::move_states(std::span<const std::int32_t> variables) {
  for (const std::int32_t v : variables) {
    if (held_[v]) std::fill_n(steps_.values.data() + system_.offset(v), system_.size(v), 0.0);
    if (!std::exchange(has_moved_[v], 1)) moved_.push_back(v);
  }
  states_.move(variables, steps_.values.data());
}

/// For the factors that join its variable with the subtree.
void Engine::turn_models(const Motions::Turn& turn) {
  for (const std::int32_t f : factors_of_[turn.variable]) {
    const auto below = [&](std::int32_t v) { return tree_.below(v, turn.node); };
    if (std::ranges::any_of(models_.variables(f), below))
      models_.move(f, turn.variable, motions_.turned_steps().data() + turn.step);
  }
}

/// `looked_`: the factors of all variables that have moved since factors were last evaluated.
void Engine::collect_moved_factors() {
  ++check_;
  looked_.clear();
  for (const std::int32_t v : moved_) {
    has_moved_[v] = 0;
    for (const std::int32_t f : factors_of_[v]) {
      if (std::exchange(checked_at_[f], check_) != check_) looked_.push_back(f);
    }
  }
  moved_.clear();
}

}  // namespace cairn::incremental
