// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/solve/initial_guess.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numeric>
#include <random>
#include <string_view>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/graph/gauge.hpp"
#include "cairn/io/format.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "support/data.hpp"

namespace cairn {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::vector<std::string> guess(Registry& registry, const std::string& name, Graph& graph) {
  return registry.make<InitialGuess>(name)->compute(graph);
}

/// Gives every variable that the gauge does not hold some other state.
void scramble(Graph& graph, const std::vector<bool>& held) {
  std::mt19937 engine(3);
  std::uniform_real_distribution<> draw(-1.0, 1.0);
  for (int v = 0; v < graph.variable_count(); ++v) {
    if (held[v]) continue;
    std::vector<double> delta(graph.type(v).tangent_size()), x(graph.type(v).ambient_size());
    for (double& d : delta) d = draw(engine);
    const std::int64_t at = 0;
    graph.type(v).retract(1, graph.state(v).data(), &at, delta.data(), x.data());
    graph.set_state(v, x);
  }
}

/// The largest element of the tangent vector from one graph's states to another's.
double largest_difference(const Graph& a, const Graph& b) {
  double largest = 0.0;
  for (int v = 0; v < a.variable_count(); ++v) {
    std::vector<double> delta(a.type(v).tangent_size());
    a.type(v).local(1, a.state(v).data(), b.state(v).data(), delta.data());
    for (double d : delta) largest = std::max(largest, std::abs(d));
  }
  return largest;
}

const std::vector<std::string> kMethods = {
    "odometry", "spanning_tree",       "spanning_tree:weight=information", "incremental",
    "chordal",  "chordal:weight=unit", "chordal:linear_solver=eigen",      "auto"};
const std::vector<std::string> kWorlds = {
    "manhattan:poses=300",
    "city:poses=300",
    "ring:poses=100",
    "landmarks2d:poses=200",
    "landmarks2d:poses=200,sensor=bearing_range",
    "sphere:turns=8,poses_per_turn=16",
    "torus:turns=12,poses_per_turn=9",
    "grid3d:nx=4,ny=5,nz=3",
    "ellipse3d",
};

/// Every method of every world; the world's plugin and the method's parts may be missing in this
/// build.
class EveryGuess : public testing::TestWithParam<std::tuple<std::string, std::string>> {
 protected:
  void SetUp() override {
    const ComponentSpec method = parse_component(std::get<0>(GetParam()));
    const ComponentSpec world = parse_component(std::get<1>(GetParam()));
    if (!registry.has("generator", world.name)) GTEST_SKIP() << "no generator " << world.name;
    if (!registry.has("initial_guess", method.name)) GTEST_SKIP() << "no guess " << method.name;
    for (const char* part : {"linear_solver", "optimizer"}) {
      const OptionSpec* option = registry.options("initial_guess", method.name).find(part);
      if (!option) continue;
      const auto given = method.values.find(part);
      const std::string name = given == method.values.end() ? option->default_value : given->second;
      if (!registry.has(part, name)) GTEST_SKIP() << "no " << part << " " << name;
    }
  }
  Graph truth(const std::string& options = "noise=0") {
    return std::move(
        registry.make<Generator>(world() + separator() + options)->generate(registry, 1).truth);
  }
  std::string method() const { return std::get<0>(GetParam()); }
  std::string world() const { return std::get<1>(GetParam()); }

  Registry registry;

 private:
  std::string separator() const { return world().find(':') == std::string::npos ? ":" : ","; }
};

INSTANTIATE_TEST_SUITE_P(Worlds, EveryGuess,
                         testing::Combine(testing::ValuesIn(kMethods), testing::ValuesIn(kWorlds)),
                         [](const auto& guess_info) {
                           std::string name =
                               std::get<0>(guess_info.param) + "_" + std::get<1>(guess_info.param);
                           std::replace_if(
                               name.begin(), name.end(),
                               [](unsigned char c) { return !std::isalnum(c); }, '_');
                           return name;
                         });

TEST_P(EveryGuess, FindsTheTruthOfAGraphWithoutNoise) {
  const Graph wanted = truth();
  Graph graph = wanted.clone();
  scramble(graph, resolve_gauge(graph).held);
  ASSERT_GT(largest_difference(graph, wanted), 0.5);
  guess(registry, method(), graph);
  EXPECT_LT(largest_difference(graph, wanted), 1e-8);
}

TEST_P(EveryGuess, KeepsWhatIsFixedAndStartsFromThere) {
  const Graph wanted = truth();
  Graph graph = wanted.clone();
  const int middle = *graph.find(50);
  graph.set_fixed(middle);
  const std::vector<double> before(graph.state(middle).begin(), graph.state(middle).end());
  scramble(graph, resolve_gauge(graph).held);
  guess(registry, method(), graph);
  EXPECT_THAT(graph.state(middle), testing::ElementsAreArray(before));
  EXPECT_LT(largest_difference(graph, wanted), 1e-8);
}

TEST(InitialGuesses, AllOnOfferAreTestedHere) {
  Registry registry;
  for (const std::string& name : registry.names("initial_guess")) {
    if (name == "as_given") continue;
    EXPECT_THAT(kMethods, Contains(name));
  }
}

TEST(AsGiven, LeavesAllStatesAlone) {
  Registry registry;
  Graph graph =
      std::move(registry.make<Generator>("manhattan:poses=50")->generate(registry, 1).graph);
  const Values before = graph.values();
  EXPECT_THAT(guess(registry, "as_given", graph), IsEmpty());
  EXPECT_EQ(graph.values().pools, before.pools);
}

TEST(Odometry, GivesTheEstimateOfARobotThatCountsItsSteps) {
  Registry registry;
  const Simulation simulation =
      registry.make<Generator>("manhattan:poses=200")->generate(registry, 1);
  Graph graph = simulation.truth.clone();
  EXPECT_THAT(guess(registry, "odometry", graph), IsEmpty());
  EXPECT_LT(largest_difference(graph, simulation.graph), 1e-10);
}

/// Planar poses at the given positions, all looking along x, in states that are wrong.
class Planar : public testing::Test {
 protected:
  int pose(Id id, std::array<double, 3> state = {9.0, 9.0, 1.0}) {
    return graph.add_variable(registry.variable_type("VERTEX_SE2"), id, state);
  }
  int landmark(Id id) {
    return graph.add_variable(registry.variable_type("VERTEX_XY"), id,
                              std::array<double, 2>{9.0, 9.0});
  }
  void link(int a, int b, std::array<double, 3> z, double weight = 1.0) {
    const std::array<double, 6> information{weight, 0, 0, weight, 0, weight};
    graph.add_factor(registry.factor_type("EDGE_SE2"), std::array<int, 2>{a, b}, z, information);
  }
  void sight(int pose, int landmark, std::array<double, 2> z) {
    graph.add_factor(registry.factor_type("EDGE_SE2_XY"), std::array<int, 2>{pose, landmark}, z,
                     std::array<double, 3>{1, 0, 1});
  }
  /// `weight`: the information of x, y and theta; 0 for what is not measured.
  void link_in_part(int a, int b, std::array<double, 3> z, std::array<double, 3> weight) {
    const std::array<double, 6> information{weight[0], 0, 0, weight[1], 0, weight[2]};
    graph.add_factor(registry.factor_type("EDGE_SE2"), std::array<int, 2>{a, b}, z, information);
  }
  void prior(int pose, std::array<double, 3> z, double heading = 1.0) {
    graph.add_factor(registry.factor_type("EDGE_PRIOR_SE2"), std::array<int, 1>{pose}, z,
                     std::array<double, 6>{1, 0, 0, 1, 0, heading});
  }
  std::array<double, 3> at(int pose) const {
    const auto x = graph.state(pose);
    return {x[0], x[1], x[2]};
  }
  void expect_at(int pose, std::array<double, 3> state) const {
    for (int k = 0; k < 3; ++k)
      EXPECT_NEAR(at(pose)[k], state[k], 1e-12) << graph.describe_variable(pose);
  }

  Registry registry;
  Graph graph;
};

TEST_F(Planar, OdometryTakesAnotherFactorWhereTheChainIsBrokenAndSaysSo) {
  const int a = pose(0, {0, 0, 0}), b = pose(1), c = pose(2), d = pose(3);
  link(a, b, {1, 0, 0});
  link(a, c, {0, 5, 0});
  link(c, d, {1, 0, 0});
  const auto notes = guess(registry, "odometry", graph);
  expect_at(b, {1, 0, 0});
  expect_at(c, {0, 5, 0});
  expect_at(d, {1, 5, 0});
  EXPECT_THAT(notes,
              ElementsAre(AllOf(HasSubstr("1 pose has no factor"), HasSubstr("VERTEX_SE2 2"))));
}

TEST_F(Planar, OdometryPrefersThePredecessorToALoopClosure) {
  const int a = pose(0, {0, 0, 0}), b = pose(1), c = pose(2);
  link(a, c, {0, 7, 0});
  link(c, b, {-1, 0, 0});  // backwards
  link(a, b, {1, 0, 0});
  guess(registry, "odometry", graph);
  expect_at(c, {2, 0, 0});
}

TEST_F(Planar, SpanningTreeTakesTheShortestOrTheMostCertainWay) {
  const int a = pose(0, {0, 0, 0}), b = pose(1), c = pose(2);
  link(a, b, {1, 0, 0}, 100.0);
  link(b, c, {1, 0, 0}, 100.0);
  link(a, c, {0, 7, 0}, 1.0);
  guess(registry, "spanning_tree", graph);
  expect_at(c, {0, 7, 0});
  guess(registry, "spanning_tree:weight=information", graph);
  expect_at(c, {2, 0, 0});
}

TEST_F(Planar, APriorSaysWhereToStart) {
  const int a = pose(0), b = pose(1), c = pose(2);
  link(a, b, {1, 0, 0});
  link(b, c, {1, 0, 0});
  prior(b, {3, 4, 0});
  for (const char* name : {"odometry", "spanning_tree", "chordal"}) {
    guess(registry, name, graph);
    expect_at(a, {2, 4, 0});
    expect_at(b, {3, 4, 0});
    expect_at(c, {4, 4, 0});
  }
}

/// A number without information is none: whatever stands there, nothing is placed by it.
TEST_F(Planar, AComponentWithoutInformationPlacesNothing) {
  const int a = pose(0, {0, 0, 0}), b = pose(1), c = pose(2), d = pose(3);
  link(a, b, {1, 0, 0.5});
  // As matching along a corridor has it: nothing along the axis of the pose that is seen.
  link_in_part(b, c, {77 * std::cos(0.5), 77 * std::sin(0.5), 0.5}, {0, 1, 1});
  link(c, d, {1, 0, 0});
  for (const char* name : {"odometry", "spanning_tree", "spanning_tree:weight=information",
                           "incremental", "chordal"}) {
    SCOPED_TRACE(name);
    const auto notes = guess(registry, name, graph);
    const double x = 1, y = 0;  // c is where b is, but turned
    const double tolerance = std::string_view(name) == "chordal" ? 1e-6 : 1e-9;
    EXPECT_NEAR(at(c)[0], x, tolerance);
    EXPECT_NEAR(at(c)[1], y, tolerance);
    EXPECT_NEAR(at(c)[2], 1.0, 1e-9);
    EXPECT_NEAR(at(d)[0], x + std::cos(1.0), tolerance);
    EXPECT_NEAR(at(d)[1], y + std::sin(1.0), tolerance);
    if (std::string_view(name).starts_with("spanning_tree") ||
        std::string_view(name) == "odometry") {
      EXPECT_THAT(notes, Contains(AllOf(HasSubstr("1 variable is placed by a measurement without"),
                                        HasSubstr("VERTEX_SE2 2"))));
    }
  }
}

TEST_F(Planar, AnEdgeWithoutOrientationGoesAroundWhereOthersLead) {
  const int a = pose(0, {0, 0, 0}), b = pose(1), c = pose(2);
  link_in_part(a, b, {1, 0, 2.5}, {1, 1, 0});
  link(a, c, {1, 1, 0});
  link(c, b, {0, -1, 0.5});
  for (const char* name :
       {"odometry", "spanning_tree", "spanning_tree:weight=information", "chordal"}) {
    SCOPED_TRACE(name);
    guess(registry, name, graph);
    expect_at(b, {1, 0, 0.5});
    expect_at(c, {1, 1, 0});
  }
}

TEST_F(Planar, APositionAloneSetsNoHeading) {
  const int a = pose(0, {3, 4, 0.5}), b = pose(1);
  link(a, b, {1, 0, 0});
  prior(a, {30, 40, 2.0}, 0.0);
  for (const char* name : {"odometry", "spanning_tree", "chordal"}) {
    SCOPED_TRACE(name);
    guess(registry, name, graph);
    expect_at(a, {30, 40, 0.5});
    expect_at(b, {30 + std::cos(0.5), 40 + std::sin(0.5), 0.5});
  }
}

TEST_F(Planar, EachComponentStartsFromItsOwnFirstPose) {
  const int a = pose(0, {0, 0, 0}), b = pose(1), c = pose(2, {0, 50, 0}), d = pose(3);
  link(a, b, {1, 0, 0});
  link(c, d, {1, 0, 0});
  for (const char* name : {"odometry", "spanning_tree", "chordal"}) {
    guess(registry, name, graph);
    expect_at(b, {1, 0, 0});
    expect_at(d, {1, 50, 0});
  }
}

TEST_F(Planar, WhatNoFactorDeterminesKeepsItsStateAndIsNamed) {
  const int a = pose(0, {0, 0, 0}), b = pose(1), c = pose(2, {0, 50, 0}), d = pose(3),
            l = landmark(9);
  link(a, b, {1, 0, 0});
  link(c, d, {1, 0, 0});
  sight(b, l, {0, 2});
  sight(c, l, {3, 3});  // one landmark does not say where c is
  for (const char* name : {"odometry", "spanning_tree", "chordal"}) {
    const auto notes = guess(registry, name, graph);
    expect_at(c, {0, 50, 0});
    expect_at(d, {1, 50, 0});
    EXPECT_THAT(notes, Contains(HasSubstr("VERTEX_SE2 2"))) << name;
  }
}

TEST_F(Planar, ChordalPlacesLandmarksWithThePositions) {
  const int a = pose(0, {0, 0, 0}), b = pose(1), l = landmark(9);
  link(a, b, {1, 0, 0});
  sight(a, l, {0, 2});
  sight(b, l, {-1, 4});
  const auto notes = guess(registry, "chordal", graph);
  EXPECT_THAT(notes, IsEmpty());
  // Landmarks share in the positions: three unit springs between (0, 2) and (b.x - 1, b.y + 4).
  expect_at(b, {1, -2.0 / 3.0, 0});
  EXPECT_NEAR(graph.state(l)[0], 0.0, 1e-12);
  EXPECT_NEAR(graph.state(l)[1], 2.0 + 2.0 / 3.0, 1e-12);
}

TEST_F(Planar, ChordalSolvesASmallLoopAsWorkedOutByHand) {
  // Three poses turned by 0.1, 0.1 and, back over the loop, by -0.5: the plane's rotations are
  // complex numbers r, and the relaxation is |r1 - r0 w|² + |r2 - r1 w|² + |r0 - r2 v|², linear in
  // r1 and r2.
  const int a = pose(0, {0, 0, 0}), b = pose(1), c = pose(2);
  link(a, b, {1, 0, 0.1});
  link(b, c, {1, 0, 0.1});
  link(c, a, {-2, 0, -0.5});
  guess(registry, "chordal", graph);
  using C = std::complex<double>;
  const C w = std::polar(1.0, 0.1), v = std::polar(1.0, -0.5);
  // Normal equations: 2 r1 - conj(w) r2 = w, -w r1 + 2 r2 = conj(v).
  const C r1 = (2.0 * w + std::conj(w) * std::conj(v)) / 3.0,
          r2 = (2.0 * std::conj(v) + w * w) / 3.0;
  EXPECT_NEAR(at(b)[2], std::arg(r1), 1e-12);
  EXPECT_NEAR(at(c)[2], std::arg(r2), 1e-12);
  // Given the orientations the positions are the least-squares ones: no small move lowers their
  // errors.
  const auto translation_errors = [&] {
    double sum = 0.0;
    const auto add = [&](int i, int j, double zx) {
      const auto x = at(i), y = at(j);
      sum += std::pow(y[0] - x[0] - std::cos(x[2]) * zx, 2) +
             std::pow(y[1] - x[1] - std::sin(x[2]) * zx, 2);
    };
    add(a, b, 1), add(b, c, 1), add(c, a, -2);
    return sum;
  };
  const double least = translation_errors();
  for (int pose : {b, c}) {
    for (int axis : {0, 1}) {
      for (double step : {1e-3, -1e-3}) {
        const auto kept = at(pose);
        auto x = kept;
        x[axis] += step;
        graph.set_state(pose, x);
        EXPECT_GT(translation_errors(), least);
        graph.set_state(pose, kept);
      }
    }
  }
}

TEST(Chordal, IsFarBetterThanOdometryOnANoisySphere) {
  Registry registry;
  const Simulation simulation =
      registry.make<Generator>("sphere:turns=20,poses_per_turn=20,rotation_sigma=0.1")
          ->generate(registry, 1);
  Graph odometry = simulation.graph.clone(), chordal = simulation.graph.clone();
  guess(registry, "odometry", odometry);
  guess(registry, "chordal", chordal);
  const auto dof =
      static_cast<double>(simulation.graph.residual_size() - simulation.graph.tangent_size());
  EXPECT_LT(chi2(chordal), 20.0 * dof);
  EXPECT_GT(chi2(odometry), 50.0 * chi2(chordal));
}

TEST(Chordal, DoesNotDependOnTheStatesItReplaces) {
  Registry registry;
  Graph graph = std::move(
      registry.make<Generator>("torus:turns=12,poses_per_turn=9")->generate(registry, 1).graph);
  Graph scrambled = graph.clone();
  scramble(scrambled, resolve_gauge(graph).held);
  guess(registry, "chordal", graph);
  guess(registry, "chordal", scrambled);
  EXPECT_EQ(graph.values().pools, scrambled.values().pools);
}

// The world's origin may be far away (UTM): a long chain keeps its digits.
TEST(Chordal, DoesNotDependOnWhereTheWorldsOriginIs) {
  Registry registry;
  for (const char* world : {"manhattan:poses=1000", "sphere:turns=20,poses_per_turn=20"}) {
    Graph graph = std::move(registry.make<Generator>(world)->generate(registry, 1).graph);
    Graph far = graph.clone();
    const double offset = 0x1p22;
    for (int v = 0; v < far.variable_count(); ++v) {
      std::vector<double> x(far.state(v).begin(), far.state(v).end());
      x[0] += offset;
      x[1] -= offset;
      far.set_state(v, x);
    }
    guess(registry, "chordal", graph);
    guess(registry, "chordal", far);
    for (int v = 0; v < graph.variable_count(); ++v) {
      EXPECT_NEAR(far.state(v)[0] - offset, graph.state(v)[0], 1e-8) << world << ' ' << v;
      EXPECT_NEAR(far.state(v)[1] + offset, graph.state(v)[1], 1e-8) << world << ' ' << v;
    }
  }
}

// Each piece of a graph has an origin of its own.
TEST(Chordal, DoesNotDependOnWhereOtherPiecesAre) {
  Registry registry;
  const Graph chain =
      std::move(registry.make<Generator>("manhattan:poses=300")->generate(registry, 1).graph);
  const double far = 1e9;
  for (const bool pair_first : {false, true}) {
    Graph graph;
    const auto type = chain.variable_pools()[0].type;
    const auto add_pair = [&] {
      const double a[] = {far, far, 0.0}, b[] = {far + 1.0, far, 0.0}, z[] = {1.0, 0.0, 0.0};
      const int poses[] = {graph.add_variable(type, 10'000, a),
                           graph.add_variable(type, 10'001, b)};
      graph.add_factor(chain.factor_pools()[0].type, poses, z,
                       std::vector{1.0, 0.0, 0.0, 1.0, 0.0, 1.0});
    };
    if (pair_first) add_pair();
    std::vector<int> number;
    for (int v = 0; v < chain.variable_count(); ++v)
      number.push_back(graph.add_variable(type, chain.id(v), chain.state(v)));
    for (int f = 0; f < chain.factor_count(); ++f) {
      std::vector<int> variables;
      for (const int v : chain.factor_variables(f)) variables.push_back(number[v]);
      graph.add_factor(chain.factor_pools()[0].type, variables, chain.measurement(f),
                       chain.information(f));
    }
    if (!pair_first) add_pair();
    Graph alone = chain.clone();
    guess(registry, "chordal", graph);
    guess(registry, "chordal", alone);
    for (int v = 0; v < chain.variable_count(); ++v) {
      EXPECT_NEAR(graph.state(number[v])[0], alone.state(v)[0], 1e-9) << pair_first << ' ' << v;
      EXPECT_NEAR(graph.state(number[v])[1], alone.state(v)[1], 1e-9) << pair_first << ' ' << v;
    }
  }
}

// M3500a: extra noise of 0.1 rad on every orientation; from odometry optimizers stop in local
// minima.
TEST(Chordal, StartsNearTheOptimumOfM3500a) {
  CAIRN_NEEDS_DATA();
  Registry registry;
  Graph graph = read_graph(test::data_folder() / "pose2d/M3500a.graph", registry);
  guess(registry, "odometry", graph);
  EXPECT_GT(chi2(graph), 1e7);
  guess(registry, "chordal", graph);
  EXPECT_LT(chi2(graph), 2.5 * 912.115);
}

// 402 of its consecutive pairs of poses have no factor.
TEST(Odometry, GetsOverTheGapsOfCubicle) {
  CAIRN_NEEDS_DATA();
  Registry registry;
  ReadOptions options;
  options.repair_information = true;
  ReadReport report;
  Graph graph = read_graph(test::data_folder() / "pose3d/cubicle.g2o", registry, options, report);
  EXPECT_THAT(guess(registry, "odometry", graph), ElementsAre(HasSubstr("402 poses")));
}

}  // namespace
}  // namespace cairn
