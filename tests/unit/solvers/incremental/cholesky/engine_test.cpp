// SPDX-License-Identifier: BSD-3-Clause
// The estimate against that of solving everything anew, after every single change.
#include "engine.hpp"

#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <ostream>
#include <random>
#include <string>
#include <vector>

#include "cairn/plugin/registry.hpp"
#include "growing_graph.hpp"

namespace cairn::incremental {
namespace {

/// Of a chi2 whose standard deviation is more than one: where the last measurement that contradicts
/// another has gone, chi2 is nothing, and a fraction of it less.
constexpr double kNothing = 1e-4;

struct Case {
  std::string name;
  GrowingTypes types;
  Happenings happenings;
  /// A component that a measurement joins with another is moved far; how far its models are then
  /// off is known less well.
  double accuracy;
};

std::vector<Case> cases() {
  std::vector<Case> all;
  for (const bool spatial : {false, true}) {
    const GrowingTypes types = spatial ? spatial_types() : planar_types();
    const std::string where = spatial ? "InSpace" : "InThePlane";
    all.push_back({"Loops" + where, types, {}, 0.01});
    all.push_back({"BadOdometry" + where, types, {.noise = 0.1}, 0.01});
    all.push_back({"Points" + where, types, {.points = true}, 0.01});
    all.push_back({"Cuts" + where, types, {.cuts = true}, 0.01});
    all.push_back({"Priors" + where, types, {.priors = true}, 0.01});
    all.push_back({"CutsAndPriors" + where, types, {.cuts = true, .priors = true}, 0.01});
  }
  return all;
}

void PrintTo(const Case& of, std::ostream* out) { *out << of.name; }

class EngineOnGrowingGraphs : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    if (!registry_.has("optimizer", "levenberg_marquardt"))
      GTEST_SKIP() << "there is no optimizer levenberg_marquardt";
    rescuer_->optimizer = registry_.make<Optimizer>("levenberg_marquardt");
  }
  /// chi2 of the engine and of the minimum next to its estimate, as an optimizer finds it. On a
  /// copy: what the engine still has to settle stays so.
  std::pair<double, double> chi2_and_minimum(const Engine& engine) {
    Engine copy(engine);
    const double chi2 = copy.chi2();
    Graph graph = copy.snapshot();
    if (graph.factor_count() == 0) return {chi2, chi2};
    return {chi2, rescuer_->optimizer->optimize(graph, {.max_iterations = 200, .tolerance = 1e-12})
                      .final_chi2};
  }

  Registry registry_;
  std::shared_ptr<Rescuer> rescuer_ = std::make_shared<Rescuer>();
};

TEST_P(EngineOnGrowingGraphs, StaysAsAccurateAsItIsAskedToBe) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    Engine engine({}, rescuer_);
    GrowingGraph graph(GetParam().types, GetParam().happenings, seed);
    for (int step = 0; step < 50; ++step) {
      graph.grow(engine);
      UpdateReport report;
      engine.solve(0.0, report);
      ASSERT_TRUE(report.ok) << "seed " << seed << ", step " << step << ":\n" << graph.log();
      const auto [chi2, minimum] = chi2_and_minimum(engine);
      ASSERT_LE(chi2, (1.0 + GetParam().accuracy) * minimum + kNothing)
          << "seed " << seed << ", step " << step << ":\n"
          << graph.log();
    }
  }
}

TEST_P(EngineOnGrowingGraphs, GivesAllDigitsIfAskedTo) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    Engine engine({.accuracy = 0.0, .iterations = 100}, rescuer_);
    GrowingGraph graph(GetParam().types, GetParam().happenings, seed);
    for (int step = 0; step < 50; ++step) {
      graph.grow(engine);
      UpdateReport report;
      engine.solve(0.0, report);
      ASSERT_TRUE(report.ok) << "seed " << seed << ", step " << step << ":\n" << graph.log();
      const auto [chi2, minimum] = chi2_and_minimum(engine);
      ASSERT_NEAR(chi2, minimum, 1e-6 * minimum + 1e-9)
          << "seed " << seed << ", step " << step << ":\n"
          << graph.log();
    }
  }
}

/// Odometry of which nothing contradicts anything: chi2 is rounding, and more so far from the
/// origin.
TEST_P(EngineOnGrowingGraphs, TakesNoRoundingForSomethingToBeSolved) {
  const GrowingTypes& types = GetParam().types;
  const LieGroup& group = *types.pose->lie_group();
  const auto ambient = static_cast<std::size_t>(types.pose->ambient_size());
  const auto tangent = static_cast<std::size_t>(types.pose->tangent_size());
  for (const double far : {0.0, 1e4, 1e6}) {
    Engine engine({}, rescuer_);
    std::vector<double> x(ambient), step(ambient), delta(tangent, 0.0), information;
    types.pose->identity(x.data());
    x[0] = x[1] = far;
    for (std::size_t row = 0; row < tangent; ++row) {
      for (std::size_t column = row; column < tangent; ++column)
        information.push_back(row == column ? 1e6 : 0.0);
    }
    std::mt19937 rng(1);
    int iterations = 0;
    for (int k = 0; k < 200; ++k) {
      if (k > 0) {
        for (double& value : delta) value = std::normal_distribution(0.0, 0.1)(rng);
        delta[0] += 1.0;
        group.exp(delta.data(), step.data());
        group.compose(x.data(), step.data(), x.data());
      }
      engine.problem().edit().add_variable(types.pose, k, x);
      engine.added_variable();
      if (k == 0) continue;
      engine.problem().edit().add_factor(types.relative_pose, std::array{k - 1, k}, step,
                                         information);
      engine.added_factor();
      UpdateReport report;
      engine.solve(0.0, report);
      iterations += report.iterations;
      ASSERT_EQ(report.owed, 0) << "pose " << k << " at " << far << " m";
      ASSERT_EQ(report.relinearized_factors, 0) << "pose " << k << " at " << far << " m";
    }
    EXPECT_LE(iterations, 200) << "at " << far << " m";
  }
}

/// All states, as they are.
std::vector<double> states_of(Engine& engine) {
  std::vector<double> states;
  for (int v = 0; v < engine.graph().variable_count(); ++v) {
    if (!engine.problem().live_variable(v)) continue;
    const std::vector<double> x = engine.x(v);
    states.insert(states.end(), x.begin(), x.end());
  }
  return states;
}

TEST_P(EngineOnGrowingGraphs, ACopyGoesItsOwnWayAndTheSameIfToldTheSame) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    Engine engine({}, rescuer_);
    engine.problem().covariances.keep(KeptMarginals::diagonal);
    GrowingGraph graph(GetParam().types, GetParam().happenings, seed);
    const auto step = [](GrowingGraph& growing, Engine& of) {
      growing.grow(of);
      UpdateReport report;
      of.solve(0.0, report);
      of.problem().update_covariances();
    };
    for (int k = 0; k < 30; ++k) step(graph, engine);
    Engine copy(engine), third(engine);
    GrowingGraph copy_of_graph = graph;
    const auto settled = [](const Engine& of) {  // on a copy, since settling rounds
      Engine copy_of(of);
      return states_of(copy_of);
    };
    const std::vector<double> before = settled(engine);
    const double determinant = engine.problem().tree.log_determinant();
    for (int k = 0; k < 10; ++k) step(copy_of_graph, copy);
    EXPECT_EQ(settled(engine), before) << "seed " << seed;
    EXPECT_EQ(engine.problem().tree.log_determinant(), determinant) << "seed " << seed;
    for (int k = 0; k < 10; ++k) step(graph, engine);
    EXPECT_EQ(settled(engine), settled(copy)) << "seed " << seed;
    EXPECT_EQ(engine.problem().tree.log_determinant(), copy.problem().tree.log_determinant())
        << "seed " << seed;
    EXPECT_EQ(settled(third), before) << "seed " << seed;
  }
}

INSTANTIATE_TEST_SUITE_P(Random, EngineOnGrowingGraphs, testing::ValuesIn(cases()),
                         [](const auto& named) { return named.param.name; });

}  // namespace
}  // namespace cairn::incremental
