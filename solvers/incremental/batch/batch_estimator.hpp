// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "cairn/linear/graph_marginals.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/update/graph_update.hpp"

namespace cairn {

/// Options of the estimator `batch`.
struct BatchOptions {
  std::string optimizer = "levenberg_marquardt";
  std::string linear_solver = "block_cholesky";
  int iterations = 100;      ///< of a batch step, at most
  double tolerance = 1e-10;  ///< see `Stop`

  static auto fields() {
    using O = BatchOptions;
    return OptionFields<O>()
        .component<Optimizer>(
            "optimizer", &O::optimizer,
            "the optimizer; uses the linear solver below if it has an option of that name")
        .component<LinearSolver>("linear_solver", &O::linear_solver,
                                 "solves the normal equations, and for covariances")
        .integer("iterations", &O::iterations, 1, 1e9,
                 "maximum number of iterations of a batch step")
        .real("tolerance", &O::tolerance, 0.0, 1.0,
              "a batch step ends when chi2 falls by less than this fraction; 0: exactly that many "
              "iterations");
  }
};

/// Options of the estimator `periodic_batch`.
struct PeriodicBatchOptions {
  BatchOptions batch{};
  int every = 100;  ///< updates from one batch step to the next

  static auto fields() {
    using O = PeriodicBatchOptions;
    return OptionFields<O>().part(&O::batch).integer("every", &O::every, 1, 1e9,
                                                     "updates from one batch step to the next");
  }
};

/// The optimizer and the linear solver. Estimators that were cloned share one set, since components
/// cannot be copied; an estimator locks it during use, and `user` is the one whose factorisation
/// the solver has.
struct BatchTools {
  std::mutex mutex;
  std::unique_ptr<Optimizer> optimizer;
  std::unique_ptr<LinearSolver> solver;
  const void* user = nullptr;
};

/// Optimises the whole graph again. With `every` > 1 that is done every so many updates only, as by
/// iSAM (Kaess et al. 2008): in between every variable keeps the point at which it is linearised,
/// and one linear system of all factors is solved for the step from there. Nothing of a
/// factorisation is used again. An update that removes, changes or marginalises anything is a batch
/// step.
class BatchEstimator final : public Estimator {
 public:
  /// `every`: updates from one batch step to the next; `stop`: when a batch step ends.
  BatchEstimator(int every, const Stop& stop, std::shared_ptr<BatchTools> tools);

  UpdateReport update(const GraphUpdate& update, const UpdateOptions& options) override;
  void set_loss(std::shared_ptr<const Loss> loss, const FactorSelector& which) override;
  bool has(Id id) const override { return graph_.find(id).has_value(); }
  int variable_count() const override { return graph_.variable_count(); }
  int factor_count() const override { return graph_.factor_count(); }
  std::vector<Id> variables() const override;
  std::shared_ptr<const VariableType> type(Id id) const override {
    return graph_.type_of(index(id));
  }
  std::vector<FactorId> factors() const override;
  bool has_factor(FactorId id) const override { return ids_.position(id).has_value(); }
  Factor factor(FactorId id) const override;
  std::span<const double> state(Id id) override { return graph_.state(index(id)); }
  double chi2() override { return cairn::chi2(graph_); }
  Graph graph() override { return graph_.clone(); }
  /// These throw `Error` (usage) if the linear solver has no marginals.
  void keep_marginals(KeptMarginals kept) override;
  void keep_cross(Id a, Id b) override;
  bool covariance(Id a, Id b, std::span<double> block) override;
  bool covariance_column(Id id, std::span<const Id> variables, std::span<double> out) override;
  void reset() override;
  std::unique_ptr<Estimator> clone() const override;
  std::int64_t memory() const override { return memory_; }

 private:
  class Before;
  void carry_out(const GraphUpdate& update, const UpdateOptions& options, UpdateReport& report);
  void batch_step(const UpdateOptions& options, UpdateReport& report);
  void linear_step(UpdateReport& report);
  void extend_linearization_points();
  /// Once, or `again` each time.
  void note(const std::string& sentence, UpdateReport& report, bool again = false);
  /// That, and a doubt at every update.
  void doubt(const std::string& sentence, UpdateReport& report, bool again = false);
  void report_free(const FreeDirections& free, UpdateReport& report);
  void compute_kept(UpdateReport& report);
  int index(Id id) const;
  void keep_diagonal(GraphMarginals& all);
  void require_marginals() const;
  void forget_covariances();
  /// At the current states; null if H is singular. The mutex must be locked.
  GraphMarginals* covariances();
  std::size_t block_size(int a, int b) const;

  int every_;
  Stop stop_;
  std::shared_ptr<BatchTools> tools_;
  Graph graph_;
  LossRule losses_;  ///< of factors to come
  FactorIds ids_;
  Values linearized_at_;      ///< the states of `graph_` are a step from here
  int since_batch_ = 0;       ///< updates
  bool must_batch_ = true;    ///< something has changed that a linear step cannot take in
  int unsolved_factors_ = 0;  ///< new since the last solve
  Id last_ = 0;               ///< the variable that was added last
  KeptMarginals kept_ = KeptMarginals::none;
  /// Those that are kept, as of the last solve; empty when out of date.
  std::vector<double> diagonal_;
  std::vector<std::size_t> diagonal_begin_;  ///< by variable
  std::map<std::pair<Id, Id>, std::vector<double>> blocks_;
  std::optional<GraphMarginals> covariances_;  ///< good while the tools' user is this
  bool determined_ = true;                     ///< H is positive definite there
  std::set<std::pair<Id, Id>> crosses_;
  std::set<std::string> told_;  ///< notes are reported once
  std::int64_t memory_ = 0;
};

}  // namespace cairn
