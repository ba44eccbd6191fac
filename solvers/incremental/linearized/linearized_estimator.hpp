// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "cairn/graph/gauge.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/update/elimination.hpp"
#include "cairn/update/freedom_watch.hpp"
#include "cairn/update/graph_update.hpp"
#include "linear_model.hpp"

namespace cairn::linearized {

/// Steps in which everything is linearised again.
struct BatchSteps {
  int every = 100;  ///< updates from one to the next
  Stop stop;
  std::shared_ptr<Optimizer> optimizer;  ///< shared with clones, which lock `mutex` to use it
  std::shared_ptr<std::mutex> mutex = std::make_shared<std::mutex>();
};

/// An estimator that keeps a linear model of each factor, from when it was linearised, and the
/// Gaussian of all of them in some form.
///
/// Without batch steps it is a filter: a factor is linearised when it arrives, at the mean of that
/// time, and never again. The mean x of a variable moves by x ← retract(x, δ), δ being the change
/// of its displacement; the tangent spaces before and after are identified, as usual in error-state
/// filters (Solà 2017, section 7.2). So on factors that are linear it is exact, and elsewhere its
/// error is that of the points of linearisation. What a filter has taken in can be removed, changed
/// or marginalised all the same, since the linear models are kept: the Gaussian is then built anew
/// from them. A factor with a loss has the weight ρ′ of its arrival. An update with
/// `UpdateOptions::full` solves, and reports as `converged` whether a step of Gauss-Newton from the
/// mean would lower chi2 by less than 10⁻¹⁰ of it, with the covariance of the filter.
///
/// With batch steps every variable keeps its point of linearisation until the next one, and its
/// state is a step from there, as in iSAM (Kaess, Ranganathan, Dellaert 2008). An update that
/// removes, changes or marginalises anything is a batch step.
///
/// Covariances are computed when they are asked for; `keep_marginals` and `keep_cross` need nothing
/// more. They are those of the linear model.
class LinearizedEstimator final : public Estimator {
 public:
  LinearizedEstimator(std::unique_ptr<GaussianForm> form, std::optional<BatchSteps> batch);

  UpdateReport update(const GraphUpdate& update, const UpdateOptions& options) override;
  void set_loss(std::shared_ptr<const Loss> loss, const FactorSelector& which) override;
  bool has(Id id) const override { return state_.graph.find(id).has_value(); }
  int variable_count() const override { return state_.graph.variable_count(); }
  int factor_count() const override { return state_.graph.factor_count(); }
  std::vector<Id> variables() const override;
  std::shared_ptr<const VariableType> type(Id id) const override {
    return state_.graph.type_of(index(id));
  }
  std::vector<FactorId> factors() const override;
  bool has_factor(FactorId id) const override { return state_.ids.position(id).has_value(); }
  Factor factor(FactorId id) const override;
  std::span<const double> state(Id id) override { return state_.graph.state(index(id)); }
  double chi2() override { return cairn::chi2(state_.graph); }
  Graph graph() override { return state_.graph.clone(); }
  void keep_marginals(KeptMarginals) override {}
  void keep_cross(Id a, Id b) override;
  bool covariance(Id a, Id b, std::span<double> block) override;
  bool covariance_column(Id id, std::span<const Id> variables, std::span<double> out) override;
  void reset() override;
  std::unique_ptr<Estimator> clone() const override;
  std::int64_t memory() const override { return form_->memory(); }

 private:
  class Target;
  /// A factor, linearised: J d + c for the displacements of its variables.
  struct Model {
    Rows rows;
    bool taken = false;  ///< by the form
  };
  /// All that an update changes but the form.
  struct State {
    Graph graph;  ///< at the estimate
    FactorIds ids;
    LossRule losses;            ///< of factors to come
    std::vector<Model> models;  ///< by factor
    /// By variable: of the estimate from its point of linearisation, and that point.
    std::vector<Eigen::VectorXd> displacements;
    std::vector<std::vector<double>> origins;
    bool rebuild = true;  ///< something that the form has taken has left or changed

    State clone() const;
    /// Rows J d + c at the estimate or, with `at_origins`, at the points of linearisation.
    Rows linearize(int factor, bool at_origins) const;
    void place_unseen(int factor, bool at_origins);
  };

  class Before;
  void carry_out(const GraphUpdate& update, const UpdateOptions& options, UpdateReport& report);
  bool is_batch_step(const GraphUpdate& update, const UpdateOptions& options) const;
  void linearize_all();
  /// The columns of variables that are not constant; the constant ones are in c.
  Rows free_rows(const Model& model) const;
  bool is_held(int variable) const { return gauge_.held[static_cast<std::size_t>(variable)]; }
  /// Brings the form up to date with the models, sets `determined_`. Every update ends with it, so
  /// that what is asked in between has no part in the order of sums.
  void take_models();
  /// What the models leave free, whatever the rounding of a pivot is.
  void look_for_freedom();
  void report_free(UpdateReport& report) const;
  void move_estimate();
  void solve(UpdateReport& report);
  void batch_step(const UpdateOptions& options, UpdateReport& report);
  void check_converged(UpdateReport& report);
  /// The step of Gauss-Newton from the estimate, with the covariance of the form: what it would
  /// lower chi2 by, and its norm.
  struct Step {
    double decrease, norm;
  };
  Step newton_step();
  /// Once, or `again` each time.
  void note(const std::string& sentence, UpdateReport& report, bool again = false);
  /// That, and a doubt at every update.
  void doubt(const std::string& sentence, UpdateReport& report, bool again = false);
  int index(Id id) const;

  std::unique_ptr<GaussianForm> form_;
  std::optional<BatchSteps> batch_;
  State state_;
  bool must_batch_ = true;
  bool determined_ = true;  ///< the models determine everything
  int since_batch_ = 0;
  Gauge gauge_;
  FreedomWatch watch_;
  std::set<std::string> reported_;  ///< notes are reported once
};

}  // namespace cairn::linearized
