// SPDX-License-Identifier: BSD-3-Clause
// Both registrations on a few poses: which covariance they take, and what they refuse.
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/geometry/motion.hpp"
#include "compact/registration/registrations.hpp"

namespace cairn::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::SizeIs;

/// Planar poses one metre apart on the x axis, joined by odometry with unit information.
class PlanarRegistrations : public Registrations {
 protected:
  PlanarRegistrations() {
    const auto pose = registry.variable_type("VERTEX_SE2");
    for (int k = 0; k < 6; ++k)
      world.graph.add_variable(pose, 10 * k, std::array{1.0 * k, 0.0, 0.0});
    for (int k = 0; k < 5; ++k) link(k, k + 1, 1.0);
    world.truth = world.graph.clone();
  }
  void link(int a, int b, double weight) {
    world.graph.add_factor(registry.factor_type("EDGE_SE2"), std::array{a, b},
                           std::array{1.0 * (b - a), 0.0, 0.0},
                           std::array{weight, 0.0, 0.0, weight, 0.0, weight});
  }
  double variance_measured() {
    const MotionGroup group(registry.variable_type("VERTEX_SE2"));
    return group.of_factor(make("simulated")->match(0, 10).front(), 0).covariance[0];
  }
};

TEST_F(PlanarRegistrations, SimulatedTakesTheMedianOfTheRecordedCovariances) {
  EXPECT_NEAR(variance_measured(), 1.0, 1e-12);  // there is but odometry
  link(0, 2, 4.0);
  link(5, 2, 1e6);
  EXPECT_NEAR(variance_measured(), 1e-6, 1e-12);  // the better of the two
  link(1, 4, 100.0);
  EXPECT_NEAR(variance_measured(), 0.01, 1e-12);
}

TEST_F(PlanarRegistrations, SimulatedErrsWithTheCorrelationsOfTheRecording) {
  const int loop = world.graph.add_factor(registry.factor_type("EDGE_SE2"), std::array{4, 1},
                                          std::array{-3.0, 0.5, 0.8},
                                          std::array{400.0, 300.0, -700.0, 900.0, -900.0, 2500.0});
  const MotionGroup group(registry.variable_type("VERTEX_SE2"));
  const std::vector<double> covariance = group.of_factor(world.graph.factor(loop), 10).covariance;
  std::vector<Factor> measured;
  for (int seed = 0; seed < 500; ++seed) {
    const auto simulated = make("simulated:range=10,seed=" + std::to_string(seed));
    for (const auto& [pair, answer] : match_all(*simulated)) measured.push_back(answer.front());
  }
  ASSERT_THAT(measured, SizeIs(500 * 15));
  EXPECT_THAT(group.of_factor(measured.front(), measured.front().variables[0]).covariance,
              testing::Pointwise(testing::DoubleNear(1e-12), covariance));
  const Factor another = make("simulated:sigma_translation=0.5")->match(0, 10).front();
  EXPECT_THAT(group.of_factor(another, 0).covariance,
              testing::Pointwise(testing::DoubleNear(1e-12),
                                 {0.25, 0.0, 0.0, 0.0, 0.25, 0.0, 0.0, 0.0, covariance[8]}));
  double sum = 0.0;
  for (const double e : squared_errors(world.truth, measured)) sum += e;
  const auto count = static_cast<double>(measured.size());
  EXPECT_NEAR(sum / count, 3.0, 5.0 * std::sqrt(6.0 / count));
}

TEST_F(PlanarRegistrations, SimulatedSaysWhatItNeeds) {
  const auto simulated = registry.make<Registration>("simulated");
  EXPECT_THAT(message_of([&] { simulated->begin({.recording = &world.graph, .truth = nullptr}); },
                         ErrorCode::usage),
              AllOf(HasSubstr("needs the truth"), HasSubstr("--truth FILE"),
                    HasSubstr("give a graph with the true states"), HasSubstr("'recorded'")));
  EXPECT_THAT(message_of([&] { simulated->begin({.recording = nullptr, .truth = &world.truth}); },
                         ErrorCode::usage),
              HasSubstr("needs the recording"));
  const Graph empty;
  EXPECT_THAT(message_of([&] { simulated->begin({.recording = &empty, .truth = &world.truth}); },
                         ErrorCode::input),
              HasSubstr("no relative factor"));
  EXPECT_THROW(simulated->match(0, 10), std::logic_error);
}

TEST_F(PlanarRegistrations, SimulatedNamesThePoseWhoseTruthIsMissing) {
  const auto simulated = make("simulated");
  EXPECT_THAT(message_of([&] { simulated->match(0, 11); }, ErrorCode::input),
              HasSubstr("the truth has no pose 11"));

  world.truth = Graph();
  for (const Id id : {0, 10})
    world.truth.add_variable(registry.variable_type("VERTEX_XY"), id, std::array{0.0, 0.0});
  EXPECT_THAT(message_of([&] { simulated->match(0, 10); }, ErrorCode::input),
              AllOf(HasSubstr("VERTEX_XY 0"), HasSubstr("VERTEX_SE2")));
}

TEST_F(PlanarRegistrations, RecordedNeedsNoTruthButARecording) {
  const auto recorded = registry.make<Registration>("recorded");
  EXPECT_THAT(message_of([&] { recorded->begin({}); }, ErrorCode::usage),
              HasSubstr("needs the recording"));
  EXPECT_THROW(recorded->match(0, 10), std::logic_error);
  recorded->begin({.recording = &world.graph, .truth = nullptr});
  EXPECT_THAT(recorded->match(0, 10), SizeIs(1));
  recorded->begin({.recording = &world.truth, .truth = nullptr});
  EXPECT_THAT(recorded->match(0, 10), SizeIs(1));
}

TEST_F(PlanarRegistrations, PosesOfTwoTypesAreRefused) {
  Graph& graph = world.graph;
  const auto pose = registry.variable_type("VERTEX_SE3:QUAT");
  for (const Id id : {100, 101})
    graph.add_variable(pose, id, std::array{0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0});
  std::vector<double> information(21, 0.0);
  for (int row = 0, place = 0; row < 6; place += 6 - row, ++row) information[place] = 1.0;
  graph.add_factor(registry.factor_type("EDGE_SE3:QUAT"), std::array{6, 7},
                   std::array{0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0}, information);
  EXPECT_THAT(message_of([&] { make("recorded"); }, ErrorCode::input),
              AllOf(HasSubstr("VERTEX_SE2 and VERTEX_SE3:QUAT"), HasSubstr("EDGE_SE3:QUAT 100")));
}

TEST_F(PlanarRegistrations, OptionsOutOfRangeAreRefused) {
  for (const std::string rate : {"recorded:false_rate", "simulated:false_rate",
                                 "simulated:failure_rate", "simulated:far_rate"}) {
    for (const std::string value : {"-0.1", "1.1", "often"}) {
      EXPECT_THAT(message_of([&] { make(rate + "=" + value); }, ErrorCode::usage),
                  AllOf(HasSubstr("_rate"), HasSubstr("0 to 1")));
    }
    make(rate + "=0");
    make(rate + "=1");
  }
  for (const std::string spec : {"range=0", "angle=0", "angle=4", "sigma_translation=-1",
                                 "sigma_rotation=-1", "seed=-1", "seed=1.5"}) {
    const std::string name = spec.substr(0, spec.find('='));
    EXPECT_THAT(message_of([&] { make("simulated:" + spec); }, ErrorCode::usage),
                HasSubstr("'" + name + "'"));
  }
}

}  // namespace
}  // namespace cairn::test
