// SPDX-License-Identifier: BSD-3-Clause
// What leaves the estimator `incremental_cholesky`: at what cost, and what a refusal leaves behind.
#include <algorithm>
#include <limits>
#include <memory>
#include <random>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "cairn/lie/point.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/types/define_factor.hpp"
#include "cairn/types/wrapped_factor.hpp"
#include "support/dense_algebra.hpp"
#include "support/planar_graph.hpp"

namespace cairn::test {
namespace {

/// A relative pose that counts how often it is evaluated, and whose derivatives can become
/// infinite.
class Watched final : public WrappedFactorType {
 public:
  using WrappedFactorType::WrappedFactorType;
  mutable int evaluations = 0;
  bool broken = false;

  void evaluate(const double* const* x, const double* measurement, const double* sqrt_information,
                double* residual, double* const* jacobians) const override {
    ++evaluations;
    WrappedFactorType::evaluate(x, measurement, sqrt_information, residual, jacobians);
    for (int k = 0; broken && jacobians && k < arity(); ++k) {
      if (jacobians[k]) jacobians[k][0] = std::numeric_limits<double>::infinity();
    }
  }
};

class Removal : public testing::Test {
 protected:
  void SetUp() override {
    if (!registry_.has("estimator", "incremental_cholesky"))
      GTEST_SKIP() << "there is no estimator incremental_cholesky";
    estimator_ = make();
  }
  std::unique_ptr<Estimator> make() { return registry_.make<Estimator>("incremental_cholesky"); }

  Factor between(Id a, Id b, std::vector<double> z) const {
    return {watched_, {a, b}, std::move(z), {100, 0, 0, 100, 0, 400}};
  }
  /// Pose k of a drive in circles of `kLap` poses, whose loops close.
  GraphUpdate step(int k) {
    GraphUpdate update;
    update.variables.push_back(
        {types_.pose, k, k == 0 ? std::vector<double>{0, 0, 0} : std::vector<double>(), false});
    if (k > 0)
      update.factors.push_back(between(
          k - 1, k, {1.0 + noise_(random_), noise_(random_), 6.28 / kLap + noise_(random_)}));
    if (k >= kLap && k % 3 == 0)
      update.factors.push_back(
          between(k - kLap, k, {noise_(random_), noise_(random_), noise_(random_)}));
    return update;
  }

  static constexpr int kLap = 20;
  Registry registry_;
  PlanarTypes types_;
  std::shared_ptr<Watched> watched_ = std::make_shared<Watched>(types_.relative_pose);
  std::unique_ptr<Estimator> estimator_;
  std::mt19937 random_{3};
  std::normal_distribution<double> noise_{0.0, 0.02};
};

TEST_F(Removal, OfAPoseThatIsMarginalizedStartsNothingAnewInALargeMap) {
  constexpr int kPoses = 600;
  for (int k = 0; k < kPoses; ++k) estimator_->update(step(k));
  for (const Id pose : {kPoses / 2, kPoses / 3}) {
    GraphUpdate leaves;
    leaves.marginalized = {pose};
    const UpdateReport report = estimator_->update(leaves);
    EXPECT_TRUE(report.ok);
    EXPECT_LT(report.affected_variables, kPoses / 2);
    EXPECT_LT(report.relinearized_factors, kPoses / 4);
    watched_->evaluations = 0;
    EXPECT_EQ(estimator_->update({}).affected_variables, 0);
    EXPECT_EQ(watched_->evaluations, 0);
  }
  EXPECT_EQ(estimator_->variable_count(), kPoses - 2);
}

/// Where a point is as seen from another, in the axes of the world: a linear measurement.
struct Apart {
  static constexpr std::string_view kTag = "TEST_APART";
  static constexpr int kResidual = 2, kMeasurement = 2;
  using Variables = std::tuple<PointXY, PointXY>;
  template <class S>
  static Vector<S, 2> residual(const Vector<S, 2>& a, const Vector<S, 2>& b,
                               const Vector<double, 2>& z) {
    return b - a - z.template cast<S>();
  }
};

// Nothing is lost where everything is linear: the oracle keeps all that ever was, and inverts a
// dense matrix.
TEST_F(Removal, OfAFixedLagLeavesMinimumAndKeptCovariancesOfTheWholeWhereItIsLinear) {
  constexpr int kLag = 10, kSteps = 200;
  const auto apart = define_factor<Apart>();
  estimator_->keep_marginals(KeptMarginals::diagonal);
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(2 * kSteps, 2 * kSteps);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(2 * kSteps);
  int downdates = 0;
  for (int k = 0; k < kSteps; ++k) {
    GraphUpdate update;
    update.variables.push_back({types_.point, k, {1.0 * k, 0.0}, k == 0});
    std::vector<int> from;
    if (k > 0) from.push_back(k - 1);
    if (k >= kLag && k % 3 == 0) from.push_back(k - static_cast<int>(2 + random_() % (kLag - 2)));
    for (const int a : from) {
      const Eigen::Vector2d z(k - a + noise_(random_), noise_(random_));
      Eigen::Matrix2d information;
      information << 100.0 + 50.0 * noise_(random_), 7.0, 7.0, 400.0;
      update.factors.push_back(
          {apart, {a, k}, {z[0], z[1]}, {information(0, 0), information(0, 1), information(1, 1)}});
      for (const auto& [u, sign_u] : {std::pair{a, -1.0}, std::pair{k, 1.0}}) {
        g.segment<2>(2 * u) += sign_u * information * z;
        for (const auto& [v, sign_v] : {std::pair{a, -1.0}, std::pair{k, 1.0}})
          H.block<2, 2>(2 * u, 2 * v) += sign_u * sign_v * information;
      }
    }
    if (k >= kLag) update.marginalized.push_back(k - kLag);
    const UpdateReport report = estimator_->update(update);
    ASSERT_TRUE(report.ok) << k;
    downdates += report.marginals_by == MarginalsBy::downdate;
    if (k == 0) continue;
    const Eigen::Index n = 2 * k;  // the first is fixed
    const Eigen::MatrixXd Sigma = test::inverse_of(H.block(2, 2, n, n));
    const Eigen::VectorXd x = Sigma * g.segment(2, n);
    for (int pose = std::max(1, k - kLag + 1); pose <= k; ++pose) {
      const Eigen::Index at = 2 * (pose - 1);
      Eigen::Matrix2d kept;
      ASSERT_TRUE(estimator_->covariance(pose, pose, {kept.data(), 4}));
      const Eigen::Matrix2d wanted = Sigma.block<2, 2>(at, at);
      ASSERT_LT((kept - wanted).norm(), 1e-9 * wanted.norm())
          << pose << " in step " << k << ", by " << to_string(report.marginals_by);
      for (int c = 0; c < 2; ++c)
        ASSERT_NEAR(estimator_->state(pose)[static_cast<std::size_t>(c)], x[at + c], 1e-7 * k)
            << pose << " in step " << k;
    }
  }
  EXPECT_EQ(estimator_->variable_count(), kLag);
  EXPECT_GT(downdates, kSteps / 2);
}

// Without a turn the residuals are linear. Only the lever arms in the derivatives of y are those of
// the time when a pose left.
TEST_F(Removal, OfAFixedLagLeavesTheMinimumOfTheWholeOnAStraightLine) {
  constexpr int kLag = 8, kSteps = 120;
  const std::unique_ptr<Estimator> whole = make(), lag = make();
  for (int k = 0; k < kSteps; ++k) {
    GraphUpdate update = step(k);
    update.variables[0].fixed = k == 0;
    for (Factor& factor : update.factors) factor.measurement = {1.0 + noise_(random_), 0.0, 0.0};
    if (update.factors.size() > 1) update.factors.resize(1);
    if (k >= 3) update.factors.push_back(between(k - 3, k, {3.0 + noise_(random_), 0.0, 0.0}));
    whole->update(update, {.full = true});
    if (k >= kLag) update.marginalized.push_back(k - kLag);
    lag->update(update, {.full = k + 1 == kSteps});
  }
  ASSERT_EQ(lag->variable_count(), kLag);
  for (int k = kSteps - kLag; k < kSteps; ++k) {
    const std::span<const double> a = lag->state(k), b = whole->state(k);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(a[c], b[c], 1e-9) << k;
    Eigen::Matrix3d of_lag, of_whole;
    ASSERT_TRUE(lag->covariance(k, k, {of_lag.data(), 9}));
    ASSERT_TRUE(whole->covariance(k, k, {of_whole.data(), 9}));
    EXPECT_LT((of_lag - of_whole).norm(), 1e-4 * of_whole.norm()) << k;
  }
}

// A journal has only what was taken in: what was refused must leave no trace, to the last bit.
TEST_F(Removal, ThatIsRefusedChangesNoLaterResult) {
  constexpr int kLag = 12, kSteps = 150;
  const std::unique_ptr<Estimator> quiet = make();
  int refused = 0;
  for (int k = 0; k < kSteps; ++k) {
    GraphUpdate update = step(k);
    std::erase_if(update.factors, [&](const Factor& factor) {
      return std::ranges::any_of(factor.variables, [&](Id id) { return id + kLag < k; });
    });
    if (k >= kLag) {
      update.marginalized.push_back(k - kLag);
      GraphUpdate unknown = update;
      unknown.factors.push_back(between(k - 1, k + 7, {1.0, 0.0, 0.0}));
      EXPECT_THROW(estimator_->update(unknown), Error);
      watched_->broken = true;
      GraphUpdate infinite = update;
      EXPECT_THROW(estimator_->update(infinite), Error) << k;
      infinite.changed.push_back({estimator_->factors().back(), {1.0, 0.0, 0.3}, {}});
      ASSERT_TRUE(estimator_->has_factor(infinite.changed[0].factor));
      EXPECT_THROW(estimator_->update(infinite), Error) << k;
      watched_->broken = false;
      ++refused;
    }
    quiet->update(update);
    estimator_->update(update);
  }
  EXPECT_EQ(refused, kSteps - kLag);
  EXPECT_EQ(estimator_->factors(), quiet->factors());
  const Graph a = estimator_->graph(), b = quiet->graph();
  ASSERT_EQ(a.variable_count(), kLag);
  for (int v = 0; v < a.variable_count(); ++v)
    EXPECT_TRUE(std::ranges::equal(a.state(v), b.state(v))) << a.describe_variable(v);
}

}  // namespace
}  // namespace cairn::test
