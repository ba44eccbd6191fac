// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/graph/gauge.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/types/define_factor.hpp"
#include "support/planar_graph.hpp"
#include "support/scaled_pose.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class GaugeTest : public ::testing::Test {
 protected:
  GaugeTest() {
    // Two components: poses 0 1 2 with a point that comes first, and poses 10 11.
    graph_.add_variable(types_.point, 100, std::array{0.0, 0.0});
    for (const Id id : {0, 1, 2, 10, 11})
      graph_.add_variable(types_.pose, id, std::array{0.0, 0.0, 0.0});
    connect(1, 2);
    connect(2, 3);
    connect(4, 5);
    graph_.add_factor(types_.point_seen, std::array{1, 0}, std::array{1.0, 0.0},
                      std::array{1.0, 0.0, 1.0});
  }
  void connect(int a, int b) {
    graph_.add_factor(types_.relative_pose, std::array{a, b}, std::array{1.0, 0.0, 0.0},
                      std::array{1.0, 0.0, 0.0, 1.0, 0.0, 1.0});
  }
  test::PlanarTypes types_;
  Graph graph_;
};

TEST_F(GaugeTest, AnchorsTheFirstPoseOfEachComponentNotAPoint) {
  const Gauge gauge = resolve_gauge(graph_);
  EXPECT_EQ(gauge.components, 2);
  EXPECT_THAT(gauge.anchored, ElementsAre(1, 4));
  EXPECT_THAT(gauge.held, ElementsAre(false, true, false, false, true, false));
  EXPECT_THAT(gauge.component, ElementsAre(0, 0, 0, 0, 1, 1));
  EXPECT_EQ(gauge.describe(graph_),
            "2 components without a fixed variable or enough priors: anchored one variable of each "
            "(VERTEX_SE2 0, VERTEX_SE2 10)");
}

TEST_F(GaugeTest, LeavesAComponentWithAFixedVariableAlone) {
  graph_.set_fixed(3);
  const Gauge gauge = resolve_gauge(graph_);
  EXPECT_THAT(gauge.anchored, ElementsAre(4));
  EXPECT_TRUE(gauge.held[3]);
  EXPECT_FALSE(gauge.held[1]);
  EXPECT_EQ(gauge.describe(graph_), "a component has no fixed variable: anchored VERTEX_SE2 10");
}

TEST_F(GaugeTest, APriorOnAPoseFixesItsComponent) {
  graph_.add_factor(types_.prior, std::array{5}, std::array{0.0, 0.0, 0.0},
                    std::array{1.0, 0.0, 0.0, 1.0, 0.0, 1.0});
  graph_.set_fixed(1);
  const Gauge gauge = resolve_gauge(graph_);
  EXPECT_THAT(gauge.anchored, IsEmpty());
  EXPECT_EQ(gauge.describe(graph_), "");
}

TEST_F(GaugeTest, PriorsOnPointsFixAComponentOnlyTogetherAndAreNotDefied) {
  const auto add_prior = [&] {
    graph_.add_factor(types_.point_prior, std::array{0}, std::array{0.0, 0.0},
                      std::array{1.0, 0.0, 1.0});
  };
  add_prior();
  EXPECT_THAT(resolve_gauge(graph_).anchored, ElementsAre(4));
  EXPECT_THAT(resolve_gauge(graph_).left_free, ElementsAre(1));
  add_prior();
  EXPECT_THAT(resolve_gauge(graph_).anchored, ElementsAre(4));
  EXPECT_THAT(resolve_gauge(graph_).left_free, IsEmpty());
}

TEST_F(GaugeTest, HoldsAVariableThatNoFactorTouches) {
  const int lost = graph_.add_variable(types_.pose, 99, std::array{0.0, 0.0, 0.0});
  const Gauge gauge = resolve_gauge(graph_);
  EXPECT_TRUE(gauge.held[lost]);
  EXPECT_THAT(gauge.unconstrained, ElementsAre(lost));
  EXPECT_THAT(
      gauge.describe(graph_),
      ::testing::HasSubstr("1 variable has no factor and is constant, the first is VERTEX_SE2 99"));
}

using test::ScaledPose;

struct ScaledSighting {
  static constexpr std::string_view kTag = "EDGE_SCALED";
  static constexpr int kResidual = 1, kMeasurement = 1;
  using Variables = std::tuple<ScaledPose, ScaledPose>;
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 4>& a, const Vector<S, 4>& b,
                               const Vector<double, 1>& z) {
    return Vector<S, 1>(b[0] - a[0] - z[0]);
  }
};

TEST_F(GaugeTest, LeavesAComponentFreeWhoseLargestVariableIsNoGroup) {
  const auto type = define_variable<ScaledPose>();
  const int a = graph_.add_variable(type, 50, std::array{0.0, 0.0, 0.0, 0.0});
  const int b = graph_.add_variable(type, 51, std::array{1.0, 0.0, 0.0, 0.0});
  graph_.add_factor(define_factor<ScaledSighting>(), std::array{a, b}, std::array{1.0},
                    std::array{1.0});
  const Gauge gauge = resolve_gauge(graph_);
  EXPECT_EQ(gauge.components, 3);
  EXPECT_THAT(gauge.anchored, ElementsAre(1, 4)) << "the others are anchored all the same";
  EXPECT_THAT(gauge.left_free, ElementsAre(a));
  EXPECT_FALSE(gauge.held[a] || gauge.held[b]);
  EXPECT_THAT(
      gauge.describe(graph_),
      ::testing::EndsWith("; the gauge of a component is left free: anchoring VERTEX_SCALED "
                          "50 would constrain more, or contradict its priors"));
  graph_.set_fixed(b);
  EXPECT_THAT(resolve_gauge(graph_).left_free, IsEmpty());
}

}  // namespace
}  // namespace cairn
