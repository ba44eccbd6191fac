// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/update/recorded_graph.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/lie/se2.hpp"
#include "cairn/lie/se3.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/typed/symbol.hpp"
#include "cairn/types/define_factor.hpp"
#include "support/placeless.hpp"
#include "support/planar_graph.hpp"
#include "support/scaled_pose.hpp"

namespace cairn {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

const std::vector<double> kUnit3 = {1, 0, 0, 1, 0, 1}, kUnit2 = {1, 0, 1};

class ArrivalOrder : public ::testing::Test {
 protected:
  int pose(Id id) { return graph_.add_variable(types_.pose, id, std::array{0.0, 0.0, 0.0}); }
  int point(Id id) { return graph_.add_variable(types_.point, id, std::array{0.0, 0.0}); }
  int between(int a, int b) {
    return graph_.add_factor(types_.relative_pose, std::array{a, b}, std::array{1.0, 0.0, 0.0},
                             kUnit3);
  }
  int seen(int pose, int point) {
    return graph_.add_factor(types_.point_seen, std::array{pose, point}, std::array{1.0, 0.0},
                             kUnit2);
  }
  test::PlanarTypes types_;
  Graph graph_;
};

TEST_F(ArrivalOrder, APoseComesWithWhatItSeesFirst) {
  const int l = point(100);
  const int a = pose(1), b = pose(2), c = pose(3);
  const int ab = between(a, b), bl = seen(b, l), bc = between(b, c), cl = seen(c, l),
            ac = between(a, c);
  const std::vector<Arrival> order = arrival_order(graph_);
  ASSERT_THAT(order, SizeIs(3));
  EXPECT_THAT(order[0].variables, ElementsAre(a));
  EXPECT_THAT(order[0].odometry, IsEmpty());
  EXPECT_THAT(order[0].links, IsEmpty());
  EXPECT_THAT(order[1].variables, ElementsAre(b, l));
  EXPECT_THAT(order[1].odometry, ElementsAre(ab));
  EXPECT_THAT(order[1].links, ElementsAre(bl));
  EXPECT_THAT(order[2].variables, ElementsAre(c));
  EXPECT_THAT(order[2].odometry, ElementsAre(bc));
  EXPECT_THAT(order[2].links, ElementsAre(cl, ac));
  EXPECT_TRUE(in_arrival_order(order));
}

TEST_F(ArrivalOrder, PosesComeByIdWhateverTheOrderOfTheFile) {
  const int c = pose(30), a = pose(10), b = pose(20);
  const int bc = between(b, c), ab = between(a, b);
  const std::vector<Arrival> order = arrival_order(graph_);
  ASSERT_THAT(order, SizeIs(3));
  EXPECT_THAT(order[0].variables, ElementsAre(a));
  EXPECT_THAT(order[1].odometry, ElementsAre(ab));
  EXPECT_THAT(order[2].odometry, ElementsAre(bc));
  EXPECT_FALSE(in_arrival_order(order));
}

TEST_F(ArrivalOrder, HasEveryVariableAndFactorOnce) {
  graph_ = test::random_graph(types_, 20, 9, 3);
  const int lonely = point(1000);
  const int prior =
      graph_.add_factor(types_.point_prior, std::array{lonely}, std::array{0.0, 0.0}, kUnit2);
  std::vector<int> variables(static_cast<std::size_t>(graph_.variable_count()), 0),
      factors(static_cast<std::size_t>(graph_.factor_count()), 0), step(variables.size());
  const std::vector<Arrival> order = arrival_order(graph_);
  for (std::size_t k = 0; k < order.size(); ++k) {
    for (const int v : order[k].variables) {
      ++variables[v];
      step[v] = static_cast<int>(k);
    }
    for (const auto* some : {&order[k].odometry, &order[k].links}) {
      for (const int f : *some) {
        ++factors[f];
        for (const std::int32_t v : graph_.factor_variables(f)) {
          EXPECT_EQ(variables[v], 1) << graph_.describe_factor(f);  // it is there
        }
      }
    }
  }
  EXPECT_THAT(variables, ::testing::Each(1));
  EXPECT_THAT(factors, ::testing::Each(1));
  EXPECT_EQ(step[lonely], 19);
  EXPECT_EQ(order.back().links.back(), prior);
}

TEST_F(ArrivalOrder, IsBrokenByAFactorThatComesTooEarly) {
  const int a = pose(1), b = pose(2), c = pose(3);
  between(a, b);
  between(a, c);
  between(b, c);
  EXPECT_TRUE(in_arrival_order(arrival_order(graph_)));
  between(b, a);
  EXPECT_FALSE(in_arrival_order(arrival_order(graph_)));
}

/// A velocity and a bias, which are nowhere.
struct Velocity : test::Placeless<2> {
  static constexpr std::string_view kTag = "VERTEX_VELOCITY";
};
struct Bias : test::Placeless<1> {
  static constexpr std::string_view kTag = "VERTEX_BIAS";
};

/// From one pose and velocity to the next, by a sensor with a bias.
struct Motion {
  static constexpr std::string_view kTag = "EDGE_MOTION";
  static constexpr int kResidual = 2, kMeasurement = 2;
  using Variables = std::tuple<Se2, Velocity, Se2, Velocity, Bias>;
  template <class S>
  static Vector<S, 2> residual(const Vector<S, 3>& a, const Vector<S, 2>& v, const Vector<S, 3>& b,
                               const Vector<S, 2>& w, const Vector<S, 1>& bias,
                               const Vector<double, 2>& z) {
    return a.template head<2>() + v - b.template head<2>() + w - z.template cast<S>() * bias[0];
  }
};

/// How a bias walks.
struct Walk {
  static constexpr std::string_view kTag = "EDGE_WALK";
  static constexpr int kResidual = 1, kMeasurement = 1;
  using Variables = std::tuple<Bias, Bias>;
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 1>& a, const Vector<S, 1>& b,
                               const Vector<double, 1>& z) {
    return b - a - z.template cast<S>();
  }
};

// With ids as symbols all biases come first in a file, then all velocities, then the poses. The
// last bias is met by another bias alone.
TEST_F(ArrivalOrder, WhatHasNoPositionComesWithTheFirstFactorThatTiesItToPoses) {
  const auto velocity = define_variable<Velocity>();
  const auto bias = define_variable<Bias>();
  const auto motion = define_factor<Motion>();
  const auto walk = define_factor<Walk>();
  std::vector<int> b, v, x, motions, walks;
  for (int k = 0; k < 4; ++k)
    b.push_back(graph_.add_variable(bias, symbol('b', k), std::array{0.0}));
  for (int k = 0; k < 4; ++k)
    v.push_back(graph_.add_variable(velocity, symbol('v', k), std::array{0.0, 0.0}));
  for (int k = 0; k < 4; ++k) x.push_back(pose(symbol('x', k)));
  for (int k = 1; k < 4; ++k) {
    motions.push_back(graph_.add_factor(motion,
                                        std::array{x[k - 1], v[k - 1], x[k], v[k], b[k - 1]},
                                        std::array{1.0, 0.0}, kUnit2));
    walks.push_back(
        graph_.add_factor(walk, std::array{b[k - 1], b[k]}, std::array{0.0}, std::array{1.0}));
  }
  const std::vector<Arrival> order = arrival_order(graph_);
  ASSERT_THAT(order, SizeIs(4));
  EXPECT_THAT(order[0].variables, ElementsAre(x[0]));
  EXPECT_THAT(order[1].variables, ElementsAre(x[1], b[0], v[0], v[1]));
  EXPECT_THAT(order[2].variables, ElementsAre(x[2], b[1], v[2]));
  EXPECT_THAT(order[3].variables, ElementsAre(x[3], b[2], b[3], v[3]));
  EXPECT_THAT(order[1].links, ElementsAre(motions[0]));
  EXPECT_THAT(order[3].links, ElementsAre(walks[1], motions[2], walks[2]));
}

TEST_F(ArrivalOrder, WithoutPosesWhatHasNoPositionIsAStep) {
  const auto bias = define_variable<Bias>();
  const int b = graph_.add_variable(bias, 2, std::array{0.0}),
            a = graph_.add_variable(bias, 1, std::array{0.0});
  graph_.add_factor(define_factor<Walk>(), std::array{a, b}, std::array{0.0}, std::array{1.0});
  const std::vector<Arrival> order = arrival_order(graph_);
  ASSERT_THAT(order, SizeIs(2));
  EXPECT_THAT(order[0].variables, ElementsAre(a));
  EXPECT_THAT(order[1].variables, ElementsAre(b));
}

// Pose graphs -------------------------------------------------------------------------------------

class PoseChain : public testing::Test {
 protected:
  int pose(Id id) { return graph_.add_variable(types_.pose, id, std::array{1.0, 2.0, 0.3}); }
  /// By id.
  int join(Id a, Id b) {
    return graph_.add_factor(types_.relative_pose, std::array{*graph_.find(a), *graph_.find(b)},
                             std::array{1.0, 0.5, 0.1}, std::array{2.0, 0.0, 0.0, 3.0, 0.0, 4.0});
  }
  std::string refusal() {
    try {
      pose_chain(graph_);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::input);
      return error.what();
    }
    return {};
  }

  const test::PlanarTypes types_{};
  Graph graph_;
};

TEST_F(PoseChain, IsByRisingIdWhateverTheOrderInTheGraph) {
  const int v30 = pose(30), v10 = pose(10), v40 = pose(40), v20 = pose(20);
  const int loop = join(40, 10), f34 = join(40, 30), f12 = join(10, 20), other_loop = join(10, 40),
            f23 = join(20, 30), f21 = join(20, 10), third_loop = join(10, 30);
  const std::vector<Arrival> chain = pose_chain(graph_);
  ASSERT_THAT(chain, SizeIs(4));
  const std::array variables{v10, v20, v30, v40};
  for (std::size_t k = 0; k < 4; ++k) EXPECT_EQ(chain[k].pose(), variables[k]);
  EXPECT_THAT(chain[0].odometry, IsEmpty());
  EXPECT_THAT(chain[1].odometry, ElementsAre(f12, f21));
  EXPECT_THAT(chain[2].odometry, ElementsAre(f23));
  EXPECT_THAT(chain[3].odometry, ElementsAre(f34));
  EXPECT_THAT(chain[0].links, IsEmpty());
  EXPECT_THAT(chain[1].links, IsEmpty());
  EXPECT_THAT(chain[2].links, ElementsAre(third_loop));
  EXPECT_THAT(chain[3].links, ElementsAre(loop, other_loop));
}

TEST_F(PoseChain, MayBeShort) {
  EXPECT_THAT(pose_chain(graph_), IsEmpty());
  const int only = pose(5);
  const std::vector<Arrival> chain = pose_chain(graph_);
  ASSERT_THAT(chain, SizeIs(1));
  EXPECT_EQ(chain[0].pose(), only);
  EXPECT_THAT(chain[0].odometry, IsEmpty());
}

TEST_F(PoseChain, NamesTheGapInItsOdometry) {
  for (const Id id : {1, 2, 5, 6}) pose(id);
  join(1, 2), join(5, 6), join(1, 5);
  EXPECT_THAT(refusal(), AllOf(HasSubstr("no factor joins VERTEX_SE2 5 to VERTEX_SE2 2"),
                               HasSubstr("ids increase along the trajectory")));
}

TEST_F(PoseChain, SaysWhereTheGraphIsInParts) {
  for (const Id id : {1, 2, 5, 6}) pose(id);
  join(1, 2), join(5, 6);
  EXPECT_THAT(refusal(), AllOf(HasSubstr("no measurements lead from VERTEX_SE2 2 to VERTEX_SE2 5"),
                               HasSubstr("2 parts"), HasSubstr("(begin=5)")));
  EXPECT_THAT(pose_chain(graph_, 5), SizeIs(2));
}

TEST_F(PoseChain, HasTheAbsoluteMeasurementsOfEachPose) {
  for (const Id id : {1, 2, 3}) pose(id);
  join(1, 2), join(2, 3), join(1, 3);
  const std::array<int, 1> on{1};
  graph_.add_factor(types_.prior, on, std::array{0.0, 0.0, 0.0}, kUnit3);
  const std::vector<Arrival> chain = pose_chain(graph_);
  EXPECT_THAT(chain[1].priors, ElementsAre(3));
  EXPECT_THAT(chain[1].links, IsEmpty());
  EXPECT_THAT(chain[2].priors, IsEmpty());
  EXPECT_THAT(chain[2].links, ElementsAre(2));
  EXPECT_EQ(arrival_update(graph_, chain[1]).factors.back().type->tag(), "EDGE_PRIOR_SE2");
}

TEST_F(PoseChain, HasWhatEachPoseSeesOfLandmarks) {
  const int point = graph_.add_variable(types_.point, 0, std::array{0.0, 0.0});
  for (const Id id : {1, 2, 3}) pose(id);
  join(1, 2), join(2, 3), join(1, 3);
  const auto see = [&](Id id) {
    return graph_.add_factor(types_.point_seen, std::array{*graph_.find(id), point},
                             std::array{1.0, 2.0}, std::array{1.0, 0.0, 1.0});
  };
  const int third = see(3), second = see(2);
  const std::vector<Arrival> chain = pose_chain(graph_);
  ASSERT_THAT(chain, SizeIs(3));
  EXPECT_THAT(chain[0].observations, IsEmpty());
  EXPECT_THAT(chain[1].observations, ElementsAre(second));
  EXPECT_THAT(chain[1].variables, ElementsAre(*graph_.find(2), point));
  EXPECT_THAT(chain[2].observations, ElementsAre(third));
  EXPECT_THAT(chain[2].links, SizeIs(1));
}

TEST_F(PoseChain, RefusesPointsAloneAndMeasurementsOfALandmarkAlone) {
  const int point = graph_.add_variable(types_.point, 9, std::array{0.0, 0.0});
  EXPECT_THAT(refusal(), HasSubstr("VERTEX_XY 9 and all others are points"));
  pose(1);
  const std::array<int, 1> on{point};
  graph_.add_factor(types_.point_prior, on, std::array{0.0, 0.0}, std::array{1.0, 0.0, 1.0});
  EXPECT_THAT(refusal(), HasSubstr("is neither the motion from one pose to another, nor"));
}

TEST_F(PoseChain, RefusesWhatFormsNoGroup) {
  graph_.add_variable(define_variable<test::ScaledPose>(), 4, std::array{0.0, 0.0, 0.0, 0.0});
  EXPECT_THAT(refusal(), HasSubstr("VERTEX_SCALED 4 is not a pose of a Lie group"));
}

TEST_F(PoseChain, RefusesPosesOfTwoTypes) {
  pose(1);
  graph_.add_variable(define_variable<Se3>(), 2, std::array{0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0});
  EXPECT_THAT(refusal(),
              HasSubstr("VERTEX_SE2 1 and VERTEX_SE3:QUAT 2 are poses of different types"));
}

/// How far apart two poses are [m]: on poses alone, and no motion.
struct Distance {
  static constexpr std::string_view kTag = "EDGE_DISTANCE";
  static constexpr int kResidual = 1, kMeasurement = 1;
  using Variables = std::tuple<Se2, Se2>;
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 3>& a, const Vector<S, 3>& b,
                               const Vector<double, 1>& z) {
    using std::sqrt;
    const S dx = a[0] - b[0], dy = a[1] - b[1];
    return Vector<S, 1>{sqrt(dx * dx + dy * dy) - z[0]};
  }
};

TEST_F(PoseChain, RefusesFactorsThatAreNoMotions) {
  pose(1), pose(2);
  join(1, 2);
  graph_.add_factor(define_factor<Distance>(), std::array{0, 1}, std::array{1.0}, std::array{1.0});
  EXPECT_THAT(refusal(), AllOf(HasSubstr("EDGE_DISTANCE 1 2 is neither the motion"),
                               HasSubstr("leave it out")));
}

// Updates -----------------------------------------------------------------------------------------

TEST_F(ArrivalOrder, AnUpdateHasTheOdometryFirst) {
  const int a = pose(1), b = pose(2), l = point(100);
  const int bl = seen(b, l), ab = between(a, b);
  graph_.set_fixed(a);
  graph_.set_state(b, std::array{3.0, 4.0, 0.5});
  const std::vector<Arrival> order = arrival_order(graph_);
  const GraphUpdate first = arrival_update(graph_, order[0]),
                    second = arrival_update(graph_, order[1]);
  ASSERT_THAT(first.variables, SizeIs(1));
  EXPECT_TRUE(first.variables[0].fixed);
  EXPECT_THAT(first.factors, IsEmpty());
  ASSERT_THAT(second.variables, SizeIs(2));
  EXPECT_EQ(second.variables[0].id, 2);
  EXPECT_THAT(second.variables[0].state, ElementsAre(3.0, 4.0, 0.5));
  EXPECT_EQ(second.variables[1].id, 100);
  ASSERT_THAT(second.factors, SizeIs(2));
  EXPECT_THAT(second.factors[0].variables, ElementsAre(1, 2));    // ab
  EXPECT_THAT(second.factors[1].variables, ElementsAre(2, 100));  // bl
  EXPECT_LT(bl, ab);
}

TEST_F(ArrivalOrder, StatesAreLeftToTheFactorsThatCanComputeThem) {
  const int a = pose(1), b = pose(2), c = pose(3), l = point(100);
  between(a, b);
  between(b, c);
  seen(b, l);  // the test's factor to a point computes none
  graph_.set_fixed(c);
  Registry registry;
  const auto estimator = registry.make<Estimator>("incremental_cholesky");
  const std::vector<Arrival> order = arrival_order(graph_);

  GraphUpdate first = arrival_update(graph_, order[0]);
  EXPECT_EQ(leave_states_to_factors(first, *estimator), 1);
  EXPECT_THAT(first.variables[0].state, SizeIs(3));
  estimator->update(first);

  GraphUpdate second = arrival_update(graph_, order[1]);
  EXPECT_EQ(leave_states_to_factors(second, *estimator), 1);
  EXPECT_THAT(second.variables[0].state, IsEmpty());
  EXPECT_THAT(second.variables[1].state, SizeIs(2));
  estimator->update(second);
  EXPECT_THAT(estimator->state(2), ElementsAre(1.0, 0.0, 0.0));

  GraphUpdate third = arrival_update(graph_, order[2]);
  EXPECT_EQ(leave_states_to_factors(third, *estimator), 0);
  EXPECT_THAT(third.variables[0].state, SizeIs(3));  // fixed
}

}  // namespace
}  // namespace cairn
