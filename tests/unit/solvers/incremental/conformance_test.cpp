// SPDX-License-Identifier: BSD-3-Clause
// What every estimator owes, whoever wrote it. CAIRN_SEQUENCES says how many random sequences each
// goes through, CAIRN_SEED with which seed they begin.
#include <cstdlib>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "cairn/lie/se2.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "random_sequence.hpp"
#include "support/dense_system.hpp"

namespace cairn::test {
namespace {

unsigned from_environment(const char* name, unsigned otherwise) {
  const char* text = std::getenv(name);
  return text ? static_cast<unsigned>(std::strtoul(text, nullptr, 10)) : otherwise;
}

/// One of them with a limit of time that leaves it a piece of work in each update as well.
std::vector<std::string> every_estimator() {
  std::vector<std::string> names = Registry().names(Estimator::kKind);
  if (Registry().has(Estimator::kKind, "incremental_cholesky"))
    names.emplace_back("incremental_cholesky:budget=1e-9");
  return names;
}

const std::vector<double> kUnit = {1, 0, 0, 1, 0, 1};

class EveryEstimator : public testing::TestWithParam<std::string> {
 protected:
  Variable pose(Id id, std::vector<double> state = {}, bool fixed = false) const {
    return {types_.pose, id, std::move(state), fixed};
  }
  Factor between(Id a, Id b, std::vector<double> z = {1.0, 0.0, 0.1}) const {
    return {types_.relative_pose, {a, b}, std::move(z), kUnit};
  }
  /// Poses 0 … n-1 in a chain.
  GraphUpdate chain(int n) const {
    GraphUpdate update;
    update.variables.push_back(pose(0, {0.0, 0.0, 0.0}));
    for (int k = 1; k < n; ++k) {
      update.variables.push_back(pose(k));
      update.factors.push_back(between(k - 1, k));
    }
    return update;
  }
  /// Linearises each factor once, when it arrives: its estimate is another than the minimum, which
  /// is what `UpdateReport::converged` says (filters_test.cpp has what it must be).
  bool is_filter() const {
    return GetParam() == "ekf" || GetParam() == "eif" || GetParam() == "seif";
  }

  Registry registry_;
  PlanarTypes types_;
  std::unique_ptr<Estimator> estimator_ = registry_.make<Estimator>(GetParam());
};

TEST_P(EveryEstimator, AgreesWithAFreshSolveWhateverHappens) {
  const unsigned first = from_environment("CAIRN_SEED", 1),
                 count = from_environment("CAIRN_SEQUENCES", 300);
  for (unsigned seed = first; seed < first + count; ++seed) {
    const auto estimator = registry_.make<Estimator>(GetParam());
    RandomSequence sequence(*estimator, seed, !is_filter());
    sequence.run(20);
    ASSERT_FALSE(HasFailure()) << "seed " << seed << ":\n" << sequence.log();
  }
}

TEST_P(EveryEstimator, PlacesWhatIsNewByItsMeasurements) {
  estimator_->update(chain(3), {.defer = true});
  const std::span<const double> x = estimator_->state(2);
  const auto expected = Se2::compose<double>({1.0, 0.0, 0.1}, {1.0, 0.0, 0.1});
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(x[k], expected[k], 1e-12);
}

// A ring that one position holds may turn about it, though rounding may leave pivots that are
// positive. What a filter linearised at other states does not know that.
TEST_P(EveryEstimator, HasNoCovarianceOfAMatrixThatIsSingularToRounding) {
  if (is_filter()) GTEST_SKIP() << "of other states";
  for (const int n : {4, 6, 8, 10, 14, 30}) {
    const auto estimator = registry_.make<Estimator>(GetParam());
    GraphUpdate update;
    const double turn = 2.0 * std::numbers::pi / n;
    for (int k = 0; k < n; ++k) update.variables.push_back(pose(k));
    update.variables[0].state = {0.0, 0.0, 0.0};
    for (int k = 0; k < n; ++k) {
      update.factors.push_back(between(k, (k + 1) % n, {1.0, 0.01, turn}));
      update.factors.back().information = {100, 0, 0, 100, 0, 400};
    }
    update.factors.push_back({types_.prior, {0}, {7.0, 9.0, 0.0}, {1, 0, 0, 1, 0, 0}});
    estimator->update(update, {.full = true});
    std::array<double, 9> block{};
    EXPECT_FALSE(estimator->covariance(n / 2, n / 2, block)) << n << ": " << block[0];
    EXPECT_FALSE(estimator->covariance(1, n / 2, block)) << n;
  }
}

// A long chain of strong factors on a weak prior: where rounding takes the digits of a covariance,
// there is none. The headings' variances of a straight chain add up.
TEST_P(EveryEstimator, HasACovarianceWithDigitsOrNone) {
  for (const double strong : {1e4, 1e6, 1e8, 1e10}) {
    const auto estimator = registry_.make<Estimator>(GetParam());
    constexpr int kPoses = 100;
    GraphUpdate update;
    for (int k = 0; k < kPoses; ++k) update.variables.push_back(pose(k, {100.0 * k, 0.0, 0.0}));
    update.factors.push_back({types_.prior, {0}, {0.0, 0.0, 0.0}, {1, 0, 0, 1, 0, 1}});
    for (int k = 1; k < kPoses; ++k) {
      update.factors.push_back(between(k - 1, k, {100.0, 0.0, 0.0}));
      update.factors.back().information = {strong, 0, 0, strong, 0, strong};
    }
    estimator->update(update, {.full = true});
    std::array<double, 9> block{};
    const bool there = estimator->covariance(kPoses - 1, kPoses - 1, block);
    EXPECT_TRUE(there || strong > 1e5) << strong;
    if (there) {
      const double heading = 1.0 + (kPoses - 1) / strong;
      EXPECT_NEAR(block[8], heading, 0.01 * heading) << strong;
    }
  }
}

TEST_P(EveryEstimator, NumbersFactorsInTheOrderOfTheirAddition) {
  EXPECT_EQ(estimator_->update(chain(4)).first_factor, 0);
  GraphUpdate update;
  update.removed_factors = {1};
  update.factors = {between(1, 2), between(0, 3)};
  EXPECT_EQ(estimator_->update(update).first_factor, 3);
  EXPECT_EQ(estimator_->factor_count(), 4);
  update = {};
  update.marginalized = {1};
  const UpdateReport report = estimator_->update(update);
  ASSERT_EQ(report.priors.size(), 1U);
  EXPECT_EQ(report.priors[0], 5);
  update = {};
  update.removed_factors = {1};
  EXPECT_THROW(estimator_->update(update), Error);
}

TEST_P(EveryEstimator, SaysWhatItAnchored) {
  const UpdateReport report = estimator_->update(chain(2), {.full = true});
  EXPECT_THAT(report.notes, testing::Contains(testing::HasSubstr("anchored VERTEX_SE2 0")));
}

TEST_P(EveryEstimator, SaysWhatHasNoFactorLeft) {
  estimator_->update(chain(4));
  GraphUpdate update;
  update.removed_factors = {1, 2};
  update.factors.push_back(between(1, 3));
  const auto are_left = testing::Contains(testing::HasSubstr("no factor"));
  const UpdateReport report = estimator_->update(update, {.full = true});
  EXPECT_THAT(report.notes, are_left);
  EXPECT_THAT(report.notes, testing::Contains(testing::HasSubstr("VERTEX_SE2 2")));
  update = {};
  update.removed_variables = {3};  // with its factor: 1 has another
  EXPECT_THAT(estimator_->update(update, {.full = true}).notes,
              testing::Not(testing::Contains(testing::HasSubstr("VERTEX_SE2 1"))));
}

TEST_P(EveryEstimator, AnchorsNothingThatAPriorDetermines) {
  GraphUpdate update = chain(4);
  update.variables[0] = pose(0, {0.0, 0.0, 0.0}, true);
  estimator_->update(update);
  update = {};
  update.marginalized = {0};  // leaves a prior on pose 1, after the factors that were there before
  EXPECT_THAT(estimator_->update(update).notes, testing::IsEmpty());
  update = {};
  update.variables = {pose(4)};
  update.factors = {between(3, 4)};
  EXPECT_THAT(estimator_->update(update, {.full = true}).notes, testing::IsEmpty());
}

TEST_P(EveryEstimator, APositionFromGpsIsNotTurnedOffByAnAnchor) {
  if (is_filter()) GTEST_SKIP() << "a filter does not linearise again";
  GraphUpdate update = chain(3);
  const auto prior = registry_.factor_type("EDGE_PRIOR_SE2");
  update.factors.push_back({prior, {0}, {100.0, 50.0, 0.0}, {4, 0, 0, 4, 0, 0}});
  estimator_->update(update, {.full = true});
  EXPECT_NEAR(estimator_->state(0)[0], 100.0, 1e-6);
  EXPECT_NEAR(estimator_->state(0)[1], 50.0, 1e-6);
  update = {};  // the second position determines the heading
  update.factors.push_back({prior, {2}, {100.0, 52.0, 0.0}, {4, 0, 0, 4, 0, 0}});
  const UpdateReport report = estimator_->update(update, {.full = true});
  EXPECT_TRUE(report.ok);
  EXPECT_NEAR(estimator_->state(2)[0], 100.0, 0.01);
  EXPECT_LT(estimator_->chi2(), 0.1);
}

TEST_P(EveryEstimator, ADeferredUpdateLeavesTheEstimateOfOldVariables) {
  estimator_->update(chain(3));
  const std::vector<double> before(estimator_->state(2).begin(), estimator_->state(2).end());
  GraphUpdate update;
  update.factors.push_back(between(0, 2, {3.0, 1.0, 0.0}));
  estimator_->update(update, {.defer = true});
  EXPECT_EQ(before, std::vector<double>(estimator_->state(2).begin(), estimator_->state(2).end()));
  estimator_->update({}, {.full = true});
  EXPECT_NE(before, std::vector<double>(estimator_->state(2).begin(), estimator_->state(2).end()));
}

// A ring whose poses come one by one, with chords, in updates that have no time.
TEST_P(EveryEstimator, WhatATimeLimitLeavesIsThereAndIsDoneInTheEnd) {
  constexpr int kPoses = 40;
  const double turn = 2.0 * std::numbers::pi / 20.0;
  const auto unlimited = registry_.make<Estimator>(GetParam());
  int factors = 0;
  for (int k = 0; k < kPoses; ++k) {
    GraphUpdate update;
    update.variables.push_back(
        pose(k, k == 0 ? std::vector<double>{0, 0, 0} : std::vector<double>()));
    if (k > 0) update.factors.push_back(between(k - 1, k, {1.0, 0.02 * (k % 3), turn + 0.03}));
    if (k >= 20) update.factors.push_back(between(k - 20, k, {0.1, 0.0, 0.05}));
    const UpdateReport report = estimator_->update(update, {.max_seconds = 1e-9});
    unlimited->update(update, {.max_seconds = 1e9});
    EXPECT_EQ(report.first_factor, factors);
    factors += static_cast<int>(update.factors.size());
    ASSERT_EQ(estimator_->variable_count(), k + 1);
    ASSERT_EQ(estimator_->factor_count(), factors);
    ASSERT_TRUE(estimator_->has(k));
    if (k == 0) continue;
    EXPECT_EQ(estimator_->factor(factors - 1).variables[1], k);
    EXPECT_EQ(estimator_->graph().factor_count(), factors);
    const auto x = estimator_->state(k);
    EXPECT_TRUE(std::ranges::equal(estimator_->graph().state(k), x)) << k;
    if (k % 7 != 0) continue;
    Eigen::Matrix3d block;
    ASSERT_TRUE(estimator_->covariance(k, k, {block.data(), 9}));
    EXPECT_GT(block.eigenvalues().real().minCoeff(), 0.0);
  }
  for (Estimator* one : {estimator_.get(), unlimited.get()}) one->update({}, {.full = true});
  if (is_filter()) return;
  EXPECT_NEAR(estimator_->chi2(), unlimited->chi2(), 1e-9 * unlimited->chi2());
  for (int k = 0; k < kPoses; ++k) {
    const auto x = estimator_->state(k), y = unlimited->state(k);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(x[c], y[c], 1e-6) << k;
  }
  const DenseSystem system = dense_system(estimator_->graph());
  const auto rows = system.rows.at(kPoses - 1);
  const Eigen::Matrix3d wanted = system.Sigma().block<3, 3>(rows.first, rows.first);
  Eigen::Matrix3d block;
  ASSERT_TRUE(estimator_->covariance(kPoses - 1, kPoses - 1, {block.data(), 9}));
  EXPECT_LT((block - wanted).norm(), 1e-6 * wanted.norm());
}

TEST_P(EveryEstimator, WhatATimeLimitLeavesCanBeRemovedAndMarginalised) {
  GraphUpdate update = chain(12);
  update.factors.push_back(between(0, 11, {1.0, 2.0, 1.0}));
  estimator_->update(update, {.max_seconds = 1e-9});
  update = {};
  update.variables = {pose(12)};
  update.factors = {between(11, 12), between(3, 12, {0.5, 1.0, 0.3})};
  const FactorId first = estimator_->update(update, {.max_seconds = 1e-9}).first_factor;
  update = {};
  update.removed_factors = {first + 1};
  update.marginalized = {5};
  update.changed = {{0, {1.0, 0.1, 0.1}, kUnit}};
  estimator_->update(update, {.max_seconds = 1e-9});
  EXPECT_FALSE(estimator_->has_factor(first + 1));
  EXPECT_FALSE(estimator_->has(5));
  EXPECT_EQ(estimator_->variable_count(), 12);
  estimator_->update({}, {.max_seconds = 1e-9});
  EXPECT_TRUE(estimator_->update({}, {.full = true}).ok);
  if (is_filter()) return;
  const DenseSystem system = dense_system(estimator_->graph());
  EXPECT_LT(system.g.dot(system.H.ldlt().solve(system.g)), 1e-9);
}

TEST_P(EveryEstimator, AFixedVariableStays) {
  GraphUpdate update = chain(3);
  update.variables[1] = pose(1, {7.0, 8.0, 0.5}, true);
  estimator_->update(update, {.full = true});
  EXPECT_THAT(estimator_->state(1), testing::ElementsAre(7.0, 8.0, 0.5));
  std::vector<double> block(9, 1.0);
  ASSERT_TRUE(estimator_->covariance(1, 1, block));
  EXPECT_THAT(block, testing::Each(0.0));
  EXPECT_EQ(estimator_->graph().fixed(1), true);
}

TEST_P(EveryEstimator, SolvesFullyWhateverTheInformation) {
  // All of it small or large after a marginalisation, or one factor that weighs far more.
  std::vector<double> expected;
  for (const auto& [scale, first] : {std::pair{1.0, 1.0}, {1e-30, 1.0}, {1e30, 1.0}, {1.0, 1e30}}) {
    const auto estimator = registry_.make<Estimator>(GetParam());
    GraphUpdate update = chain(7);
    update.variables[0] = pose(0, {0.0, 0.0, 0.0}, true);
    for (Factor& factor : update.factors) {
      for (double& number : factor.information) number *= scale;
    }
    for (double& number : update.factors[0].information) number *= first;
    estimator->update(update, {.full = true});
    update = {};
    update.marginalized = {3};
    estimator->update(update);
    update = {};
    update.factors = {between(1, 6, {2.5, 2.0, 0.9})};
    for (double& number : update.factors[0].information) number *= scale;
    estimator->update(update, {.full = true});
    const std::span<const double> x = estimator->state(6);
    if (first > 1.0) {  // pose 1 is where that factor puts it
      EXPECT_NEAR(estimator->state(1)[0], 1.0, 1e-12);
      continue;
    }
    if (expected.empty()) expected.assign(x.begin(), x.end());
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(x[k], expected[k], 1e-9) << scale;
  }
}

TEST_P(EveryEstimator, SolvesFullyAfterAFactorOfVeryLargeInformationIsChangedOrRemoved) {
  if (is_filter()) GTEST_SKIP() << "a filter does not linearise again";
  const Factor wrong = between(0, 6, {9.0, 9.0, 1.0});
  Factor heavy = wrong;
  for (double& number : heavy.information) number *= 1e40;
  std::vector<double> expected;
  for (const Factor& first : {wrong, heavy}) {
    for (const bool removed : {false, true}) {
      const auto estimator = registry_.make<Estimator>(GetParam());
      GraphUpdate update = chain(7);
      update.variables[0] = pose(0, {0.0, 0.0, 0.0}, true);
      update.factors.push_back(first);
      const FactorId id = estimator->update(update, {.full = true}).first_factor +
                          static_cast<FactorId>(update.factors.size()) - 1;
      update = {};
      if (removed) {
        update.removed_factors = {id};
        update.factors = {wrong};
      } else {
        update.changed = {{id, wrong.measurement, wrong.information}};
      }
      estimator->update(update, {.full = true});
      const std::span<const double> x = estimator->state(6);
      if (expected.empty()) expected.assign(x.begin(), x.end());
      for (int k = 0; k < 3; ++k) EXPECT_NEAR(x[k], expected[k], 1e-4) << removed;
    }
  }
}

TEST_P(EveryEstimator, RefusesWhatItDoesNotKnow) {
  estimator_->update(chain(2));
  EXPECT_THROW(estimator_->state(7), Error);
  std::vector<double> block(9);
  EXPECT_THROW(estimator_->covariance(0, 7, block), Error);
  EXPECT_FALSE(estimator_->has(7));
  block.resize(4);
  EXPECT_THROW(estimator_->covariance(1, 1, block), Error);
}

TEST_P(EveryEstimator, ALossHoldsForEverythingThatIsThere) {
  if (is_filter()) GTEST_SKIP() << "a filter does not linearise again";
  if (!registry_.has("loss", "huber")) GTEST_SKIP() << "there is no loss huber";
  estimator_->update(chain(4));
  GraphUpdate update;
  update.factors.push_back(between(0, 3, {3.5, 1.5, 0.6}));
  estimator_->update(update);
  const std::shared_ptr<const Loss> huber = registry_.make<Loss>("huber:scale=0.1");
  estimator_->set_loss(huber);
  estimator_->update({}, {.full = true});
  Graph graph = estimator_->graph();
  graph.set_loss(huber);
  const DenseSystem system = dense_system(graph);  // what a step could still lower chi2 by
  EXPECT_LT(system.g.dot(system.H.ldlt().solve(system.g)), 1e-7 * estimator_->chi2());
}

TEST_P(EveryEstimator, AFixedLagKeepsItsSizeAndItsCovariance) {
  // A chain with loops of length two; the exact covariance of what stays is that of the whole.
  constexpr int kLag = 4, kSteps = 15;
  Graph whole;
  for (int k = 0; k < kSteps; ++k) {
    GraphUpdate update;
    update.variables.push_back(
        pose(k, k == 0 ? std::vector<double>{0, 0, 0} : std::vector<double>()));
    if (k > 0) update.factors.push_back(between(k - 1, k, {1.0, 0.0, 0.0}));
    if (k > 1) update.factors.push_back(between(k - 2, k, {2.0, 0.0, 0.0}));
    if (k >= kLag) update.marginalized.push_back(k - kLag);
    estimator_->update(update, {.full = true});
    whole.add_variable(types_.pose, k, std::array{double(k), 0.0, 0.0});
    for (const Factor& factor : update.factors) {
      whole.add_factor(factor.type, std::array{static_cast<int>(factor.variables[0]), k},
                       factor.measurement, factor.information);
    }
    ASSERT_LE(estimator_->variable_count(), kLag);
    if (k == 0) continue;
    const DenseSystem system = dense_system(whole);
    const auto rows = system.rows.at(k);
    const Eigen::Matrix3d wanted = system.Sigma().block<3, 3>(rows.first, rows.first);
    Eigen::Matrix3d block;
    ASSERT_TRUE(estimator_->covariance(k, k, {block.data(), 9}));
    EXPECT_LT((block - wanted).norm(), 1e-8 * wanted.norm()) << "step " << k;
  }
}

TEST_P(EveryEstimator, WhatHasLeftIsGoneAndItsIdIsFreeAgain) {
  estimator_->update(chain(8));
  GraphUpdate update;
  update.removed_variables = {7};
  update.marginalized = {1};
  estimator_->update(update);
  ASSERT_FALSE(estimator_->has(7) || estimator_->has(1));
  for (const Id gone : {1, 7}) {
    GraphUpdate on_it;
    on_it.factors.push_back(between(2, gone));
    EXPECT_THROW(estimator_->update(on_it), Error) << gone;
    GraphUpdate leaves;
    leaves.removed_variables = {gone};
    EXPECT_THROW(estimator_->update(leaves), Error) << gone;
  }
  GraphUpdate back;
  for (const Id id : {1, 7}) {
    back.variables.push_back(pose(id));
    back.factors.push_back(between(2, id, {0.5, 0.0, 0.0}));
  }
  estimator_->update(back, {.full = true});
  ASSERT_EQ(estimator_->variable_count(), 8);
  const std::span<const double> at = estimator_->state(2);
  const Eigen::Vector3d two(at[0], at[1], at[2]);
  for (const Id id : {1, 7}) {
    const std::span<const double> x = estimator_->state(id);
    const auto expected = Se2::compose<double>(two, {0.5, 0.0, 0.0});
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(x[k], expected[k], 1e-9);
  }
}

TEST_P(EveryEstimator, ReadingChangesNoLaterResult) {
  if (GetParam().find("budget") != std::string::npos)
    GTEST_SKIP() << "with a time limit results depend on time, to the last bits";
  // The same updates twice, read at every step the one, never the other.
  const std::unique_ptr<Estimator> quiet = registry_.make<Estimator>(GetParam());
  std::mt19937 rng(5);
  std::normal_distribution<double> noise(0.0, 0.05);
  constexpr int kSteps = 120, kLap = 20;
  for (int k = 0; k < kSteps; ++k) {
    GraphUpdate update;
    update.variables.push_back(
        pose(k, k == 0 ? std::vector<double>{0, 0, 0} : std::vector<double>()));
    const double turn = 2.0 * std::numbers::pi / kLap;
    if (k > 0)
      update.factors.push_back(
          between(k - 1, k, {1.0 + noise(rng), noise(rng), turn + noise(rng)}));
    if (k >= kLap && k % 3 == 0)
      update.factors.push_back(between(k - kLap, k, {noise(rng), noise(rng), noise(rng)}));
    quiet->update(update);
    estimator_->update(update);
    estimator_->state(k);
    estimator_->state(k / 2);
    if (k % 4 == 1) estimator_->chi2();
    if (k % 5 == 2) estimator_->graph();
    std::vector<double> block(9);
    if (k % 6 == 3) estimator_->covariance(k / 3, k, block);
    if (k % 7 == 4) {
      for (int v = 0; v <= k; ++v) estimator_->state(v);
    }
    if (k % 11 == 5) estimator_->clone()->state(0);
  }
  const Graph a = estimator_->graph(), b = quiet->graph();
  for (int v = 0; v < kSteps; ++v)
    EXPECT_TRUE(std::ranges::equal(a.state(v), b.state(v))) << a.describe_variable(v);
}

INSTANTIATE_TEST_SUITE_P(Registered, EveryEstimator, testing::ValuesIn(every_estimator()),
                         [](const auto& named) {
                           std::string name = named.param;
                           std::ranges::replace_if(
                               name, [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
                           return name;
                         });
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(EveryEstimator);

}  // namespace
}  // namespace cairn::test
