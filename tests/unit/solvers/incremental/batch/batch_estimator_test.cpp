// SPDX-License-Identifier: BSD-3-Clause
// What is particular to the estimators that solve everything anew.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>

#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/estimator.hpp"
#include "support/dense_system.hpp"
#include "support/planar_graph.hpp"

namespace cairn::test {
namespace {

class BatchEstimators : public testing::Test {
 protected:
  void SetUp() override {
    if (!registry_.has("estimator", "batch")) GTEST_SKIP() << "there is no estimator batch";
  }
  /// Pose k with its odometry, which turns, and a measurement to the pose three before.
  GraphUpdate step(int k) const {
    GraphUpdate update;
    update.variables.push_back(
        {types_.pose, k, k == 0 ? std::vector<double>{0, 0, 0} : std::vector<double>(), k == 0});
    if (k > 0) update.factors.push_back({types_.relative_pose, {k - 1, k}, {1, 0, 0.7}, kUnit});
    if (k > 2) update.factors.push_back({types_.relative_pose, {k - 3, k}, {1.6, 1.4, 1.9}, kUnit});
    return update;
  }
  const std::vector<double> kUnit = {1, 0, 0, 1, 0, 1};
  Registry registry_;
  PlanarTypes types_;
};

TEST_F(BatchEstimators, PeriodicRelinearisesNowAndThen) {
  const auto estimator = registry_.make<Estimator>("periodic_batch:every=5");
  for (int k = 0; k < 15; ++k) {
    const UpdateReport report = estimator->update(step(k));
    // The first batch step is that of the first measurement; every fifth update after it is one.
    const bool batch = k % 5 == 1;
    EXPECT_TRUE(report.ok);
    if (k < 2) continue;
    EXPECT_EQ(report.relinearized_factors > 0, batch) << k;
    if (!batch) {
      EXPECT_EQ(report.iterations, 1) << k;
    }
  }
}

TEST_F(BatchEstimators, BetweenBatchStepsPeriodicSolvesTheLinearSystem) {
  const auto estimator = registry_.make<Estimator>("periodic_batch:every=100");
  for (int k = 0; k < 6; ++k) estimator->update(step(k));
  estimator->update({}, {.full = true});
  Graph linearized_at = estimator->graph();
  GraphUpdate loop;
  loop.factors.push_back({types_.relative_pose, {0, 5}, {0.5, 2.0, -2.5}, kUnit});
  estimator->update(loop);

  linearized_at.add_factor(types_.relative_pose, std::array{0, 5}, std::array{0.5, 2.0, -2.5},
                           kUnit);
  solve_densely(linearized_at, 1);
  for (int v = 0; v < 6; ++v) {
    for (int k = 0; k < 3; ++k)
      EXPECT_NEAR(estimator->state(v)[k], linearized_at.state(v)[k], 1e-9) << v;
  }
}

// OK is for what has converged, whoever asked: one iteration is not enough here.
TEST_F(BatchEstimators, SayWhereABatchStepHasNotConverged) {
  for (const char* name : {"batch", "periodic_batch:every=1"}) {
    const std::string one = std::string(name) + (name[0] == 'b' ? ":" : ",") + "iterations=1";
    const auto short_of_it = registry_.make<Estimator>(one);
    const auto enough = registry_.make<Estimator>(name);
    const auto counted = registry_.make<Estimator>(one + ",tolerance=0");
    std::vector<std::string> notes;
    for (int k = 0; k < 6; ++k) {
      const UpdateReport report = short_of_it->update(step(k));
      EXPECT_TRUE(enough->update(step(k)).converged) << one << ' ' << k;
      EXPECT_TRUE(counted->update(step(k)).converged) << "made the iterations that were asked for";
      notes.insert(notes.end(), report.notes.begin(), report.notes.end());
      if (k < 3) continue;
      EXPECT_TRUE(report.ok);
      EXPECT_FALSE(report.converged) << one << ' ' << k;
    }
    constexpr const char* kWhy = "not converged: max_iterations after 1 iteration";
    EXPECT_EQ(std::ranges::count(notes, kWhy), 1) << "once; a full update repeats it";
    GraphUpdate loop;
    loop.factors.push_back({types_.relative_pose, {0, 5}, {0.5, 2.0, -2.5}, kUnit});
    const UpdateReport full = short_of_it->update(loop, {.full = true});
    EXPECT_FALSE(full.converged);
    EXPECT_THAT(full.notes, testing::Contains(kWhy));
    EXPECT_FALSE(counted->update(loop, {.full = true}).converged) << "a full one has to converge";
  }
}

TEST_F(BatchEstimators, SayBeforehandThatTheirSolverHasNoCovariances) {
  if (!registry_.has("linear_solver", "pcg")) GTEST_SKIP() << "there is no linear solver pcg";
  const auto estimator = registry_.make<Estimator>("batch:linear_solver=pcg");
  estimator->keep_marginals(KeptMarginals::none);
  try {
    estimator->keep_marginals(KeptMarginals::last);
    ADD_FAILURE() << "it promised them";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::usage);
    EXPECT_THAT(error.what(), testing::HasSubstr("linear_solver=block_cholesky can"));
  }
}

TEST_F(BatchEstimators, ACopyThatWorksDoesNotDisturb) {
  const auto estimator = registry_.make<Estimator>("batch");
  for (int k = 0; k < 6; ++k) estimator->update(step(k));
  std::vector<double> before(9), after(9), other(9);
  ASSERT_TRUE(estimator->covariance(4, 5, before));
  const auto copy = estimator->clone();
  copy->update(step(6));
  ASSERT_TRUE(copy->covariance(4, 5, other));
  ASSERT_TRUE(estimator->covariance(4, 5, after));
  EXPECT_EQ(before, after);
  EXPECT_NE(before, other);
}

}  // namespace
}  // namespace cairn::test
