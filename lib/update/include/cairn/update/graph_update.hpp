// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/graph/update.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/update/elimination.hpp"
#include "cairn/update/loss_rule.hpp"

namespace cairn {

// What every estimator does with an update before and besides solving: checking it, placing what is
// new, and carrying it out on a graph.

/// The ids of a graph's factors by position, while factors come and go: they rise with the position
/// and are never used twice.
class CAIRN_API FactorIds {
 public:
  /// The id that the next factor will get.
  FactorId next() const { return next_; }
  FactorId id(int position) const { return ids_[position]; }
  /// Where the factor is; none if it is not there (any more).
  std::optional<int> position(FactorId id) const;
  /// For a factor added to the end of the graph.
  FactorId add();
  /// Follows `Graph::remove`.
  void remove(const Renumbering& numbers);

 private:
  std::vector<FactorId> ids_;
  FactorId next_ = 0;
};

/// How to find the factors, and the variables, that an update refers to.
struct FactorLookup {
  /// Position in the graph of the factor with that id, if it is there.
  std::function<std::optional<int>(FactorId)> position;
  FactorId next = 0;  ///< id of the update's first new factor
  /// Index in the graph of the variable with that id, if it is there; empty: `Graph::find`. For a
  /// graph that still holds variables which have been removed.
  std::function<std::optional<int>(Id)> variable = {};
};

/// Gives the new variables that have no state one: where the first of the update's factors that can
/// puts them, given the others; where none determines all of a variable, one that lacks information
/// in some directions does, in which the variable stays beside the other that it is seen from, or
/// at the identity (`place_in_part`). `state_of` is the estimate of a variable that was there
/// before (empty: unknown). Returns which of `update.variables` no factor places.
CAIRN_API std::vector<int> place_variables(
    GraphUpdate& update, const std::function<std::span<const double>(Id)>& state_of);

/// Checks that an update can be carried out on a graph, to the last number, and changes nothing but
/// the update: its new variables get normalized states, also those that came without one. Throws
/// `Error` (input) that says which variable or factor is wrong, and why.
CAIRN_API void check_update(const Graph& graph, const FactorLookup& factors, GraphUpdate& update);
CAIRN_API void check_update(const Graph& graph, const FactorIds& factors, GraphUpdate& update);

/// What carrying out an update came to.
struct AppliedUpdate {
  FactorId first_factor = 0;
  std::vector<FactorId> priors;  ///< that marginalisation left
};

/// What an update is carried out on: a graph, and whatever follows its changes.
class CAIRN_API UpdateTarget {
 public:
  virtual ~UpdateTarget();

  /// The graph that variables and factors are added to, at its current estimate where `eliminate`
  /// was called.
  virtual Graph& graph() = 0;
  virtual FactorId next_factor() const = 0;
  virtual std::optional<int> position(FactorId id) const = 0;
  /// The graph has a variable or a factor more at its end, a factor another measurement.
  virtual void added_variable() = 0;
  virtual void added_factor() = 0;
  virtual void changed_factor(int position) = 0;
  /// What takes the place of these variables (`cairn::eliminate`); changes nothing.
  virtual Elimination eliminate(std::span<const int> variables) = 0;
  /// Takes out these factors, and these variables with all factors on them.
  virtual void remove(std::span<const int> factors, std::span<const int> variables) = 0;
};

/// Carries out an update that was checked, in the order that `GraphUpdate` states.
CAIRN_API AppliedUpdate carry_out(const GraphUpdate& update, LossRule& losses,
                                  UpdateTarget& target);

/// The same on a graph alone: marginalisation at the graph's states (`eliminate`), holding what
/// `resolve_gauge` holds. Without a rule each factor has the loss that it brings.
CAIRN_API AppliedUpdate apply_update(const GraphUpdate& update, Graph& graph, FactorIds& factors,
                                     LossRule& losses);
CAIRN_API AppliedUpdate apply_update(const GraphUpdate& update, Graph& graph, FactorIds& factors);

}  // namespace cairn
