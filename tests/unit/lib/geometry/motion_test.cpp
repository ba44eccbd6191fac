// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/motion.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Dense>

#include "cairn/lie/point.hpp"
#include "cairn/lie/se2.hpp"
#include "cairn/lie/se3.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/types/define_factor.hpp"
#include "support/dense_system.hpp"
#include "support/planar_graph.hpp"
#include "support/scaled_pose.hpp"

namespace cairn {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using ::testing::HasSubstr;

MatrixXd covariance(const Motion& motion) {
  const auto n =
      static_cast<Eigen::Index>(std::lround(std::sqrt(double(motion.covariance.size()))));
  return Eigen::Map<const MatrixXd>(motion.covariance.data(), n, n);
}

std::vector<double> numbers(const MatrixXd& M) { return {M.data(), M.data() + M.size()}; }

/// ‖log(a⁻¹ b)‖
double distance(const MotionGroup& group, const std::vector<double>& a,
                const std::vector<double>& b) {
  VectorXd delta(group.tangent_size());
  group.type().local(1, a.data(), b.data(), delta.data());
  return delta.norm();
}

/// Same mean and covariance, relative to their size.
void expect_same(const MotionGroup& group, const Motion& a, const Motion& b, double tolerance) {
  EXPECT_LT(distance(group, a.mean, b.mean), tolerance);
  EXPECT_LT((covariance(a) - covariance(b)).norm(), tolerance * covariance(b).norm());
}

/// Random numbers that are the same everywhere.
class Sampler {
 public:
  explicit Sampler(unsigned seed) : rng_(seed) {}

  double uniform() { return static_cast<double>(rng_()) / 0x1p31 - 1.0; }
  VectorXd vector(int n) {
    VectorXd v(n);
    for (double& x : v) x = uniform();
    return v;
  }
  MatrixXd matrix(int rows, int columns) {
    MatrixXd M(rows, columns);
    for (double& x : M.reshaped()) x = uniform();
    return M;
  }
  /// Positive definite, of standard deviations of about `sigma`.
  MatrixXd positive(int n, double sigma) {
    const MatrixXd A = matrix(n, n);
    return sigma * sigma * (A * A.transpose() + 0.1 * MatrixXd::Identity(n, n));
  }
  std::vector<double> state(const VariableType& type, double size = 1.0) {
    std::vector<double> x(static_cast<std::size_t>(type.ambient_size()));
    type.lie_group()->exp((size * vector(type.tangent_size())).eval().data(), x.data());
    return x;
  }
  Motion motion(const VariableType& type, double sigma = 0.1) {
    std::vector<double> mean = state(type);
    return {std::move(mean), numbers(positive(type.tangent_size(), sigma))};
  }

 private:
  std::mt19937 rng_;
};

// The group ---------------------------------------------------------------------------------------

class MotionGroupTest : public testing::TestWithParam<bool> {
 protected:
  static std::shared_ptr<const VariableType> pose() {
    return GetParam() ? define_variable<Se3>() : define_variable<Se2>();
  }
  /// ad(ξ) from the book.
  static MatrixXd ad(const VectorXd& xi) {
    if (!GetParam()) {
      return Eigen::Matrix3d{{0, -xi[2], xi[1]}, {xi[2], 0, -xi[0]}, {0, 0, 0}};
    }
    const Eigen::Matrix3d W = so3::hat<double>(xi.tail<3>());
    MatrixXd ad(6, 6);
    ad << W, so3::hat<double>(xi.head<3>()), Eigen::Matrix3d::Zero(), W;
    return ad;
  }
  /// A motion that does nothing, uncertain by L Lᵀ.
  Motion at_rest(const MatrixXd& L) const {
    return {group_.identity().mean, numbers(L * L.transpose())};
  }

  MotionGroup group_{pose()};
  const VariableType& type_ = group_.type();
  const int n_ = group_.tangent_size();
  Sampler sampler_{5};
};
INSTANTIATE_TEST_SUITE_P(Poses, MotionGroupTest, testing::Bool(), [](const auto& spatial) {
  return std::string(spatial.param ? "InSpace" : "InThePlane");
});

TEST_P(MotionGroupTest, LeavesAMotionAloneThatNothingIsComposedWith) {
  const Motion a = sampler_.motion(type_);
  for (const CompositionOrder order : {CompositionOrder::first, CompositionOrder::fourth}) {
    expect_same(group_, group_.compose(a, group_.identity(), order), a, 1e-14);
    expect_same(group_, group_.compose(group_.identity(), a, order), a, 1e-14);
  }
}

TEST_P(MotionGroupTest, ComposesInAnyGrouping) {
  const Motion a = sampler_.motion(type_), b = sampler_.motion(type_), c = sampler_.motion(type_);
  expect_same(group_, group_.compose(group_.compose(a, b), c),
              group_.compose(a, group_.compose(b, c)), 1e-13);
}

TEST_P(MotionGroupTest, TurnsBackAMotion) {
  const Motion a = sampler_.motion(type_), b = sampler_.motion(type_);
  EXPECT_LT(distance(group_, group_.compose(a, group_.inverse(a)).mean, group_.identity().mean),
            1e-14);
  expect_same(group_, group_.inverse(group_.inverse(a)), a, 1e-13);
  expect_same(group_, group_.inverse(group_.compose(a, b)),
              group_.compose(group_.inverse(b), group_.inverse(a)), 1e-13);
}

TEST_P(MotionGroupTest, GivesSymmetricCovariancesToTheLastBit) {
  const Motion a = sampler_.motion(type_, 0.7), b = sampler_.motion(type_, 0.7);
  for (const Motion& motion : {group_.compose(a, b), group_.compose(a, b, CompositionOrder::fourth),
                               group_.inverse(a), group_.fuse(a, {a.mean, b.covariance})})
    EXPECT_EQ(covariance(motion), covariance(motion).transpose());
}

TEST_P(MotionGroupTest, StaysInTheGroupOverManySteps) {
  Motion way = group_.identity();
  const Motion step{sampler_.state(type_), group_.identity().covariance};
  for (int k = 0; k < 20000; ++k) way = group_.compose(way, step);
  std::vector<double> canonical = way.mean;
  EXPECT_EQ(type_.normalize(canonical.data()), "");
  EXPECT_EQ(way.mean, canonical);
}

// Against the true second moment of log(exp(ξ₁) exp(ξ₂)) ------------------------------------------

/// Nodes and weights of Gauss and Hermite's rule for the standard normal distribution (by Golub and
/// Welsch): exact for polynomials up to degree 2 points − 1.
struct Rule {
  explicit Rule(int points) {
    MatrixXd J = MatrixXd::Zero(points, points);
    for (int k = 1; k < points; ++k) J(k, k - 1) = J(k - 1, k) = std::sqrt(double(k));
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(J);
    nodes = eigen.eigenvalues();
    weights = eigen.eigenvectors().row(0).cwiseAbs2().transpose();
  }
  VectorXd nodes, weights;
};

/// E[ξ ξᵀ], ξ = log(exp(L₁ u) exp(L₂ v)), u and v standard normal.
MatrixXd second_moment(const VariableType& type, const MatrixXd& L_1, const MatrixXd& L_2,
                       const Rule& rule) {
  const auto dimensions = L_1.cols() + L_2.cols(), points = rule.nodes.size();
  std::vector<double> a(static_cast<std::size_t>(type.ambient_size())), b = a;
  std::vector<Eigen::Index> at(static_cast<std::size_t>(dimensions), 0);
  MatrixXd sum = MatrixXd::Zero(L_1.rows(), L_1.rows());
  VectorXd u(dimensions), xi(L_1.rows());
  for (std::size_t digit = 0; digit < at.size();) {
    double weight = 1.0;
    for (std::size_t k = 0; k < at.size(); ++k) {
      u[static_cast<Eigen::Index>(k)] = rule.nodes[at[k]];
      weight *= rule.weights[at[k]];
    }
    type.lie_group()->exp((L_1 * u.head(L_1.cols())).eval().data(), a.data());
    type.lie_group()->exp((L_2 * u.tail(L_2.cols())).eval().data(), b.data());
    type.lie_group()->compose(a.data(), b.data(), a.data());
    type.lie_group()->log(a.data(), xi.data());
    sum += weight * xi * xi.transpose();
    for (digit = 0; digit < at.size() && ++at[digit] == points; ++digit) at[digit] = 0;
  }
  return sum;
}

// Three points are exact for terms of fourth order; and what is added by them is linear in Σ₁ and
// in Σ₂, so that noise in any three directions each will do.
TEST_P(MotionGroupTest, HasAllTermsOfFourthOrder) {
  const MatrixXd L_1 = sampler_.matrix(n_, 3), L_2 = sampler_.matrix(n_, 3);
  const Rule rule(3);
  const auto miss = [&](double sigma, CompositionOrder order) {
    const Motion ab = group_.compose(at_rest(sigma * L_1), at_rest(sigma * L_2), order);
    return (covariance(ab) - second_moment(type_, sigma * L_1, sigma * L_2, rule)).norm();
  };
  // What is missing falls with the fourth power of the noise, or with the sixth.
  EXPECT_NEAR(miss(0.02, CompositionOrder::first) / miss(0.01, CompositionOrder::first), 16.0, 0.1);
  EXPECT_NEAR(miss(0.04, CompositionOrder::fourth) / miss(0.02, CompositionOrder::fourth), 64.0,
              1.0);
}

TEST_P(MotionGroupTest, IsCloserToTheTruthByFourthOrderWhereNoiseIsLarge) {
  const Rule rule(5);
  for (int k = 0; k < 3; ++k) {
    const MatrixXd L_1 = 0.25 * sampler_.matrix(n_, 3), L_2 = 0.25 * sampler_.matrix(n_, 3);
    const MatrixXd truth = second_moment(type_, L_1, L_2, rule);
    const Motion a = at_rest(L_1), b = at_rest(L_2);
    const double first = (covariance(group_.compose(a, b)) - truth).norm(),
                 fourth =
                     (covariance(group_.compose(a, b, CompositionOrder::fourth)) - truth).norm();
    EXPECT_GT(first, 0.005 * truth.norm());
    EXPECT_LT(fourth, 0.2 * first);
  }
}

// Σ as the header has it, with the group's own ad.
TEST_P(MotionGroupTest, FindsTheStructureConstants) {
  const Motion a = sampler_.motion(type_, 0.5), b = sampler_.motion(type_, 0.5);
  std::vector<double> back(a.mean.size());
  MatrixXd A(n_, n_);
  type_.lie_group()->inverse(b.mean.data(), back.data());
  type_.lie_group()->adjoint(back.data(), A.data());
  const MatrixXd S_1 = A * covariance(a) * A.transpose(), S_2 = covariance(b);
  MatrixXd P_1 = MatrixXd::Zero(n_, n_), P_2 = P_1, B = P_1;
  for (int j = 0; j < n_; ++j) {
    for (int k = 0; k < n_; ++k) {
      const MatrixXd ad_j = ad(VectorXd::Unit(n_, j)), ad_k = ad(VectorXd::Unit(n_, k));
      P_1 += S_1(j, k) * ad_j * ad_k;
      P_2 += S_2(j, k) * ad_j * ad_k;
      B += S_1(j, k) * ad_j * S_2 * ad_k.transpose();
    }
  }
  const MatrixXd C = P_1 * S_2 + P_2 * S_1;
  const MatrixXd expected = S_1 + S_2 + 0.25 * B + (C + C.transpose()) / 12.0;
  EXPECT_GT((expected - S_1 - S_2).norm(), 0.01 * expected.norm());
  EXPECT_LT((covariance(group_.compose(a, b, CompositionOrder::fourth)) - expected).norm(),
            1e-13 * expected.norm());
}

// exp(s ξ) exp(t ξ) = exp((s + t) ξ): ad(ξ) ξ = 0, so that ad(ξ) η = −ad(η) ξ.
TEST_P(MotionGroupTest, HasNothingToAddWhereMotionsCommute) {
  for (int k = 0; k < 10; ++k) {
    const VectorXd xi = sampler_.vector(n_);
    const Motion a = at_rest(2.0 * xi), b = at_rest(3.0 * xi);
    expect_same(group_, group_.compose(a, b, CompositionOrder::fourth),
                at_rest(std::sqrt(13.0) * xi), 1e-12);
  }
}

TEST(MotionGroupOfPoints, IsAdditionToAnyOrder) {
  const MotionGroup group(define_variable<PointXYZ>());
  Sampler sampler(8);
  const Motion a = sampler.motion(group.type(), 2.0), b = sampler.motion(group.type(), 2.0);
  for (const CompositionOrder order : {CompositionOrder::first, CompositionOrder::fourth}) {
    const Motion ab = group.compose(a, b, order);
    for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(ab.mean[k], a.mean[k] + b.mean[k]);
    EXPECT_LT((covariance(ab) - covariance(a) - covariance(b)).norm(), 1e-14);
  }
}

TEST(MotionGroup, RefusesWhatIsNoGroup) {
  try {
    MotionGroup group(define_variable<test::ScaledPose>());
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::usage);
    EXPECT_THAT(error.what(), HasSubstr("VERTEX_SCALED forms no Lie group"));
    EXPECT_THAT(error.what(), HasSubstr("VERTEX_SE2"));
  }
}

// Fusing ------------------------------------------------------------------------------------------

TEST(Fusing, IsTheWeightedMeanWhereMotionsAreAdded) {
  const MotionGroup group(define_variable<PointXY>());
  const Motion both =
      group.fuse({{1.0, 4.0}, {1.0, 0.0, 0.0, 1.0}}, {{4.0, 0.0}, {2.0, 0.0, 0.0, 1.0}});
  EXPECT_NEAR(both.mean[0], 2.0, 1e-15);
  EXPECT_NEAR(both.mean[1], 2.0, 1e-15);
  EXPECT_NEAR(both.covariance[0], 2.0 / 3.0, 1e-15);
  EXPECT_NEAR(both.covariance[1], 0.0, 1e-15);
  EXPECT_NEAR(both.covariance[3], 0.5, 1e-15);
}

TEST_P(MotionGroupTest, KnowsTwiceAsMuchFromTheSameMeasurementTwice) {
  const Motion a = sampler_.motion(type_);
  Motion half = a;
  for (double& x : half.covariance) x *= 0.5;
  expect_same(group_, group_.fuse(a, a), half, 1e-12);
}

TEST_P(MotionGroupTest, FusesInAnyOrderAndFromEitherEnd) {
  const Motion a = sampler_.motion(type_, 0.3);
  const Motion b{group_.compose(a, {sampler_.state(type_, 0.5), a.covariance}).mean,
                 numbers(sampler_.positive(n_, 0.3))};
  const Motion both = group_.fuse(a, b);
  EXPECT_GT(distance(group_, a.mean, both.mean), 0.02);
  EXPECT_GT(distance(group_, b.mean, both.mean), 0.02);
  expect_same(group_, group_.fuse(b, a), both, 1e-9);
  expect_same(group_, group_.inverse(group_.fuse(group_.inverse(a), group_.inverse(b))), both,
              1e-9);
}

TEST_P(MotionGroupTest, FusesNothingThatIsKnownExactly) {
  const Motion a = sampler_.motion(type_);
  try {
    group_.fuse(a, group_.identity());
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::numerical);
    EXPECT_THAT(error.what(), HasSubstr("not positive definite"));
  }
}

// Factors -----------------------------------------------------------------------------------------

struct RelativeType {
  std::string name;
  std::shared_ptr<const VariableType> pose;
  std::shared_ptr<const FactorType> factor;
};

/// Those on offer, whoever brings them, each with each metric.
std::vector<RelativeType> relative_types() {
  std::vector<RelativeType> types;
  for (const std::string metric : {"logarithm", "g2o", "rotation_vector"}) {
    Registry registry;
    if (registry.has("types", "slam3d"))
      registry.set_type_options(parse_component("slam3d:metric=" + metric));
    for (const std::string& tag : registry.names("factor")) {
      const auto type = registry.factor_type(tag);
      const std::string_view its = type->metric();
      if (!type->is_relative() || its != (its.empty() && metric == "logarithm" ? "" : metric))
        continue;
      types.push_back({tag + " " + std::string(type->metric()),
                       registry.variable_type(type->variable_tags()[0]), type});
    }
  }
  return types;
}

class MotionOfFactor : public testing::Test {
 protected:
  void SetUp() override {
    if (types_.empty()) GTEST_SKIP() << "no plugin offers a relative factor";
  }
  /// Some factor from variable 0 to 1.
  Factor factor(const RelativeType& type) {
    const MatrixXd Omega = sampler_.positive(type.factor->residual_size(), 10.0);
    Factor factor{type.factor, {0, 1}, sampler_.state(*type.pose), {}};
    for (int row = 0; row < Omega.rows(); ++row) {
      for (int column = row; column < Omega.cols(); ++column)
        factor.information.push_back(Omega(row, column));
    }
    type.factor->normalize(factor.measurement.data());
    return factor;
  }
  static void add(Graph& graph, const Factor& factor, int a, int b) {
    graph.add_factor(factor.type, std::array{a, b}, factor.measurement, factor.information);
  }
  /// `poses` of them, the first fixed.
  Graph poses(const RelativeType& type, int poses) {
    Graph graph;
    for (int v = 0; v < poses; ++v) graph.add_variable(type.pose, v, sampler_.state(*type.pose));
    graph.set_fixed(0);
    return graph;
  }
  /// What a graph that was brought to its minimum knows of the last pose, seen from the first.
  static Motion of_last(const Graph& graph) {
    const int last = graph.variable_count() - 1;
    const VariableType& type = graph.type(last);
    std::vector<double> back(graph.state(0).size()), z = back;
    type.lie_group()->inverse(graph.state(0).data(), back.data());
    type.lie_group()->compose(back.data(), graph.state(last).data(), z.data());
    const int n = type.tangent_size();
    return {z, numbers(test::dense_system(graph).Sigma().bottomRightCorner(n, n))};
  }

  const std::vector<RelativeType> types_ = relative_types();
  Sampler sampler_{31};
};

TEST_F(MotionOfFactor, IsTheFactorAgain) {
  for (const RelativeType& type : types_) {
    SCOPED_TRACE(type.name);
    const MotionGroup group(type.pose);
    const Motion motion = sampler_.motion(*type.pose);
    const Factor factor = group.to_factor(type.factor, 3, 8, motion);
    EXPECT_EQ(factor.type, type.factor);
    EXPECT_EQ(factor.variables, (std::vector<Id>{3, 8}));
    expect_same(group, group.of_factor(factor, 3), motion, 1e-12);
    expect_same(group, group.of_factor(factor, 8), group.inverse(motion), 1e-12);
  }
}

TEST_F(MotionOfFactor, IsWhatAGraphKnowsThatHasNothingElse) {
  for (const RelativeType& type : types_) {
    SCOPED_TRACE(type.name);
    const MotionGroup group(type.pose);
    const Factor only = factor(type);
    for (const bool turned : {false, true}) {
      Graph graph = poses(type, 2);
      add(graph, only, turned, !turned);
      test::solve_densely(graph);
      const Motion motion = group.of_factor(*only.type, only.measurement, only.information);
      expect_same(group, turned ? group.inverse(motion) : motion, of_last(graph), 1e-9);
    }
  }
}

TEST_F(MotionOfFactor, ComposesAsAGraphDoes) {
  for (const RelativeType& type : types_) {
    SCOPED_TRACE(type.name);
    const MotionGroup group(type.pose);
    const Factor first = factor(type), second = factor(type);
    Graph graph = poses(type, 3);
    add(graph, first, 0, 1);
    add(graph, second, 2, 1);
    test::solve_densely(graph);
    expect_same(group, group.compose(group.of_factor(first, 0), group.of_factor(second, 1)),
                of_last(graph), 1e-9);
  }
}

TEST_F(MotionOfFactor, IsFusedAsInAGraph) {
  for (const RelativeType& type : types_) {
    SCOPED_TRACE(type.name);
    const MotionGroup group(type.pose);
    const Factor first = factor(type);
    // Metrics differ where measurements do. The logarithm is what is minimised, however far apart.
    const bool exact = type.factor->metric() == "logarithm";
    Factor second = factor(type);
    const Motion shift{sampler_.state(*type.pose, exact ? 0.5 : 1e-4), group.identity().covariance};
    second.measurement = group.compose(group.of_factor(first, 0), shift).mean;
    Graph graph = poses(type, 2);
    add(graph, first, 0, 1);
    add(graph, second, 0, 1);
    test::solve_densely(graph);
    const Motion both = group.fuse(group.of_factor(first, 0), group.of_factor(second, 0));
    EXPECT_LT(distance(group, both.mean, of_last(graph).mean), exact ? 1e-9 : 1e-7);
    EXPECT_LT((covariance(both) - covariance(of_last(graph))).norm(),
              (exact ? 1e-9 : 1e-3) * covariance(both).norm());
  }
}

/// What was thrown, or an empty text.
std::string refusal(ErrorCode code, const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    return error.what();
  }
  return {};
}

struct OtherPose : Se2 {
  static constexpr std::string_view kTag = "VERTEX_OTHER";
};

class FactorOfTheCore : public testing::Test {
 protected:
  const test::PlanarTypes types_{};
  const MotionGroup group_{types_.pose};
  const std::vector<double> unit_{1, 0, 0, 1, 0, 1};
};

TEST_F(FactorOfTheCore, IsRefusedUnlessItIsAMotionOfThatGroup) {
  const std::vector<double> z(3, 0.0);
  EXPECT_THAT(
      refusal(ErrorCode::usage, [&] { group_.of_factor(*types_.prior, z, unit_); }),
      HasSubstr("EDGE_PRIOR_SE2 does not measure the motion from one VERTEX_SE2 to another"));
  EXPECT_THAT(
      refusal(
          ErrorCode::usage,
          [&] {
            group_.of_factor(*types_.point_seen, std::vector{1.0, 2.0}, std::vector{1.0, 0.0, 1.0});
          }),
      HasSubstr("EDGE_SE2_XY does not measure"));
  EXPECT_THAT(refusal(ErrorCode::usage,
                      [&] {
                        const MotionGroup spatial(define_variable<Se3>());
                        spatial.of_factor(*types_.relative_pose, z, unit_);
                      }),
              HasSubstr("from one VERTEX_SE3:QUAT to another"));
  EXPECT_THAT(refusal(ErrorCode::usage,
                      [&] {
                        const MotionGroup other(define_variable<OtherPose>());
                        other.of_factor(*types_.relative_pose, z, unit_);
                      }),
              HasSubstr("from one VERTEX_OTHER to another"));
  EXPECT_THAT(refusal(ErrorCode::usage,
                      [&] {
                        group_.of_factor({types_.relative_pose, {4, 7}, z, unit_}, 5);
                      }),
              HasSubstr("EDGE_SE2 4 7 is no motion from variable 5"));
}

TEST_F(FactorOfTheCore, IsRefusedWithNumbersThatNoGraphWouldTake) {
  const auto refused = [&](const std::vector<double>& z, const std::vector<double>& information) {
    return refusal(ErrorCode::input,
                   [&] { group_.of_factor(*types_.relative_pose, z, information); });
  };
  EXPECT_THAT(refused({0, 0}, unit_), HasSubstr("2 + 6 numbers"));
  EXPECT_THAT(refused({0, 0, 0}, {1, 0, 0}), HasSubstr("3 + 3 numbers"));
  EXPECT_THAT(refused({0, 0, 0}, {1, 2, 0, 1, 0, 1}), HasSubstr("not positive definite"));
  EXPECT_THAT(refused({0, 0, 0}, {1, NAN, 0, 1, 0, 1}), HasSubstr("not positive definite"));
  EXPECT_THAT(refusal(ErrorCode::input,
                      [&] {
                        group_.of_factor({types_.relative_pose, {4}, {0, 0, 0}, unit_}, 4);
                      }),
              HasSubstr("EDGE_SE2 joins 2 variables, not 1"));
}

TEST_F(FactorOfTheCore, CannotBeMadeOfAMotionThatIsKnownExactly) {
  EXPECT_THAT(refusal(ErrorCode::numerical,
                      [&] { group_.to_factor(types_.relative_pose, 0, 1, group_.identity()); }),
              HasSubstr("not positive definite"));
  EXPECT_THAT(
      refusal(ErrorCode::usage, [&] { group_.to_factor(types_.prior, 0, 1, group_.identity()); }),
      HasSubstr("EDGE_PRIOR_SE2 does not measure"));
}

}  // namespace
}  // namespace cairn
