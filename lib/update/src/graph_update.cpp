// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/update/graph_update.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <unordered_map>
#include <unordered_set>

#include <fmt/format.h>

#include "cairn/graph/gauge.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/update/elimination.hpp"
#include "cairn/update/marginal_prior.hpp"

namespace cairn {
namespace {

Error bad_input(const std::string& message) { return {ErrorCode::input, message}; }

std::string describe(const Factor& factor) {
  std::string text(factor.type->tag());
  for (const Id id : factor.variables) text += fmt::format(" {}", id);
  return text;
}

}  // namespace

// Ids ---------------------------------------------------------------------------------------------

std::optional<int> FactorIds::position(FactorId id) const {
  const auto it = std::ranges::lower_bound(ids_, id);
  if (it == ids_.end() || *it != id) return std::nullopt;
  return static_cast<int>(it - ids_.begin());
}

FactorId FactorIds::add() {
  ids_.push_back(next_);
  return next_++;
}

void FactorIds::remove(const Renumbering& numbers) {
  std::size_t kept = 0;
  for (std::size_t f = 0; f < ids_.size(); ++f) {
    if (numbers.factor[f] >= 0) ids_[kept++] = ids_[f];
  }
  ids_.resize(kept);
}

// Placing -----------------------------------------------------------------------------------------

namespace {

class Placer {
 public:
  Placer(GraphUpdate& update, const std::function<std::span<const double>(Id)>& state_of)
      : update_(update), state_of_(state_of) {
    for (std::size_t k = 0; k < update.variables.size(); ++k) {
      if (update.variables[k].type) new_.emplace(update.variables[k].id, static_cast<int>(k));
    }
  }

  std::vector<int> run() {
    for (bool again = unplaced() > 0; again;) {
      again = false;
      for (const Factor& factor : update_.factors) again = place_by(factor) || again;
      again = again && unplaced() > 0;
    }
    std::vector<int> left;
    for (std::size_t k = 0; k < update_.variables.size(); ++k) {
      if (update_.variables[k].state.empty()) left.push_back(static_cast<int>(k));
    }
    return left;
  }

 private:
  std::ptrdiff_t unplaced() const {
    return std::ranges::count_if(update_.variables,
                                 [](const Variable& v) { return v.state.empty(); });
  }

  std::span<const double> state(Id id) const {
    const auto it = new_.find(id);
    if (it != new_.end()) return update_.variables[it->second].state;
    return state_of_(id);
  }

  /// Places the one variable of a factor that has no place yet. What is wrong with a factor is
  /// found when it is checked.
  bool place_by(const Factor& factor) {
    if (!factor.type || factor.variables.size() != static_cast<std::size_t>(factor.type->arity()) ||
        factor.measurement.size() != static_cast<std::size_t>(factor.type->measurement_size()))
      return false;
    std::vector<const double*> x;
    int target = -1;
    for (std::size_t k = 0; k < factor.variables.size(); ++k) {
      const std::span<const double> at = state(factor.variables[k]);
      x.push_back(at.data());
      if (at.empty()) {
        if (target >= 0) return false;
        target = static_cast<int>(k);
      } else if (at.size() !=
                 static_cast<std::size_t>(factor.type->ambient_size(static_cast<int>(k)))) {
        return false;
      }
    }
    if (target < 0) return false;
    const auto it = new_.find(factor.variables[target]);
    if (it == new_.end()) return false;
    Variable& variable = update_.variables[it->second];
    if (variable.type->tag() != factor.type->variable_tags()[target]) return false;
    std::vector<double> z = factor.measurement, out(variable.type->ambient_size());
    variable.type->identity(out.data());
    x[target] = out.data();
    std::vector<double> placed(out.size());
    if (!factor.type->normalize(z.data()).empty() ||
        !factor.type->propagate(target, x.data(), z.data(), placed.data()) ||
        !std::ranges::all_of(placed, [](double v) { return std::isfinite(v); }) ||
        !variable.type->normalize(placed.data()).empty())
      return false;
    variable.state = std::move(placed);
    return true;
  }

  GraphUpdate& update_;
  const std::function<std::span<const double>(Id)>& state_of_;
  std::unordered_map<Id, int> new_;
};

}  // namespace

std::vector<int> place_variables(GraphUpdate& update,
                                 const std::function<std::span<const double>(Id)>& state_of) {
  return Placer(update, state_of).run();
}

// Checking ----------------------------------------------------------------------------------------

namespace {

/// Checks by carrying it out in small: on a graph of the new variables and factors and of those
/// that they touch. So what is wrong is found, and told, by the graph itself.
class Checker {
 public:
  Checker(const Graph& graph, const FactorLookup& factors, GraphUpdate& update)
      : graph_(graph), factors_(factors), update_(update) {}

  void run() {
    check_variables();
    check_factors();
    check_changed();
    check_leaving();
    for (const int k : unplaced_) {
      throw bad_input(
          fmt::format("{} {}: has no state, and no factor of the update determines it; give it "
                      "a state",
                      update_.variables[k].type->tag(), update_.variables[k].id));
    }
    for (std::size_t k = 0; k < update_.variables.size(); ++k) {
      const std::span<const double> x = sketch_.state(static_cast<int>(k));
      update_.variables[k].state.assign(x.begin(), x.end());
    }
  }

 private:
  void check_variables() {
    for (const Variable& variable : update_.variables) {
      if (!variable.type) throw bad_input(fmt::format("variable {} has no type", variable.id));
      check_type(*variable.type, variable.type.get(), variable.id);
      if (const auto there = graph_.find(variable.id)) {
        throw bad_input(fmt::format("{} {}: the id is already that of {}", variable.type->tag(),
                                    variable.id, graph_.describe_variable(*there)));
      }
    }
    unplaced_ = place_variables(update_, [this](Id id) {
      const auto v = graph_.find(id);
      return v ? graph_.state(*v) : std::span<const double>();
    });
    for (const Variable& variable : update_.variables) {
      std::vector<double> x = variable.state;
      if (x.empty()) {
        x.resize(static_cast<std::size_t>(variable.type->ambient_size()));
        variable.type->identity(x.data());
      }
      sketch_.add_variable(variable.type, variable.id, x);
    }
  }

  void check_type(const VariableType& type, const VariableType* object, Id id) const {
    for (const VariablePool& pool : graph_.variable_pools()) {
      if (pool.type.get() == object || pool.type->tag() != type.tag()) continue;
      throw bad_input(fmt::format(
          "{} {}: another type of that name is in use; take all types from one registry",
          type.tag(), id));
    }
  }

  /// Of a variable in the sketch; one that was in the graph before is added to it.
  int in_sketch(Id id, const Factor& factor) {
    if (const auto there = sketch_.find(id)) return *there;
    const auto v = graph_.find(id);
    if (!v) {
      throw bad_input(fmt::format(
          "{}: there is no variable {}; expected one that was added before or with it, and not "
          "removed",
          describe(factor), id));
    }
    return sketch_.add_variable(graph_.variable_pools()[graph_.pool(*v)].type, id,
                                graph_.state(*v));
  }

  void check_factors() {
    for (const Factor& factor : update_.factors) {
      if (!factor.type) throw bad_input("a new factor has no type");
      std::vector<int> variables;
      for (const Id id : factor.variables) variables.push_back(in_sketch(id, factor));
      sketch_.add_factor(factor.type, variables, factor.measurement, factor.information);
    }
  }

  /// The type and the variables of a factor that was there before, or that the update adds.
  Factor find(FactorId id, std::string_view wanted) const {
    const FactorId first = factors_.next, behind = first + std::ssize(update_.factors);
    if (id >= first && id < behind) return update_.factors[id - first];
    const std::optional<int> position = factors_.position(id);
    if (!position) {
      throw bad_input(fmt::format("there is no factor {} to be {}; ids so far go up to {}", id,
                                  wanted, behind - 1));
    }
    const FactorPool& pool = graph_.factor_pools()[graph_.factor(*position).pool];
    Factor factor{pool.type, {}, {}, {}};
    for (const std::int32_t v : graph_.factor_variables(*position))
      factor.variables.push_back(graph_.id(v));
    const auto z = graph_.measurement(*position), information = graph_.information(*position);
    factor.measurement.assign(z.begin(), z.end());
    factor.information.assign(information.begin(), information.end());
    return factor;
  }

  void check_changed() {
    for (const ChangedFactor& changed : update_.changed) {
      Factor factor = find(changed.factor, "changed");
      if (factor.type->tag() == MarginalPrior::kTag) {
        throw bad_input(
            fmt::format("factor {} is what marginalization left: it cannot be changed, "
                        "only removed",
                        changed.factor));
      }
      factor.measurement = changed.measurement;
      if (!changed.information.empty()) factor.information = changed.information;
      std::vector<int> variables;
      for (const Id id : factor.variables) variables.push_back(in_sketch(id, factor));
      sketch_.add_factor(factor.type, variables, factor.measurement, factor.information);
    }
  }

  void check_leaving() {
    std::unordered_set<Id> marginalized, removed;
    const auto note = [&](Id id, std::unordered_set<Id>& set, const char* what) {
      const bool there = graph_.find(id) || is_new(id);
      if (!there) throw bad_input(fmt::format("there is no variable {} to be {}", id, what));
      if (!set.insert(id).second || marginalized.count(id) + removed.count(id) > 1) {
        throw bad_input(fmt::format("variable {} is to leave twice in one update", id));
      }
    };
    for (const Id id : update_.marginalized) note(id, marginalized, "marginalized");
    for (const Id id : update_.removed_variables) note(id, removed, "removed");
    std::unordered_set<FactorId> gone;
    for (const FactorId id : update_.removed_factors) {
      const Factor factor = find(id, "removed");
      if (!gone.insert(id).second)
        throw bad_input(fmt::format("factor {} is removed twice in one update", id));
      for (const Id on : factor.variables) {
        if (!marginalized.contains(on)) continue;
        throw bad_input(
            fmt::format("factor {} ({}) cannot be removed: variable {} is marginalized in the same "
                        "update, and the factor with it; remove the factor before",
                        id, describe(factor), on));
      }
    }
  }

  bool is_new(Id id) const {
    return std::ranges::any_of(update_.variables, [id](const Variable& v) { return v.id == id; });
  }

  const Graph& graph_;
  const FactorLookup& factors_;
  GraphUpdate& update_;
  Graph sketch_;
  std::vector<int> unplaced_;
};

}  // namespace

void check_update(const Graph& graph, const FactorLookup& factors, GraphUpdate& update) {
  Checker(graph, factors, update).run();
}

void check_update(const Graph& graph, const FactorIds& factors, GraphUpdate& update) {
  check_update(graph, {[&](FactorId id) { return factors.position(id); }, factors.next()}, update);
}

// Carrying out ------------------------------------------------------------------------------------

namespace {

/// Marks for `Graph::remove`.
struct Leaving {
  std::vector<bool> factors, variables;
  explicit Leaving(const Graph& graph)
      : factors(static_cast<std::size_t>(graph.factor_count()), false),
        variables(static_cast<std::size_t>(graph.variable_count()), false) {}
};

void add_factor(const Factor& factor, Graph& graph, FactorIds& ids) {
  std::vector<int> variables;
  for (const Id id : factor.variables) variables.push_back(*graph.find(id));
  graph.add_factor(factor.type, variables, factor.measurement, factor.information);
  ids.add();
}

void marginalize(const GraphUpdate& update, Graph& graph, FactorIds& ids, AppliedUpdate& applied) {
  std::vector<int> variables;
  for (const Id id : update.marginalized) variables.push_back(*graph.find(id));
  const Elimination elimination = eliminate(graph, variables, resolve_gauge(graph).held);
  Leaving leaving(graph);
  for (const int f : elimination.replaced) leaving.factors[f] = true;
  for (const int v : variables) leaving.variables[v] = true;
  ids.remove(graph.remove(leaving.factors, leaving.variables));
  for (const Factor& prior : elimination.priors) {
    applied.priors.push_back(ids.next());
    add_factor(prior, graph, ids);
  }
}

void remove(const GraphUpdate& update, Graph& graph, FactorIds& ids) {
  Leaving leaving(graph);
  for (const FactorId id : update.removed_factors) leaving.factors[*ids.position(id)] = true;
  for (const Id id : update.removed_variables) leaving.variables[*graph.find(id)] = true;
  for (int f = 0; !update.removed_variables.empty() && f < graph.factor_count(); ++f) {
    for (const std::int32_t v : graph.factor_variables(f))
      leaving.factors[f] = leaving.factors[f] || leaving.variables[v];
  }
  ids.remove(graph.remove(leaving.factors, leaving.variables));
}

}  // namespace

AppliedUpdate apply_update(const GraphUpdate& update, Graph& graph, FactorIds& factors) {
  AppliedUpdate applied{factors.next(), {}};
  for (const Variable& variable : update.variables) {
    const int v = graph.add_variable(variable.type, variable.id, variable.state);
    if (variable.fixed) graph.set_fixed(v);
  }
  for (const Factor& factor : update.factors) add_factor(factor, graph, factors);
  for (const ChangedFactor& changed : update.changed)
    graph.set_measurement(*factors.position(changed.factor), changed.measurement,
                          changed.information);
  if (!update.marginalized.empty()) marginalize(update, graph, factors, applied);
  if (!update.removed_factors.empty() || !update.removed_variables.empty())
    remove(update, graph, factors);
  return applied;
}

}  // namespace cairn
