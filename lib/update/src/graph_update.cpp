// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/update/graph_update.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include <fmt/core.h>

#include "cairn/graph/gauge.hpp"
#include "cairn/graph/id_text.hpp"
#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/types/factor_call.hpp"
#include "cairn/update/elimination.hpp"
#include "cairn/update/marginal_prior.hpp"
#include "cairn/update/placement.hpp"

namespace cairn {
namespace {

Error bad_input(const std::string& message) { return {ErrorCode::input, message}; }

std::string describe(const Factor& factor) {
  std::string text(factor.type->tag());
  for (const Id id : factor.variables) text += " " + id_text(id);
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
      unplaced_ += update.variables[k].state.empty();
    }
  }

  std::vector<int> run() {
    for (bool again = true; again && unplaced_ > 0;) {
      again = false;
      for (const Factor& factor : update_.factors)
        again = (unplaced_ > 0 && place_by(factor)) || again;
      // Only where no factor determines all of one: by one that determines it in part.
      again = again || std::ranges::any_of(update_.factors, [this](const Factor& factor) {
                return place_in_part_by(factor);
              });
    }
    std::vector<int> left;
    for (std::size_t k = 0; k < update_.variables.size(); ++k) {
      if (update_.variables[k].state.empty()) left.push_back(static_cast<int>(k));
    }
    return left;
  }

 private:
  std::span<const double> state(Id id) const {
    const auto it = new_.find(id);
    if (it != new_.end()) return update_.variables[it->second].state;
    return state_of_(id);
  }

  /// A factor as its type takes it, all of whose variables but one have their states.
  struct Measured {
    Variable* variable = nullptr;  // that one; null if it is not so
    int target = -1;
    std::vector<const double*> x;
    std::vector<double> z, root;
  };

  /// What is wrong with a factor is found when it is checked.
  Measured look_at(const Factor& factor) {
    if (!factor.type || factor.variables.size() != static_cast<std::size_t>(factor.type->arity()) ||
        factor.measurement.size() != static_cast<std::size_t>(factor.type->measurement_size()) ||
        factor.information.size() != packed_size(factor.type->residual_size()))
      return {};
    Measured one;
    one.x.reserve(factor.variables.size());
    for (std::size_t k = 0; k < factor.variables.size(); ++k) {
      const std::span<const double> at = state(factor.variables[k]);
      one.x.push_back(at.data());
      if (at.empty()) {
        if (one.target >= 0) return {};
        one.target = static_cast<int>(k);
      } else if (at.size() !=
                 static_cast<std::size_t>(factor.type->ambient_size(static_cast<int>(k)))) {
        return {};
      }
    }
    if (one.target < 0) return {};
    const auto it = new_.find(factor.variables[one.target]);
    if (it == new_.end()) return {};
    Variable& variable = update_.variables[it->second];
    one.z = factor.measurement;
    one.root = factor.information;
    if (variable.type->tag() == factor.type->variable_tags()[one.target] &&
        factor.type->normalize(one.z.data()).empty() &&
        square_root(factor.information, factor.type->residual_size(), one.root))
      one.variable = &variable;
    return one;
  }

  /// Places the one variable of a factor that has no place yet, if the factor determines all of it.
  bool place_by(const Factor& factor) {
    Measured one = look_at(factor);
    if (!one.variable) return false;
    std::vector<double> own = identity(*one.variable), placed(own.size());
    one.x[one.target] = own.data();
    return call_factor(
               *factor.type, [&] { return describe(factor); },
               [&] {
                 return place_wholly(*factor.type, one.root, one.target, one.x.data(), one.z.data(),
                                     placed.data());
               }) &&
           take(*one.variable, std::move(placed));
  }

  /// The same by a factor that lacks information in some directions: there the variable stays
  /// beside the other that it is seen from, or at the identity.
  bool place_in_part_by(const Factor& factor) {
    Measured one = look_at(factor);
    if (!one.variable) return false;
    const std::vector<double> own = identity(*one.variable);
    one.x[one.target] = own.data();
    std::vector<double> placed = own;
    return call_factor(
               *factor.type, [&] { return describe(factor); },
               [&] {
                 return place_beside(*factor.type, *one.variable->type, one.root, one.target, one.x,
                                     one.z.data(), placed);
               }) &&
           take(*one.variable, std::move(placed));
  }

  static std::vector<double> identity(const Variable& variable) {
    std::vector<double> state(static_cast<std::size_t>(variable.type->ambient_size()));
    variable.type->identity(state.data());
    return state;
  }
  bool take(Variable& variable, std::vector<double> placed) {
    if (!std::ranges::all_of(placed, [](double v) { return std::isfinite(v); }) ||
        !variable.type->normalize(placed.data()).empty())
      return false;
    variable.state = std::move(placed);
    --unplaced_;
    return true;
  }

  GraphUpdate& update_;
  const std::function<std::span<const double>(Id)>& state_of_;
  std::unordered_map<Id, int> new_;
  int unplaced_ = 0;  // variables without a state
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
                      update_.variables[k].type->tag(), id_text(update_.variables[k].id)));
    }
    for (std::size_t k = 0; k < update_.variables.size(); ++k) {
      const std::span<const double> x = sketch_.state(static_cast<int>(k));
      update_.variables[k].state.assign(x.begin(), x.end());
    }
  }

 private:
  void check_variables() {
    for (const Variable& variable : update_.variables) {
      if (!variable.type)
        throw bad_input(fmt::format("variable {} has no type", id_text(variable.id)));
      check_type(*variable.type, variable.type.get(), variable.id);
      if (const auto there = find_variable(variable.id)) {
        throw bad_input(fmt::format("{} {}: the id is already that of {}", variable.type->tag(),
                                    id_text(variable.id), graph_.describe_variable(*there)));
      }
    }
    unplaced_ = place_variables(update_, [this](Id id) {
      const auto v = find_variable(id);
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
          type.tag(), id_text(id)));
    }
  }

  /// Of a variable in the sketch; one that was in the graph before is added to it.
  int in_sketch(Id id, const Factor& factor) {
    if (const auto there = sketch_.find(id)) return *there;
    const auto v = find_variable(id);
    if (!v) {
      throw bad_input(fmt::format(
          "{}: there is no variable {}; expected one that was added before or with it, and not "
          "removed",
          describe(factor), id_text(id)));
    }
    return sketch_.add_variable(graph_.type_of(*v), id, graph_.state(*v));
  }

  void check_factors() {
    for (const Factor& factor : update_.factors) {
      if (!factor.type) throw bad_input("a new factor has no type");
      for (const Id id : factor.variables) in_sketch(id, factor);
      sketch_.add(factor);
    }
  }

  std::optional<int> find_variable(Id id) const {
    return factors_.variable ? factors_.variable(id) : graph_.find(id);
  }

  /// The type and the variables of a factor that was there before, or that the update adds.
  Factor find(FactorId id, std::string_view wanted) const {
    const FactorId first = factors_.next, behind = first + std::ssize(update_.factors);
    if (id >= first && id < behind) return update_.factors[id - first];
    const std::optional<int> position = factors_.position(id);
    if (!position) {
      throw bad_input(fmt::format("there is no factor {} to be {}; {}", id, wanted,
                                  behind > 0 ? fmt::format("ids so far go up to {}", behind - 1)
                                             : "there are none so far"));
    }
    return graph_.factor(*position);
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
      for (const Id id : factor.variables) in_sketch(id, factor);
      sketch_.add(factor);
    }
  }

  void check_leaving() {
    std::unordered_set<Id> marginalized, removed;
    const auto note = [&](Id id, std::unordered_set<Id>& set, const char* what) {
      const bool there = find_variable(id) || is_new(id);
      if (!there)
        throw bad_input(fmt::format("there is no variable {} to be {}", id_text(id), what));
      if (!set.insert(id).second || marginalized.count(id) + removed.count(id) > 1) {
        throw bad_input(fmt::format("variable {} is to leave twice in one update", id_text(id)));
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
                        id, describe(factor), id_text(on)));
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

UpdateTarget::~UpdateTarget() = default;

AppliedUpdate carry_out(const GraphUpdate& update, LossRule& losses, UpdateTarget& target) {
  AppliedUpdate applied{target.next_factor(), {}};
  Graph& graph = target.graph();
  for (const Variable& variable : update.variables) {
    losses.added_variable(graph, graph.add(variable));
    target.added_variable();
  }
  const auto add = [&](const Factor& factor) {
    losses.added_factor(graph, graph.add(factor));
    target.added_factor();
  };
  for (const Factor& factor : update.factors) add(factor);
  for (const ChangedFactor& change : update.changed) {
    const int f = target.position(change.factor).value();
    graph.set_measurement(f, change.measurement, change.information);
    target.changed_factor(f);
  }
  const auto variables_of = [&](const std::vector<Id>& ids) {
    std::vector<int> variables;
    for (const Id id : ids) {
      if (const std::optional<int> v = graph.find(id)) variables.push_back(*v);
    }
    return variables;
  };
  if (!update.marginalized.empty()) {
    const std::vector<int> variables = variables_of(update.marginalized);
    const Elimination elimination = target.eliminate(variables);
    for (const Factor& prior : elimination.priors) {
      applied.priors.push_back(target.next_factor());
      add(prior);
    }
    for (const int v : variables) losses.removed_variable(graph, v);
    target.remove(elimination.replaced, variables);
  }
  if (update.removed_factors.empty() && update.removed_variables.empty()) return applied;
  std::vector<int> factors;
  for (const FactorId id : update.removed_factors) factors.push_back(target.position(id).value());
  const std::vector<int> variables = variables_of(update.removed_variables);
  for (const int v : variables) losses.removed_variable(graph, v);
  target.remove(factors, variables);
  return applied;
}

namespace {

class PlainTarget final : public UpdateTarget {
 public:
  PlainTarget(Graph& graph, FactorIds& ids) : graph_(graph), ids_(ids) {}

  Graph& graph() override { return graph_; }
  FactorId next_factor() const override { return ids_.next(); }
  std::optional<int> position(FactorId id) const override { return ids_.position(id); }
  void added_variable() override {}
  void added_factor() override { ids_.add(); }
  void changed_factor(int) override {}
  Elimination eliminate(std::span<const int> variables) override {
    return cairn::eliminate(graph_, variables, resolve_gauge(graph_).held);
  }
  void remove(std::span<const int> factors, std::span<const int> variables) override {
    std::vector<bool> factor_leaves(static_cast<std::size_t>(graph_.factor_count()), false);
    std::vector<bool> variable_leaves(static_cast<std::size_t>(graph_.variable_count()), false);
    for (const int f : factors) factor_leaves[f] = true;
    for (const int v : variables) variable_leaves[v] = true;
    for (int f = 0; !variables.empty() && f < graph_.factor_count(); ++f) {
      for (const std::int32_t v : graph_.factor_variables(f))
        factor_leaves[f] = factor_leaves[f] || variable_leaves[v];
    }
    ids_.remove(graph_.remove(factor_leaves, variable_leaves));
  }

 private:
  Graph& graph_;
  FactorIds& ids_;
};

}  // namespace

AppliedUpdate apply_update(const GraphUpdate& update, Graph& graph, FactorIds& factors,
                           LossRule& losses) {
  PlainTarget target(graph, factors);
  return carry_out(update, losses, target);
}

AppliedUpdate apply_update(const GraphUpdate& update, Graph& graph, FactorIds& factors) {
  LossRule none;
  return apply_update(update, graph, factors, none);
}

}  // namespace cairn
