// SPDX-License-Identifier: BSD-3-Clause
// Factors as motions and back, against what a graph of them knows.
#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/geometry/motion.hpp"
#include "cairn/lie/se2.hpp"
#include "cairn/lie/se3.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/types/define_variable.hpp"
#include "support/dense_system.hpp"
#include "support/planar_graph.hpp"
#include "unit/lib/geometry/motions.hpp"

namespace cairn::test {
namespace {

using Eigen::MatrixXd;
using testing::HasSubstr;

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
    return {z, numbers(dense_system(graph).Sigma().bottomRightCorner(n, n))};
  }

  const std::vector<RelativeType> types_ = relative_types();
  MotionSampler sampler_{31};
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
      solve_densely(graph);
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
    solve_densely(graph);
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
    solve_densely(graph);
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
  const PlanarTypes types_{};
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
              HasSubstr("EDGE_SE2 4 7 is not a motion from variable 5"));
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
}  // namespace cairn::test
