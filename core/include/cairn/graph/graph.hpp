// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "cairn/graph/elements.hpp"
#include "cairn/graph/factor_selector.hpp"
#include "cairn/memory/growing_array.hpp"
#include "cairn/memory/recent_rows.hpp"
#include "cairn/runtime/aligned.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/types/factor_type.hpp"
#include "cairn/types/loss.hpp"
#include "cairn/types/variable_type.hpp"

namespace cairn {

class Information;

/// All states of a graph: one contiguous array for each variable pool, in the order of the pools.
/// Copying it is how an optimizer takes a trial step.
struct Values {
  std::vector<AlignedVector> pools;
};

/// All variables of one type. Shared ownership of the type: a graph may outlive the registry that
/// the type came from, and graphs share types.
struct VariablePool {
  std::shared_ptr<const VariableType> type;
  GrowingArray<std::int32_t> variables;  ///< slot → index of the variable in the graph
};

/// All factors of one type, entry by entry in the order in which they were added.
struct FactorPool {
  std::shared_ptr<const FactorType> type;
  std::vector<std::int32_t> variable_pools;  ///< arity: pool of each of the factor's variables
  GrowingArray<std::int32_t> slots;          ///< size × arity: slot within that pool
  GrowingArray<std::int32_t> variables;      ///< size × arity: index of the variable in the graph
  GrowingArray<double> measurements;         ///< size × measurement_size
  GrowingArray<std::int32_t> noises;         ///< size: which of the information matrices it has
  /// Matrices × n(n+1)/2: upper triangle, row by row, as given. Factors with equal ones share one.
  GrowingArray<double> information;
  GrowingArray<double> sqrt_information;  ///< likewise: U with UᵀU = information
  GrowingArray<std::int16_t> ranks;       ///< matrices: rank of the information
  GrowingArray<std::int32_t> uses;        ///< matrices: how many factors have it
  RecentRows recent;                      ///< of the information matrices
  GrowingArray<std::int16_t> losses;      ///< size: index of the loss in `Graph::losses()`, 0: none
  GrowingArray<std::int32_t> sequence;    ///< position among all factors of the graph

  std::size_t size() const { return sequence.size(); }
};

/// One factor of a graph: which pool and which entry of it.
struct FactorRef {
  std::int32_t pool;
  std::int32_t entry;
};

/// Where variables and factors are after some have left: by old index the new one, or -1.
struct Renumbering {
  std::vector<std::int32_t> variable;
  std::vector<std::int32_t> factor;
};

/// A factor graph: variables and factors in typed pools, and an estimate.
///
/// A variable is known by its `Id` (as in files) and by its index 0 … size-1 in the order of
/// addition, which everything inside cairn uses. Sizes are those of the types; angles are radians,
/// lengths metres unless a type says otherwise. A graph can be moved, not copied by accident: see
/// `clone`.
class CAIRN_API Graph {
 public:
  Graph();
  Graph(Graph&&) noexcept;
  Graph& operator=(Graph&&) noexcept;
  ~Graph();
  Graph clone() const;

  /// Adds a variable with state `x` (ambient_size doubles, normalized here). Returns its index.
  /// Throws `Error` (input) for a duplicate id, a wrong size, a state that is not finite.
  int add_variable(std::shared_ptr<const VariableType> type, Id id, std::span<const double> x);
  /// The same for a variable as a value, which may be fixed.
  int add(const Variable& variable);

  /// Adds a factor on variables given by index. `information` is the upper triangle row by row,
  /// n(n+1)/2 doubles, positive semidefinite and not zero: directions that it does not measure have
  /// no part in chi2. `loss`: see `set_loss`. Returns its position among all factors. Throws
  /// `Error` (input), and leaves the graph as it was, for wrong counts or types of variables, a
  /// variable twice, numbers that are not finite, information that is indefinite or zero.
  int add_factor(std::shared_ptr<const FactorType> type, std::span<const int> variables,
                 std::span<const double> measurement, std::span<const double> information,
                 std::shared_ptr<const Loss> loss = nullptr);
  /// The same for a factor as a value, whose variables are named by id. Throws also where there is
  /// no variable of that id.
  int add(const Factor& factor);

  /// Takes out a variable with all factors on it; what stays moves up. Takes time in proportion to
  /// the whole graph: use `remove` for many. Throws `Error` (usage) if there is no such variable.
  Renumbering erase(Id id);
  /// Takes out one factor, likewise.
  Renumbering erase_factor(int position);

  // Values: defined in cairn/typed/build.hpp, which also says what they throw -------------------
  /// Adds a variable with an initial estimate, such as a `Pose2`. Returns its index.
  template <class T>
  int add(Id id, const T& value);
  /// Adds a measurement, such as a `Between`, with its information and, unless null, a robust loss
  /// of its own. Returns its position among all factors.
  template <class M>
  int add(const M& measurement, const Information& information,
          std::shared_ptr<const Loss> loss = nullptr);
  /// The present estimate of a variable, such as at<Pose2>(3).
  template <class T>
  T at(Id id) const;

  /// Takes out the factors and variables marked (by position and by index); what stays keeps its
  /// order and its state, and moves up. Takes time in proportion to the whole graph. Throws `Error`
  /// (usage), and removes nothing, if a factor that stays is on a variable that leaves.
  Renumbering remove(const std::vector<bool>& factors, const std::vector<bool>& variables);

  /// Makes room for so many in all, of whatever types; purely for speed, so that it is no error if
  /// there is not so much memory. Throws `Error` (usage) for 2³¹ or more of either.
  void reserve(std::size_t variables, std::size_t factors);

  // Variables -----------------------------------------------------------------------------------
  int variable_count() const { return static_cast<int>(records_.size()); }
  Id id(int variable) const { return records_[variable].id; }
  /// Index of the variable with that id, if there is one.
  std::optional<int> find(Id id) const;
  const VariableType& type(int variable) const { return *type_of(variable); }
  const std::shared_ptr<const VariableType>& type_of(int variable) const {
    return variable_pools_[records_[variable].pool].type;
  }
  /// The variable as a value, at its current state.
  Variable variable(int variable) const;
  int pool(int variable) const { return records_[variable].pool; }
  int slot(int variable) const { return records_[variable].slot; }
  /// Held fixed by the user (`FIX`).
  bool fixed(int variable) const { return records_[variable].fixed; }
  void set_fixed(int variable, bool fixed = true);
  /// The current state of one variable: ambient_size doubles.
  std::span<const double> state(int variable) const;
  void set_state(int variable, std::span<const double> x);
  /// "VERTEX_SE2 17", for messages.
  std::string describe_variable(int variable) const;

  // Factors -------------------------------------------------------------------------------------
  int factor_count() const { return static_cast<int>(factors_.size()); }
  FactorRef ref(int position) const { return factors_[position]; }
  const FactorType& factor_type(int position) const { return *type_of_factor(position); }
  const std::shared_ptr<const FactorType>& type_of_factor(int position) const {
    return factor_pools_[factors_[position].pool].type;
  }
  /// The factor as a value, its variables by id.
  Factor factor(int position) const;
  /// Positions of all factors on a variable, rising. Takes time in proportion to the whole graph;
  /// see `FactorsByVariable` for all variables at once.
  std::vector<int> factors_of(int variable) const;
  std::span<const std::int32_t> factor_variables(int position) const;
  std::span<const double> measurement(int position) const;
  std::span<const double> information(int position) const;
  /// U with UᵀU = information, upper triangle row by row.
  std::span<const double> sqrt_information(int position) const;
  int information_rank(int position) const;
  /// How many numbers the factor measures of where its variables are in the world
  /// (`FactorType::absolute_size`), at most the rank of its information.
  int absolute_size(int position) const;
  /// Replaces the measurement and, unless empty, the information of a factor; checks as
  /// `add_factor`.
  void set_measurement(int position, std::span<const double> measurement,
                       std::span<const double> information = {});
  /// "EDGE_SE2 3 17", for messages.
  std::string describe_factor(int position) const;

  // Pools and values ------------------------------------------------------------------------------
  const std::vector<VariablePool>& variable_pools() const { return variable_pools_; }
  const std::vector<FactorPool>& factor_pools() const { return factor_pools_; }
  const Values& values() const { return values_; }
  /// Takes over a set of states; sizes must fit.
  void set_values(Values values);
  /// The arrays of a factor pool at given states. `states` is storage for the view: keep it alive.
  FactorView view(int factor_pool, const Values& values, std::vector<const double*>& states) const;

  std::int64_t tangent_size() const;   ///< over all variables, held or not
  std::int64_t residual_size() const;  ///< over all factors
  /// Changes whenever variables or factors are added or change, or which variables are fixed.
  std::uint64_t structure_version() const { return structure_version_; }

  // Loss ------------------------------------------------------------------------------------------
  /// Robust loss of one factor (null: none), which the factor keeps whatever else is added or
  /// removed. Without effect on a factor whose type takes none (`FactorType::takes_loss`). Shared
  /// ownership: clones of a graph use one loss.
  void set_loss(int position, std::shared_ptr<const Loss> loss);
  /// Sets the loss of the selected factors, and takes it from all others. Factors that are added
  /// later come with their own.
  void set_loss(const std::shared_ptr<const Loss>& loss, const FactorSelector& which = {});
  /// The loss of a factor, or null.
  const Loss* loss(int position) const;
  /// Whether any factor has a loss.
  bool has_losses() const { return losses_.size() > 1; }
  /// All losses in use, the first of them null: none.
  const std::vector<std::shared_ptr<const Loss>>& losses() const { return losses_; }
  /// ρ(s) and its derivative ρ′(s) of the squared norms s of entries [begin, begin + norms.size())
  /// of a factor pool, each by its own loss (s and 1 without). Either output may be empty.
  void weigh(int factor_pool, std::size_t begin, std::span<const double> norms,
             std::span<double> rho, std::span<double> weights) const;
  /// Whether one of these entries has a loss.
  bool any_loss(int factor_pool, std::size_t begin, std::size_t end) const;

 private:
  struct VariableRecord {
    Id id;
    std::int32_t pool;
    std::int32_t slot;
    bool fixed;
  };
  int find_pool(const std::shared_ptr<const VariableType>& type) const;
  int find_pool(const std::shared_ptr<const FactorType>& type) const;
  void check_ends(const FactorType& type, std::span<const int> variables) const;
  std::string name_of(const FactorType& type, std::span<const int> variables) const;
  std::int16_t loss_of(int position) const;
  std::int16_t loss_index(const FactorType& type, const std::shared_ptr<const Loss>& loss);
  void remove_factors(const std::vector<bool>& leaves, const std::vector<std::int32_t>& position);
  void remove_variables(const std::vector<bool>& leaves, const std::vector<std::int32_t>& index);

  GrowingArray<VariableRecord> records_;
  std::vector<VariablePool> variable_pools_;
  Values values_;
  GrowingArray<FactorRef> factors_;
  std::vector<FactorPool> factor_pools_;
  std::unordered_map<Id, int> index_of_id_;
  std::vector<std::shared_ptr<const Loss>> losses_{nullptr};
  std::uint64_t structure_version_ = 0;
  std::size_t expected_variables_ = 0, expected_factors_ = 0;  // by `reserve`, of any type
};

/// Σ ‖r‖² of every factor (whitened, no loss, no half), by position; n = factor_count().
CAIRN_API std::vector<double> squared_norms(const Graph& graph);

/// Σ ρ(‖r‖²) at the graph's states: chi2 as it is stated everywhere in cairn, without a half.
CAIRN_API double chi2(const Graph& graph);

}  // namespace cairn
