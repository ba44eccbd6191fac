// SPDX-License-Identifier: BSD-3-Clause
// Updates that fail half-way, since a factor throws: each is tried with a failure at one evaluation
// after the other, beside a twin that never sees any.
#include "failure_checks.hpp"

#include <algorithm>
#include <atomic>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "cairn/conformance/repetition.hpp"
#include "cairn/conformance/sample_graph.hpp"
#include "cairn/conformance/samples.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/types/wrapped_factor.hpp"

namespace cairn::conformance {
namespace {

constexpr int kPoses = 12;
constexpr int kMostPlaces = 6;  // at which one update fails

/// A relative pose whose evaluations are counted, and one of which throws.
class FailingFactor final : public WrappedFactorType {
 public:
  using WrappedFactorType::WrappedFactorType;
  mutable std::atomic<int> evaluations{0};
  std::atomic<int> fails_at{0};  ///< 0: at none

  void evaluate(const double* const* x, const double* measurement, const double* sqrt_information,
                double* residual, double* const* jacobians) const override {
    if (++evaluations == fails_at) throw std::runtime_error("this factor fails, as it is to");
    WrappedFactorType::evaluate(x, measurement, sqrt_information, residual, jacobians);
  }
};

struct Step {
  std::string what;
  GraphUpdate update;
  UpdateOptions options = {};
};

/// A drive with loops, then each kind of change.
std::vector<Step> steps_of(const Graph& graph) {
  std::vector<Step> steps;
  for (int v = 0; v < graph.variable_count(); ++v) {
    Step step{.what = fmt::format("pose {}", v), .update = {}};
    step.update.variables.push_back(graph.variable(v));
    for (int f = 0; f < graph.factor_count(); ++f) {
      if (std::ranges::max(graph.factor_variables(f)) == v)
        step.update.factors.push_back(graph.factor(f));
    }
    steps.push_back(std::move(step));
  }
  Step change{.what = "another measurement", .update = {}},
      factor{.what = "a removal", .update = {}}, marginal{.what = "marginalisation", .update = {}};
  const std::span<const double> z = graph.measurement(3);
  change.update.changed.push_back({3, {z[0] + 0.1, z[1], z[2]}, {}});
  factor.update.removed_factors = {5};
  marginal.update.marginalized = {1};
  for (Step* step : {&change, &factor, &marginal}) steps.push_back(std::move(*step));
  steps.push_back({.what = "a full step", .update = {}, .options = {.full = true}});
  return steps;
}

State held_by(Estimator& estimator) {
  State all{static_cast<double>(estimator.factor_count()), estimator.chi2()};
  for (const Id id : estimator.variables()) {
    all.push_back(static_cast<double>(id));
    const std::span<const double> x = estimator.state(id);
    all.insert(all.end(), x.begin(), x.end());
    State block(9);
    all.push_back(estimator.covariance(id, id, block) ? 1.0 : 0.0);
    all.insert(all.end(), block.begin(), block.end());
  }
  for (const FactorId id : estimator.factors()) {
    all.push_back(static_cast<double>(id));
    const State measurement = estimator.factor(id).measurement;
    all.insert(all.end(), measurement.begin(), measurement.end());
  }
  return all;
}

/// Whether the update is refused, by whatever is thrown.
bool refuses(Estimator& estimator, const Step& step) {
  try {
    estimator.update(step.update, step.options);
    return false;
  } catch (const std::exception&) {
    return true;
  }
}

}  // namespace

void check_failing_updates(const Subject& subject, Checker& check) {
  PlanarTypes types = own_planar_types();
  const auto type = std::make_shared<FailingFactor>(types.relative_pose);
  types.relative_pose = type;
  const Graph graph = two_laps(kPoses, check.options().seed, types);
  check.sample("", [&] {
    const auto estimator = made<Estimator>(subject, check), twin = made<Estimator>(subject, check);
    for (const Step& step : steps_of(graph)) {
      check.describe(fmt::format("{}, and a factor that throws", step.what));
      const auto copy = check.call("clone", [&] { return twin->clone(); });
      const int before = type->evaluations;
      if (check.call("update", [&] { return refuses(*copy, step); })) continue;
      const int all = type->evaluations - before, stride = std::max(1, all / kMostPlaces);
      for (int at = 1; at <= all; at += stride) {
        type->fails_at = type->evaluations + at;
        const bool refused = check.call("update", [&] { return refuses(*estimator, step); });
        type->fails_at = 0;
        check.expect(refused, "an update fails where a factor throws",
                     [&] { return fmt::format("evaluation {} of {}", at, all); });
        const bool same = check.call("chi2, state and covariance",
                                     [&] { return held_by(*estimator) == held_by(*twin); });
        if (!check.expect(same, "an update that fails changes nothing", [&] {
              return fmt::format("evaluation {} of {} has thrown: {} factors instead of {}", at,
                                 all, estimator->factor_count(), twin->factor_count());
            }))
          return;
      }
      check.call("update", [&] { estimator->update(step.update, step.options); });
      check.call("update", [&] { twin->update(step.update, step.options); });
      const bool same = check.call("chi2, state and covariance",
                                   [&] { return held_by(*estimator) == held_by(*twin); });
      if (!check.expect(same, "an update that failed has no part in later ones",
                        [] { return std::string("the estimates differ"); }))
        return;
    }
  });
}

}  // namespace cairn::conformance
