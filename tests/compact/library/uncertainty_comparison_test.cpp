// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/uncertainty_comparison.hpp"

#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/plugin/registry.hpp"

namespace cairn {
namespace {

using ::testing::SizeIs;

/// Keeps every pose and uses no link; its odometry is taken to have `scale` times the information
/// that it has.
class Scaling final : public PosePolicy {
 public:
  Scaling(std::unique_ptr<Estimator> estimator, double scale)
      : estimator_(std::move(estimator)), scale_(scale) {}
  void add_pose(const Variable& pose, std::span<const Factor> odometry) override {
    GraphUpdate update;
    update.variables.push_back(pose);
    update.factors.assign(odometry.begin(), odometry.end());
    for (Factor& factor : update.factors) {
      for (double& number : factor.information) number *= scale_;
    }
    estimator_->update(update);
    kept_.push_back(pose.id);
  }
  std::optional<MatchProposal> next_match() override { return std::nullopt; }
  LinkReport offer(Id, std::span<const Factor>) override { return {}; }
  PoseReport end_pose() override {
    PoseReport report;
    report.id = kept_.back();
    return report;
  }
  bool finish() override { return true; }
  Estimator& estimator() override { return *estimator_; }
  std::vector<Id> kept() const override { return kept_; }
  int factor_count() const override { return estimator_->factor_count(); }
  std::vector<double> newest_state() const override { return {}; }
  const std::vector<OdometryChain>& chains() const override { return chains_; }

 private:
  std::unique_ptr<Estimator> estimator_;
  double scale_;
  std::vector<Id> kept_;
  std::vector<OdometryChain> chains_;
};

class UncertaintyComparisonTest : public ::testing::Test {
 protected:
  /// Poses on a line, one metre apart, whose odometry measures what is there; links skip two poses.
  PolicyData line(int poses, bool links) {
    Graph graph;
    const auto pose = registry_.variable_type("VERTEX_SE2");
    const auto edge = registry_.factor_type("EDGE_SE2");
    const std::vector<double> information = {40, 0, 0, 90, 0, 300};
    const auto join = [&](int a, int b) {
      graph.add_factor(edge, std::array{a, b}, std::array{double(b - a), 0.0, 0.0}, information);
    };
    for (int k = 0; k < poses; ++k) {
      graph.add_variable(pose, k, std::array{double(k), 0.0, 0.0});
      if (k > 0) join(k - 1, k);
      if (links && k > 2) join(k - 3, k);
    }
    return policy_data(std::move(graph));
  }
  std::vector<UncertaintyStep> compare(const PolicyData& data, double scale) {
    Scaling policy(registry_.make<Estimator>("incremental_cholesky"), scale);
    UncertaintyComparison comparison(data, registry_.make<Estimator>("incremental_cholesky"));
    FunctionRegistration none([](Id, Id) { return std::vector<Factor>(); });
    std::size_t index = 0;
    run_policy(data.recording, data.poses, policy, none, [&](const PoseReport&) {
      comparison.add(index++, policy);
      return true;
    });
    return comparison.steps();
  }
  Registry registry_;
};

TEST_F(UncertaintyComparisonTest, EqualsItselfWhereNothingIsLeftOut) {
  const auto steps = compare(line(6, false), 1.0);
  ASSERT_THAT(steps, SizeIs(5));  // the first pose is held
  for (const UncertaintyStep& step : steps) {
    EXPECT_NEAR(step.marginal / step.marginal_all, 1.0, 1e-12);
    EXPECT_NEAR(step.full / step.full_all, 1.0, 1e-12);
    EXPECT_NEAR(step.least_eigenvalue, 1.0, 1e-12);
  }
  EXPECT_EQ(steps.back().pose, 5);
  EXPECT_EQ(steps.back().kept, 5);
  // Of one step of odometry, Σ is the inverse of the information.
  EXPECT_NEAR(steps.front().marginal, std::hypot(1.0 / 40, 1.0 / 90, 1.0 / 300), 1e-12);
}

TEST_F(UncertaintyComparisonTest, FourTimesTheInformationIsAQuarterOfTheCovariance) {
  const auto steps = compare(line(6, false), 4.0);
  for (const UncertaintyStep& step : steps) {
    EXPECT_NEAR(step.marginal / step.marginal_all, 0.25, 1e-12);
    EXPECT_NEAR(step.full / step.full_all, 0.25, 1e-12);
    EXPECT_NEAR(step.least_eigenvalue, 0.25, 1e-12);
  }
  const Conservativeness c = conservativeness(steps);
  EXPECT_EQ(c.marginal, 0.0);
  EXPECT_EQ(c.full, 0.0);
  EXPECT_NEAR(c.least_eigenvalue, 0.25, 1e-12);
}

TEST_F(UncertaintyComparisonTest, LeavingLinksOutIsConservative) {
  const auto steps = compare(line(9, true), 1.0);
  const Conservativeness c = conservativeness(steps);
  EXPECT_EQ(c.marginal, 1.0);
  EXPECT_EQ(c.full, 1.0);
  EXPECT_NEAR(c.least_eigenvalue, 1.0, 1e-9);  // before the first link nothing is left out
  EXPECT_GT(steps.back().marginal, 1.1 * steps.back().marginal_all);
  EXPECT_GT(steps.back().least_eigenvalue, 1.0);
}

TEST(ConservativenessTest, CountsStepsAndKeepsTheLeast) {
  const std::array<UncertaintyStep, 4> steps{
      {{.marginal = 2, .marginal_all = 1, .full = 1, .full_all = 1, .least_eigenvalue = 1.5},
       {.marginal = 1, .marginal_all = 2, .full = 4, .full_all = 1, .least_eigenvalue = 0.5},
       {.marginal = 1, .marginal_all = 1, .full = 3, .full_all = 4, .least_eigenvalue = 0.75},
       {.marginal = 1 - 1e-7,
        .marginal_all = 1,
        .full = 9,
        .full_all = 1,
        .least_eigenvalue = 1.0}}};
  const Conservativeness c = conservativeness(steps);
  EXPECT_EQ(c.marginal, 0.75);
  EXPECT_EQ(c.full, 0.75);
  EXPECT_EQ(c.least_marginal_ratio, 0.5);
  EXPECT_EQ(c.least_full_ratio, 0.75);
  EXPECT_EQ(c.least_eigenvalue, 0.5);
}

}  // namespace
}  // namespace cairn
