// SPDX-License-Identifier: BSD-3-Clause
// Robust losses on some of the factors, while the graph changes: all estimators give a factor the
// same loss, and it keeps it.
#include <cmath>
#include <map>
#include <random>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>

#include "cairn/lie/se2.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/estimator.hpp"
#include "support/planar_graph.hpp"

namespace cairn::test {
namespace {

struct Cauchy final : Loss {
  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override {
    for (std::size_t k = 0; k < s.size(); ++k) {
      if (!rho.empty()) rho[k] = std::log1p(s[k]);
      if (!weight.empty()) weight[k] = 1.0 / (1.0 + s[k]);
    }
  }
  double second_derivative(double s) const override { return -1.0 / ((1.0 + s) * (1.0 + s)); }
};

const std::vector<double> kInformation = {100, 0, 0, 100, 0, 400};

class LossOnLoops : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const char* name : {"incremental_cholesky", "batch"}) {
      if (!registry_.has("estimator", name)) GTEST_SKIP() << "there is no estimator " << name;
    }
    start();
  }
  void start() {
    estimators_.clear();
    // With the same initial estimates: Cauchy's loss has several minima.
    for (const char* name : {"incremental_cholesky:hints=false", "batch"}) {
      estimators_.push_back(registry_.make<Estimator>(name));
      estimators_.back()->set_loss(loss_, FactorSelector::loops());
    }
  }
  void update(const GraphUpdate& update, const UpdateOptions& options = {}) {
    for (const auto& estimator : estimators_) {
      const UpdateReport report = estimator->update(update, options);
      ASSERT_TRUE(report.ok);
    }
  }
  Factor between(Id a, Id b, std::vector<double> z) const {
    return {types_.relative_pose, {a, b}, std::move(z), kInformation};
  }
  /// Ids of the factors that have a loss.
  static std::set<FactorId> robust(const Estimator& estimator) {
    std::set<FactorId> result;
    for (const FactorId f : estimator.factors()) {
      if (estimator.factor(f).loss) result.insert(f);
    }
    return result;
  }

  Registry registry_;
  PlanarTypes types_;
  std::shared_ptr<const Loss> loss_ = std::make_shared<Cauchy>();
  std::vector<std::unique_ptr<Estimator>> estimators_;
};

TEST_F(LossOnLoops, ALoopClosureStaysOneWhenWhatIsBetweenLeaves) {
  GraphUpdate chain;
  for (Id id = 0; id < 4; ++id)
    chain.variables.push_back({types_.pose, id, {1.0 * static_cast<double>(id), 0.0, 0.0}});
  for (Id id = 0; id < 3; ++id) chain.factors.push_back(between(id, id + 1, {1.0, 0.0, 0.0}));
  chain.factors.push_back(between(1, 3, {2.0, 0.1, 0.0}));  // factor 3, over pose 2
  update(chain);
  for (const auto& estimator : estimators_)
    EXPECT_THAT(robust(*estimator), testing::ElementsAre(3));
  GraphUpdate leaves;
  leaves.removed_variables = {2};
  update(leaves);
  update({}, {.full = true});
  for (const auto& estimator : estimators_) {
    EXPECT_THAT(robust(*estimator), testing::ElementsAre(3));
    EXPECT_EQ(estimator->graph().loss(1), loss_.get());  // and after what is left was renumbered
  }
}

TEST_F(LossOnLoops, AFactorsOwnLossComesFirst) {
  const auto own = std::make_shared<Cauchy>();
  GraphUpdate update_with_own;
  update_with_own.variables = {{types_.pose, 0, {0, 0, 0}}, {types_.pose, 1, {1, 0, 0}}};
  update_with_own.factors = {between(0, 1, {1.0, 0.0, 0.0}), between(0, 1, {1.1, 0.0, 0.0})};
  update_with_own.factors[1].loss = own;
  update(update_with_own);
  for (const auto& estimator : estimators_) {
    EXPECT_EQ(estimator->factor(0).loss, nullptr);
    EXPECT_EQ(estimator->factor(1).loss, own);
  }
}

/// A random life of a chain of poses: loops are closed, poses removed or marginalised.
class Life {
 public:
  explicit Life(unsigned seed) : rng_(seed) {}

  GraphUpdate next(const PlanarTypes& types) {
    GraphUpdate update;
    const Id id = next_++;
    truth_[id] = id == 0 ? Eigen::Vector3d(0, 0, 0)
                         : Eigen::Vector3d(Se2::compose<double>(
                               last_, Eigen::Vector3d(1.0, uniform(-0.2, 0.2), uniform(0.1, 0.7))));
    last_ = truth_[id];
    update.variables.push_back({types.pose, id, {last_[0], last_[1], last_[2]}});
    if (!there_.empty()) measure(*there_.rbegin(), id, types, update);
    for (const Id other : there_) {
      if (uniform(0, 1) < 0.35) measure(other, id, types, update);
    }
    there_.insert(id);
    if (there_.size() > 4 && uniform(0, 1) < 0.5) {
      auto leaves = there_.begin();
      std::advance(leaves, rng_() % (there_.size() - 1));
      (uniform(0, 1) < 0.5 ? update.removed_variables : update.marginalized).push_back(*leaves);
      there_.erase(leaves);
    }
    return update;
  }

 private:
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(rng_);
  }
  void measure(Id a, Id b, const PlanarTypes& types, GraphUpdate& update) {
    std::normal_distribution<double> normal(0.0, 0.1);
    Eigen::Vector3d z = Se2::between<double>(truth_[a], truth_[b]);
    z += Eigen::Vector3d(normal(rng_), normal(rng_), 0.5 * normal(rng_));
    update.factors.push_back({types.relative_pose, {a, b}, {z[0], z[1], z[2]}, kInformation});
  }

  std::mt19937 rng_;
  std::map<Id, Eigen::Vector3d> truth_;
  std::set<Id> there_;
  Eigen::Vector3d last_{0, 0, 0};
  Id next_ = 0;
};

TEST_F(LossOnLoops, IncrementalAndBatchAgreeOverAThousandLives) {
  int robust_factors = 0, lives = 0;
  for (unsigned seed = 0; seed < 1000 && !HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    start();
    Life life(seed);
    for (int k = 0; k < 12; ++k) {
      update(life.next(types_), {.defer = true});
      const std::set<FactorId> incremental = robust(*estimators_[0]);
      ASSERT_EQ(incremental, robust(*estimators_[1]));
      ASSERT_EQ(estimators_[0]->factors(), estimators_[1]->factors());
      ASSERT_EQ(estimators_[0]->variables(), estimators_[1]->variables());
      robust_factors += static_cast<int>(incremental.size());
    }
    // Reweighted least squares converge linearly where residuals are large.
    for (int k = 0; k < 4; ++k) update({}, {.full = true});
    const Graph a = estimators_[0]->graph(), b = estimators_[1]->graph();
    EXPECT_NEAR(estimators_[0]->chi2(), chi2(a), 1e-9 * (1.0 + chi2(a)));
    EXPECT_NEAR(chi2(a), chi2(b), 1e-6 * (1.0 + chi2(b)));
    ++lives;
  }
  EXPECT_EQ(lives, 1000);
  EXPECT_GT(robust_factors, 10000);
}

}  // namespace
}  // namespace cairn::test
