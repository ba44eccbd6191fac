// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "cairn/graph/update.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/update/rejected_factors.hpp"
#include "calls.hpp"
#include "objects.hpp"

struct cairn_estimator {
  std::shared_ptr<cairn::Registry> registry;
  std::string name;
  std::unique_ptr<cairn::Estimator> estimator;
  cairn::GraphUpdate collected = {};  ///< for the next update
  std::string notes = {};
  std::string doubts = {};
};

using namespace cairn::c;

namespace {

constexpr const char* kEstimator = "incremental_cholesky";

/// Names the plugin in what escapes from it.
template <class Work>
auto call(const cairn_estimator& of, const Work& work) {
  return cairn::call_plugin([&] { return fmt::format("estimator '{}'", of.name); }, work);
}

}  // namespace

cairn_code cairn_estimator_new(cairn_registry* registry, const char* spec,
                               cairn_estimator** estimator) {
  return guarded([&] {
    given(estimator, "estimator");
    const auto& from = given(registry, "registry").registry;
    const std::string name(name_or(spec, kEstimator));
    hand_out(estimator, std::make_unique<cairn_estimator>(
                            cairn_estimator{from, name, from->make<cairn::Estimator>(name)}));
  });
}

void cairn_estimator_free(cairn_estimator* estimator) { delete estimator; }

cairn_code cairn_estimator_add_variable(cairn_estimator* estimator, const char* tag, int64_t id,
                                        const double* state, size_t state_size, int fixed) {
  return guarded([&] {
    cairn_estimator& to = given(estimator, "estimator");
    to.collected.variables.push_back(
        variable_of(*to.registry, tag, id, array(state, state_size, "state"), fixed != 0));
  });
}

cairn_code cairn_estimator_add_factor(cairn_estimator* estimator, const char* tag,
                                      const int64_t* ids, size_t id_count,
                                      const double* measurement, size_t measurement_size,
                                      const double* information, size_t information_size) {
  return guarded([&] {
    cairn_estimator& to = given(estimator, "estimator");
    to.collected.factors.push_back(factor_of(*to.registry, tag, array(ids, id_count, "ids"),
                                             array(measurement, measurement_size, "measurement"),
                                             array(information, information_size, "information")));
  });
}

cairn_code cairn_estimator_change_factor(cairn_estimator* estimator, int64_t factor,
                                         const double* measurement, size_t measurement_size,
                                         const double* information, size_t information_size) {
  return guarded([&] {
    const auto z = array(measurement, measurement_size, "measurement");
    const auto omega = array(information, information_size, "information");
    given(estimator, "estimator")
        .collected.changed.push_back({factor, {z.begin(), z.end()}, {omega.begin(), omega.end()}});
  });
}

cairn_code cairn_estimator_remove_factor(cairn_estimator* estimator, int64_t factor) {
  return guarded(
      [&] { given(estimator, "estimator").collected.removed_factors.push_back(factor); });
}

cairn_code cairn_estimator_remove_variable(cairn_estimator* estimator, int64_t id) {
  return guarded([&] { given(estimator, "estimator").collected.removed_variables.push_back(id); });
}

cairn_code cairn_estimator_marginalize(cairn_estimator* estimator, int64_t id) {
  return guarded([&] { given(estimator, "estimator").collected.marginalized.push_back(id); });
}

cairn_code cairn_estimator_update(cairn_estimator* estimator, const cairn_update_options* options,
                                  cairn_report* report) {
  return guarded([&] {
    cairn_estimator& of = given(estimator, "estimator");
    const cairn::GraphUpdate update = std::exchange(of.collected, {});
    cairn::UpdateOptions how;
    if (options) how = {options->defer != 0, options->full != 0, options->max_seconds};
    cairn::UpdateReport did = call(of, [&] { return of.estimator->update(update, how); });
    if (how.full) cairn::note_rejected(of.estimator->graph(), did);
    of.notes = joined(did.notes);
    of.doubts = joined(did.doubts);
    if (!report) return;
    *report = {did.ok ? 1 : 0, did.converged ? 1 : 0, did.first_factor, did.iterations,
               did.owed,       did.seconds.total};
  });
}

const char* cairn_estimator_notes(const cairn_estimator* estimator) {
  return estimator ? estimator->notes.c_str() : "";
}

const char* cairn_estimator_doubts(const cairn_estimator* estimator) {
  return estimator ? estimator->doubts.c_str() : "";
}

size_t cairn_estimator_variable_count(const cairn_estimator* estimator) {
  return estimator ? static_cast<size_t>(estimator->estimator->variable_count()) : 0;
}

size_t cairn_estimator_factor_count(const cairn_estimator* estimator) {
  return estimator ? static_cast<size_t>(estimator->estimator->factor_count()) : 0;
}

cairn_code cairn_estimator_ids(cairn_estimator* estimator, int64_t* ids, size_t count) {
  return guarded([&] {
    const std::vector<cairn::Id> all = given(estimator, "estimator").estimator->variables();
    expect_size(count, all.size(), "the ids of all variables");
    std::ranges::copy(all, array(ids, count, "ids").begin());
  });
}

cairn_code cairn_estimator_estimate(cairn_estimator* estimator, int64_t id, double* state,
                                    size_t size) {
  return guarded([&] {
    cairn_estimator& of = given(estimator, "estimator");
    const std::span<const double> x = call(of, [&] { return of.estimator->state(id); });
    expect_size(size, x.size(), "the state");
    std::ranges::copy(x, array(state, size, "state").begin());
  });
}

cairn_code cairn_estimator_covariance(cairn_estimator* estimator, int64_t a, int64_t b,
                                      double* block, size_t size) {
  return guarded([&] {
    cairn_estimator& of = given(estimator, "estimator");
    const auto rows = static_cast<size_t>(of.estimator->type(a)->tangent_size());
    const auto columns = static_cast<size_t>(of.estimator->type(b)->tangent_size());
    expect_size(size, rows * columns, "the covariance");
    const std::span<double> out = array(block, size, "block");
    std::vector<double> Sigma(rows * columns);
    if (!call(of, [&] { return of.estimator->covariance(a, b, Sigma); })) {
      throw cairn::Error(cairn::ErrorCode::numerical,
                         "there is no covariance: the measurements do not determine everything, or "
                         "rounding takes its digits");
    }
    copy_by_rows(Sigma, rows, out);
  });
}

cairn_code cairn_estimator_chi2(cairn_estimator* estimator, double* chi2) {
  return guarded([&] {
    cairn_estimator& of = given(estimator, "estimator");
    const double value = call(of, [&] { return of.estimator->chi2(); });
    if (!std::isfinite(value)) {
      throw cairn::Error(cairn::ErrorCode::numerical,
                         "chi2 is not finite: a residual overflows, or is not a number");
    }
    given(chi2, "chi2") = value;
  });
}

cairn_code cairn_estimator_graph(cairn_estimator* estimator, cairn_graph** graph) {
  return guarded([&] {
    given(graph, "graph");
    cairn_estimator& of = given(estimator, "estimator");
    hand_out(graph, std::make_unique<cairn_graph>(
                        cairn_graph{of.registry, call(of, [&] { return of.estimator->graph(); })}));
  });
}
