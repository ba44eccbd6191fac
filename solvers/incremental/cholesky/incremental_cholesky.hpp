// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>

#include "cairn/solve/estimator.hpp"
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
  void set_loss(std::shared_ptr<const Loss> loss, LossScope scope) override;
  std::span<const double> state(Id id) const override;
  bool has(Id id) const override { return find(id).has_value(); }
  int variable_count() const override { return variables_; }
  int factor_count() const override { return factors_; }
  double chi2() const override { return engine_->chi2(); }
  Graph graph() const override { return engine_->snapshot(); }
  void keep_marginals(KeptMarginals kept) override;
  void keep_cross(Id a, Id b) override;
  bool covariance(Id a, Id b, std::span<double> block) override;
  bool covariance_column(Id id, std::span<const Id> variables, std::span<double> out) override;
  void reset() override;
  std::unique_ptr<Estimator> clone() const override;
  std::int64_t memory() const override { return engine_->doubles() * 8; }

 private:
  std::optional<int> find(Id id) const;
  int index(Id id) const;
  int block_size(int a, int b) const;
  void apply(const GraphUpdate& update, UpdateReport& report);
  void marginalize(const std::vector<Id>& ids, UpdateReport& report);
  void remove_variable(int v);
  void tell_of_anchors(UpdateReport& report);

  Options options_;
  std::shared_ptr<Rescuer> rescuer_;
  std::unique_ptr<Engine> engine_;  // moves when it is reset; never null
  int variables_ = 0, factors_ = 0;
  int since_solved_ = 0, since_full_ = 0;
  KeptMarginals kept_ = KeptMarginals::none;
  mutable int asked_ = 0;  // states, since the last update
  std::set<Id> told_;      // anchors that a note has named
};

}  // namespace cairn::incremental
