// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/batch_comparison.hpp"

#include <array>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/solve/initial_guess.hpp"
#include "support/planar_graph.hpp"

namespace cairn {
namespace {

TEST(BatchCheckTest, ExcessIsAboveTheLowerOptimisation) {
  EXPECT_DOUBLE_EQ((BatchCheck{.chi2 = 3.0, .batch = 2.0, .polished = 4.0}).excess(), 0.5);
  EXPECT_DOUBLE_EQ((BatchCheck{.chi2 = 3.0, .batch = 4.0, .polished = 3.0}).excess(), 0.0);
  // Without loop closures both are rounding; what is above it is not overlooked.
  EXPECT_NEAR((BatchCheck{.chi2 = 3e-26, .batch = 2e-26, .polished = 4e-26}).excess(), 0.0, 1e-12);
  EXPECT_DOUBLE_EQ((BatchCheck{.chi2 = 0.0, .batch = 0.0, .polished = 0.0}).excess(), 0.0);
  EXPECT_GT((BatchCheck{.chi2 = 3.0, .batch = 0.0, .polished = 1.0}).excess(), 1e6);
}

/// Odometry that turns by a quarter four times, and a loop closure that contradicts it a little.
class BatchCheckerTest : public ::testing::Test {
 protected:
  BatchCheckerTest() {
    constexpr double kQuarter = 1.5707963267948966;
    for (int k = 0; k < 5; ++k)
      recording_.add_variable(types_.pose, k, std::array{0.1 * k, 0.2, 0.3});
    for (int k = 1; k < 5; ++k) join(k - 1, k, {1.0, 0.0, kQuarter});
    join(0, 4, {0.2, -0.1, 0.05});
    recording_.set_fixed(0);
  }
  void join(int a, int b, const std::vector<double>& z) {
    recording_.add_factor(types_.relative_pose, std::array{a, b}, z,
                          std::vector<double>{10, 0, 0, 10, 0, 40});
  }
  std::vector<BatchCheck> replay(Estimator& estimator, BatchProblem problem) {
    BatchChecker checker(recording_, std::move(problem), registry_);
    std::vector<BatchCheck> checks;
    for (const Arrival& arrival : arrival_order(recording_)) {
      GraphUpdate update = arrival_update(recording_, arrival);
      leave_states_to_factors(update, estimator);
      estimator.update(update, {.full = true});
      checker.add(arrival);
      checks.push_back(checker.check(static_cast<int>(checks.size()) + 1, estimator));
    }
    return checks;
  }
  BatchProblem from_odometry() {
    return {.initialise = [this](Graph& graph) { odometry_->compute(graph); }};
  }

  test::PlanarTypes types_;
  Registry registry_;
  std::unique_ptr<InitialGuess> odometry_ = registry_.make<InitialGuess>("odometry");
  Graph recording_;
};

TEST_F(BatchCheckerTest, AnEstimatorThatConvergesIsWhereBatchIs) {
  const auto estimator = registry_.make<Estimator>("batch");
  BatchProblem problem = from_odometry();
  const std::vector<BatchCheck> checks = replay(*estimator, problem);
  ASSERT_EQ(checks.size(), 5U);
  for (int k = 0; k < 4; ++k) EXPECT_NEAR(checks[k].batch, 0.0, 1e-12) << k;  // no loop yet
  const BatchCheck& last = checks.back();
  EXPECT_EQ(last.step, 5);
  EXPECT_GT(last.batch, 0.01);
  EXPECT_NEAR(last.excess(), 0.0, 1e-9);
  EXPECT_NEAR(last.polished, last.batch, 1e-9 * last.batch);
  EXPECT_FALSE(last.covariance_difference.has_value());
}

TEST_F(BatchCheckerTest, AnEstimatorThatHasNotSolvedIsAboveBatch) {
  // One linear solve in a hundred updates: the loop closure is not in the estimate.
  const auto estimator = registry_.make<Estimator>("periodic_batch:every=100");
  BatchChecker checker(recording_, from_odometry(), registry_);
  for (const Arrival& arrival : arrival_order(recording_)) {
    GraphUpdate update = arrival_update(recording_, arrival);
    leave_states_to_factors(update, *estimator);
    estimator->update(update, {.defer = true});
    checker.add(arrival);
  }
  const BatchCheck check = checker.check(5, *estimator);
  EXPECT_GT(check.excess(), 0.1);
  EXPECT_NEAR(check.polished, check.batch, 1e-6 * check.batch);
}

TEST_F(BatchCheckerTest, ComparesTheCovariancesThatAreKept) {
  const auto estimator = registry_.make<Estimator>("incremental_cholesky");
  estimator->keep_marginals(KeptMarginals::diagonal);
  BatchProblem problem = from_odometry();
  problem.covariances = true;
  for (const BatchCheck& check : replay(*estimator, problem)) {
    ASSERT_TRUE(check.covariance_difference.has_value());
    EXPECT_LT(*check.covariance_difference, 1e-6);
  }
}

TEST_F(BatchCheckerTest, ALossCountsInBatchAsInTheEstimator) {
  std::shared_ptr<const Loss> loss = registry_.make<Loss>("huber:scale=0.1");
  const auto estimator = registry_.make<Estimator>("batch");
  estimator->set_loss(loss, FactorSelector::all());
  BatchProblem problem = from_odometry();
  const double squared = replay(*registry_.make<Estimator>("batch"), problem).back().batch;
  problem.loss = loss;
  const BatchCheck robust = replay(*estimator, problem).back();
  EXPECT_LT(robust.batch, squared);
  EXPECT_NEAR(robust.chi2, robust.polished, 1e-6 * robust.chi2);
}

}  // namespace
}  // namespace cairn
