// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "linearized_estimator.hpp"

namespace cairn::linearized {

inline bool only_adds(const GraphUpdate& update) {
  return update.changed.empty() && update.marginalized.empty() && update.removed_factors.empty() &&
         update.removed_variables.empty();
}

/// All that an update changes, to go back to where it fails half-way: on numbers, or since a factor
/// throws while it is evaluated. An update that only adds evaluates nothing once its factors are
/// linearised: what is new is taken out again. Of any other, of a batch step, and of a filter's
/// answer whether it has converged, everything is copied.
class LinearizedEstimator::Before {
 public:
  Before(const LinearizedEstimator& of, const GraphUpdate& update, const UpdateOptions& options)
      : copies_(!only_adds(update) || options.full || of.is_batch_step(update, options)),
        variables_(of.state_.graph.variable_count()),
        factors_(of.state_.graph.factor_count()),
        ids_(of.state_.ids),
        must_batch_(of.must_batch_),
        since_batch_(of.since_batch_) {
    if (!copies_) return;
    state_ = of.state_.clone();
    form_ = of.form_->clone();
    determined_ = of.determined_;
    gauge_ = of.gauge_;
    reported_ = of.reported_;
  }

  void restore(LinearizedEstimator& to) {
    to.must_batch_ = must_batch_;
    to.since_batch_ = since_batch_;
    if (!copies_) return take_out_what_is_new(to.state_);
    to.state_ = std::move(state_);
    to.form_ = std::move(form_);
    to.determined_ = determined_;
    to.gauge_ = std::move(gauge_);
    to.reported_ = std::move(reported_);
  }

 private:
  void take_out_what_is_new(State& state) {
    Graph& graph = state.graph;
    std::vector<bool> factors(static_cast<std::size_t>(graph.factor_count()), false);
    std::vector<bool> variables(static_cast<std::size_t>(graph.variable_count()), false);
    std::fill(factors.begin() + factors_, factors.end(), true);
    std::fill(variables.begin() + variables_, variables.end(), true);
    for (int v = variables_; v < graph.variable_count(); ++v)
      state.losses.removed_variable(graph, v);
    graph.remove(factors, variables);
    state.ids = std::move(ids_);
    state.models.resize(static_cast<std::size_t>(factors_));
    state.displacements.resize(static_cast<std::size_t>(variables_));
    state.origins.resize(static_cast<std::size_t>(variables_));
  }

  bool copies_;
  int variables_, factors_;
  FactorIds ids_;
  bool must_batch_;
  int since_batch_;
  // If everything is copied:
  State state_;
  std::unique_ptr<GaussianForm> form_;
  bool determined_ = true;
  Gauge gauge_;
  std::set<std::string> reported_;
};

}  // namespace cairn::linearized
