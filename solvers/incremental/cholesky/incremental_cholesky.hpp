// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "cairn/solve/estimator.hpp"
#include "cairn/update/loss_rule.hpp"
#include "engine.hpp"

namespace cairn::incremental {

/// The estimator `incremental_cholesky`: `Engine` behind the interface, which speaks of ids.
class IncrementalCholesky final : public Estimator {
 public:
  struct Options {
    Settings settings;
    int solve_every = 1;  ///< updates that are solved for together
    int full_every = 0;   ///< updates from one full step to the next; 0: never by itself
    double max_seconds = 0.0;
  };
  IncrementalCholesky(const Options& options, std::shared_ptr<Rescuer> rescuer);
  IncrementalCholesky(const IncrementalCholesky& other);
  IncrementalCholesky& operator=(const IncrementalCholesky&) = delete;

  UpdateReport update(const GraphUpdate& update, const UpdateOptions& options) override;
  void set_loss(std::shared_ptr<const Loss> loss, const FactorSelector& which) override;
  bool has(Id id) const override { return find(id).has_value(); }
  int variable_count() const override { return variables_; }
  int factor_count() const override { return factors_; }
  std::vector<Id> variables() const override;
  std::shared_ptr<const VariableType> type(Id id) const override;
  std::vector<FactorId> factors() const override { return engine_->live_ids(); }
  bool has_factor(FactorId id) const override { return position(id).has_value(); }
  Factor factor(FactorId id) const override;
  std::span<const double> state(Id id) override;
  double chi2() override { return engine_->chi2(); }
  Graph graph() override { return engine_->snapshot(); }
  void keep_marginals(KeptMarginals kept) override;
  void keep_cross(Id a, Id b) override;
  bool covariance(Id a, Id b, std::span<double> block) override;
  bool covariance_column(Id id, std::span<const Id> variables, std::span<double> out) override;
  void reset() override;
  std::unique_ptr<Estimator> clone() const override;
  std::int64_t memory() const override { return engine_->doubles() * 8; }

 private:
  class Target;
  std::optional<int> find(Id id) const;
  std::optional<int> position(FactorId id) const;
  int index(Id id) const;
  int block_size(int a, int b) const;
  void apply(const GraphUpdate& update, UpdateReport& report);
  void forget_what_was_read() {
    read_.clear();
    all_.reset();
  }
  void tell_of_anchors(UpdateReport& report);

  Options options_;
  std::shared_ptr<Rescuer> rescuer_;
  std::unique_ptr<Engine> engine_;  // moves when it is reset; never null
  int variables_ = 0, factors_ = 0;
  LossRule losses_;
  int since_solved_ = 0, since_full_ = 0;
  KeptMarginals kept_ = KeptMarginals::none;
  std::map<int, std::vector<double>> read_;  // states by variable, since the last update
  std::optional<States> all_;                // or all of them
  std::set<Id> told_;                        // anchors that a note has named
};

}  // namespace cairn::incremental
