// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/typed/build.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <functional>
#include <string>
#include <tuple>

#include <Eigen/LU>

#include "cairn/lie/se2.hpp"

namespace cairn {
namespace {

using symbols::L;
using symbols::X;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string refusal(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

/// The distance to a beacon: |l − t| − z.
struct Range {
  static constexpr std::string_view kTag = "EDGE_RANGE_OF_A_TEST";
  static constexpr int kResidual = 1, kMeasurement = 1;
  using Variables = std::tuple<Se2, PointXY>;
  template <class S>
  static Vector<S, 1> residual(const BasicPose2<S>& robot, const BasicPoint2<S>& beacon,
                               const Vector<double, 1>& measured) {
    using std::sqrt;
    const BasicPoint2<S> seen = robot.transform_to(beacon);
    return Vector<S, 1>(sqrt(seen[0] * seen[0] + seen[1] * seen[1]) - measured[0]);
  }
};

/// Relative pose, written with values.
struct Motion {
  static constexpr std::string_view kTag = "EDGE_MOTION_OF_A_TEST";
  static constexpr int kResidual = 3, kMeasurement = 3;
  using Variables = std::tuple<Se2, Se2>;
  template <class S>
  static Vector<S, 3> residual(const BasicPose2<S>& a, const BasicPose2<S>& b,
                               const Pose2& measured) {
    return measured.cast<S>().between(a.between(b)).log();
  }
};

TEST(TypedGraph, TakesVariablesAndGivesThemBack) {
  Graph graph;
  EXPECT_EQ(graph.add(X(0), Pose2(1.0, 2.0, 0.5)), 0);
  EXPECT_EQ(graph.add(L(0), Point2(3.0, 4.0)), 1);
  EXPECT_EQ(graph.add(10, Pose3(Rot3::yaw(0.3), {1, 2, 3})), 2);
  EXPECT_EQ(graph.add(11, Point3(1, 2, 3)), 3);
  EXPECT_TRUE(graph.at<Pose2>(X(0)).equals(Pose2(1.0, 2.0, 0.5), 0.0));
  EXPECT_TRUE(graph.at<Point2>(L(0)).equals({3.0, 4.0}, 0.0));
  EXPECT_TRUE(graph.at<Pose3>(10).equals(Pose3(Rot3::yaw(0.3), {1, 2, 3})));
  EXPECT_TRUE(graph.at<Point3>(11).equals({1, 2, 3}, 0.0));
  EXPECT_THAT(refusal([&] { graph.at<Pose2>(X(1)); }), HasSubstr("no variable x1 in the graph"));
  EXPECT_THAT(refusal([&] { graph.at<Pose2>(L(0)); }),
              HasSubstr("is not a VERTEX_SE2, which a Pose2 is read from"));
  EXPECT_THAT(refusal([&] { graph.add(X(0), Pose2()); }), HasSubstr("the id is already that of"));
}

TEST(TypedGraph, MeasurementsBecomeTheFactorsOfTheirTags) {
  Graph graph;
  graph.add(20, Pose2());
  graph.add(10, Pose2());
  graph.add(5, Point2());
  graph.add(1, Pose3());
  graph.add(2, Pose3());
  graph.add(3, Point3());
  graph.add(Between(20, 10, Pose2(1, 2, 0.5)), Information::unit(3));
  graph.add(Prior(10, Pose2(1, 2, 0.5)), Information::unit(3));
  graph.add(Prior(5, Point2(1, 2)), Information::unit(2));
  graph.add(Observation(20, 5, Point2(1, 2)), Information::unit(2));
  graph.add(BearingRange(20, 5, 0.5, 2.0), Information::unit(2));
  graph.add(Between(1, 2, Pose3(Rot3(), {1, 2, 3})), Information::unit(6));
  graph.add(Prior(1, Pose3()), Information::unit(6));
  graph.add(Prior(3, Point3()), Information::unit(3));
  EXPECT_EQ(graph.add(Observation(2, 3, Point3(1, 2, 3)), Information::sigmas(1, 1, 0.5)), 8);

  const char* expected[] = {"EDGE_SE2 20 10",
                            "EDGE_PRIOR_SE2 10",
                            "EDGE_PRIOR_XY 5",
                            "EDGE_SE2_XY 20 5",
                            "EDGE_BEARING_RANGE_SE2_XY 20 5",
                            "EDGE_SE3:QUAT 1 2",
                            "EDGE_PRIOR_SE3:QUAT 1",
                            "EDGE_PRIOR_TRACKXYZ 3",
                            "EDGE_SE3_TRACKXYZ 2 3"};
  for (int f = 0; f < graph.factor_count(); ++f) EXPECT_EQ(graph.describe_factor(f), expected[f]);
  EXPECT_THAT(graph.measurement(0), ElementsAre(1, 2, 0.5));
  EXPECT_THAT(graph.measurement(4), ElementsAre(0.5, 2));
  EXPECT_THAT(graph.measurement(5), ElementsAre(1, 2, 3, 0, 0, 0, 1));
  EXPECT_THAT(graph.information(8), ElementsAre(1, 0, 0, 1, 0, 4));
}

TEST(TypedGraph, RefusesWhatDoesNotFit) {
  Graph graph;
  graph.add(0, Pose2());
  graph.add(1, Point2());
  EXPECT_THAT(refusal([&] { graph.add(Between(0, 7, Pose2()), Information::unit(3)); }),
              HasSubstr("7"));
  EXPECT_THAT(refusal([&] { graph.add(Between(0, 1, Pose2()), Information::unit(3)); }),
              HasSubstr("variable 1 is a VERTEX_XY, expected a VERTEX_SE2"));
  EXPECT_NE(refusal([&] { graph.add(Prior(0, Pose2()), Information::unit(2)); }), "");
  EXPECT_EQ(graph.factor_count(), 0);
}

TEST(TypedGraph, GoesOnWithTheTypesThatItHas) {
  Registry registry;  // not the default one
  Graph graph;
  add(graph, 0, Pose2(), registry);
  add(graph, 1, Pose2(), registry);
  add(graph, Between(0, 1, Pose2(1, 0, 0)), Information::unit(3), nullptr, registry);
  graph.add(2, Pose2());
  graph.add(Between(1, 2, Pose2(1, 0, 0)), Information::unit(3));
  EXPECT_EQ(graph.variable_pools().size(), 1U);
  EXPECT_EQ(graph.factor_pools().size(), 1U);
  EXPECT_EQ(graph.factor_pools()[0].type, registry.factor_type("EDGE_SE2"));
  EXPECT_NE(registry.factor_type("EDGE_SE2"), default_registry().factor_type("EDGE_SE2"));
}

TEST(TypedGraph, TakesAFactorOfOnesOwnWithoutAPlugin) {
  Graph graph;
  graph.add(X(0), Pose2(1.0, 0.0, 0.3));
  graph.add(L(0), Point2(4.0, 4.0));
  graph.add(Measurement<Range>({X(0), L(0)}, {4.5}), Information::sigmas(0.5));
  EXPECT_NEAR(squared_norms(graph)[0], 1.0, 1e-12);  // (5 − 4.5) / 0.5
  EXPECT_EQ(graph.factor_pools()[0].type, factor_type<Range>());
}

TEST(TypedGraph, TakesTheTypeThatARegistryWasGiven) {
  Registry registry;
  const auto own = define_factor<Range>();
  registry.add(own);
  Graph graph;
  add(graph, X(0), Pose2(), registry);
  add(graph, L(0), Point2(3.0, 4.0), registry);
  add(graph, Measurement<Range>({X(0), L(0)}, {4.0}), Information::unit(1), nullptr, registry);
  EXPECT_EQ(graph.factor_pools()[0].type, own);
}

TEST(TypedGraph, ResidualsWrittenWithValuesDifferentiateThemselves) {
  const Pose2 a(1.0, 2.0, 0.4), b(2.0, 2.5, 0.9), z(1.0, 0.2, 0.4);
  const auto& type = *factor_type<Motion>();
  const std::array<const double*, 2> x{a.state().data(), b.state().data()};
  const std::vector<double> unit = Information::unit(3).packed();
  Eigen::Vector3d r;
  Eigen::Matrix3d J_a, J_b;
  double* jacobians[] = {J_a.data(), J_b.data()};
  type.evaluate(x.data(), z.state().data(), unit.data(), r.data(), jacobians);
  EXPECT_LT((r - z.between(a.between(b)).log()).norm(), 1e-15);
  // e(b exp δ) = log(E exp δ): the inverse right Jacobian of the logarithm; and moving a is moving
  // b the other way, seen from b.
  EXPECT_LT((J_b - Se2::retract_jacobian({}, r).inverse()).norm(), 1e-12);
  EXPECT_LT((J_a + J_b * b.between(a).adjoint()).norm(), 1e-12);

  Graph graph;
  graph.add(0, a);
  graph.add(1, b);
  graph.add(Measurement<Motion>({0, 1}, z), Information::unit(3));
  EXPECT_NEAR(squared_norms(graph)[0], r.squaredNorm(), 1e-15);
}

TEST(TypedUpdate, CollectsVariablesAndMeasurements) {
  GraphUpdate update;
  update.add(X(0), Pose2(1, 2, 0.5));
  update.add<Pose2>(X(1));
  update.add(Between(X(0), X(1), Pose2(1, 0, 0)), Information::sigmas(0.5, 0.5, 0.5));
  ASSERT_EQ(update.variables.size(), 2U);
  EXPECT_THAT(update.variables[0].state, ElementsAre(1, 2, 0.5));
  EXPECT_TRUE(update.variables[1].state.empty());
  EXPECT_EQ(update.variables[1].type, default_registry().variable_type("VERTEX_SE2"));
  ASSERT_EQ(update.factors.size(), 1U);
  EXPECT_THAT(update.factors[0].variables, ElementsAre(X(0), X(1)));
  EXPECT_THAT(update.factors[0].information, ElementsAre(4, 0, 0, 4, 0, 4));
  EXPECT_EQ(update.factors[0].loss, nullptr);
}

TEST(MakeFactor, KeepsItsLoss) {
  const std::shared_ptr<const Loss> loss = default_registry().make<Loss>("cauchy");
  const Factor factor = make_factor(Prior(0, Pose2()), Information::unit(3), loss);
  EXPECT_EQ(factor.loss, loss);
}

}  // namespace
}  // namespace cairn
