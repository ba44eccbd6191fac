// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/graph/update.hpp"
#include "cairn/runtime/component.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"

namespace cairn {

/// How much is computed in one update.
struct UpdateOptions {
  /// Take in what is new, and solve later: the estimate of old variables stays.
  bool defer = false;
  /// Relinearise, reorder and solve everything, until it has converged.
  bool full = false;
  /// 0: no limit [s]. Otherwise what would take longer is left to later updates and counted as
  /// `owed`; new measurements wait meanwhile.
  double max_seconds = 0.0;
};

/// Seconds of each part of an update.
struct UpdateSeconds {
  double total = 0.0;
  double linearize = 0.0;  ///< evaluating factors
  double order = 0.0;      ///< finding the affected part, ordering it, its symbolic analysis
  double factorize = 0.0;
  double solve = 0.0;      ///< back substitution
  double check = 0.0;      ///< deciding what should be relinearised
  double marginals = 0.0;  ///< keeping covariances up to date

  CAIRN_API UpdateSeconds& operator+=(const UpdateSeconds& other);

  CAIRN_API static ResultFields<UpdateSeconds> fields();
};

/// How the covariances that are kept were updated.
enum class MarginalsBy { none, unchanged, downdate, recomputation };
/// "none", "unchanged", "downdate", "recomputation".
CAIRN_API std::string_view to_string(MarginalsBy by);

/// What an update did.
struct UpdateReport {
  bool ok = true;  ///< false: H is not positive definite; the estimate is the best available
  /// False: everything was to be solved until it has converged (`UpdateOptions::full`), or had to
  /// be, and it has not; a note gives the reason.
  bool converged = true;
  FactorId first_factor = 0;  ///< id of the first of the update's new factors; the others follow it
  /// The ids of the priors that marginalisation left, if any.
  std::vector<FactorId> priors;
  int iterations = 0;            ///< linear systems solved
  int affected_variables = 0;    ///< whose columns of the factor were recomputed, summed
  int relinearized_factors = 0;  ///< besides the new ones
  int owed = 0;                  ///< factors whose relinearisation was deferred to later updates
  MarginalsBy marginals_by = MarginalsBy::none;
  UpdateSeconds seconds;
  /// Notes for the user, one sentence each, such as which variable was anchored.
  std::vector<std::string> notes;
  /// What gives reason to doubt the estimate, as in `Summary`: after every update while it lasts,
  /// though a note may be given once only.
  std::vector<std::string> doubts;

  /// Adds a note that is a reason for doubt.
  CAIRN_API void doubt(std::string sentence);

  CAIRN_API static ResultFields<UpdateReport> fields();
};

/// Which covariances an estimator keeps up to date after every update.
enum class KeptMarginals {
  none,
  last,     ///< the block of the variable that was added last
  diagonal  ///< the blocks of all variables
};

/// Keeps the maximum likelihood estimate of a graph, with covariances, up to date while the graph
/// grows and changes.
///
/// Variables are known by `Id`, factors by `FactorId`. Updates are atomic: an `Error` (input: what
/// is asked for; plugin: a factor throws, however late) leaves the estimator as it was, to the last
/// bit; where that cannot be, as when memory ends, all but `reset` throws `Error` (usage). Of a
/// component without fixed variable or prior the first pose is anchored, as by `resolve_gauge`,
/// which a note reports. It minimises the sum of ρ(‖r‖²), as an `Optimizer` does.
class CAIRN_API Estimator : public Component {
 public:
  static constexpr std::string_view kKind = "estimator";
  ~Estimator() override;

  virtual UpdateReport update(const GraphUpdate& update, const UpdateOptions& options = {}) = 0;

  /// Gives the selected factors this loss (null: none) and takes theirs from all others; factors to
  /// come that have no loss of their own get it if they are selected when they arrive, and keep it.
  /// Everything is relinearised at the next update.
  virtual void set_loss(std::shared_ptr<const Loss> loss, const FactorSelector& which = {}) = 0;

  // What it holds
  // -----------------------------------------------------------------------------------
  virtual bool has(Id id) const = 0;
  virtual int variable_count() const = 0;
  virtual int factor_count() const = 0;
  /// Ids of all variables, in the order of their addition.
  virtual std::vector<Id> variables() const = 0;
  /// Type of a variable. Throws `Error` (usage) for an id that is not there.
  virtual std::shared_ptr<const VariableType> type(Id id) const = 0;
  /// Ids of all factors, rising.
  virtual std::vector<FactorId> factors() const = 0;
  virtual bool has_factor(FactorId id) const = 0;
  /// A factor as a value. Throws `Error` (usage) for an id that is not there.
  virtual Factor factor(FactorId id) const = 0;

  // The estimate. These are not `const`: an estimator may finish its work when it is asked. What is
  // asked never changes a later result.
  /// The current estimate of one variable: ambient_size doubles, good until the next update. Throws
  /// `Error` (usage) for an id that is not there.
  virtual std::span<const double> state(Id id) = 0;
  /// Σ ρ(‖r‖²) at the current estimate; takes as long as evaluating every factor once.
  virtual double chi2() = 0;
  /// Everything at the current estimate, as a graph of its own. Anchored variables are not marked
  /// as fixed in it.
  virtual Graph graph() = 0;

  // Covariances: of δ with x_true = retract(x, δ), x the current estimate -------------------------
  /// From the next update on, keep these.
  virtual void keep_marginals(KeptMarginals kept) = 0;
  /// Keep the cross block of these two as well.
  virtual void keep_cross(Id a, Id b) = 0;
  /// Σ_ab (tangent_a × tangent_b, column-major) of any two variables, a = b included: what is kept
  /// is copied, anything else solved for. Blocks of constant variables are zero. False if H is
  /// singular.
  virtual bool covariance(Id a, Id b, std::span<double> block) = 0;
  /// Σ(:, id): for each variable in the order of `variables` the block of rows; column-major with
  /// as many rows as the tangent sizes add up to.
  virtual bool covariance_column(Id id, std::span<const Id> variables, std::span<double> out) = 0;

  /// Forgets everything but its options.
  virtual void reset() = 0;
  /// A copy, for questions of the kind "what if": neither is affected by changes of the other.
  virtual std::unique_ptr<Estimator> clone() const = 0;
  /// Peak memory of factor and covariances [bytes], as far as it is known.
  virtual std::int64_t memory() const { return 0; }
};

/// Σ of several variables jointly, all of the same tangent size; column-major, as many rows as
/// these sizes add up to. A column is solved for each of them. Zeros where H is singular.
CAIRN_API std::vector<double> joint_covariance(Estimator& estimator, std::span<const Id> variables,
                                               int tangent_size);

}  // namespace cairn
