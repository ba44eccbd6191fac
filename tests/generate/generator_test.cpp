// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/io/generator.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/graph/gauge.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

Simulation simulate(Registry& registry, const std::string& spec, std::uint64_t seed = 7) {
  return registry.make<Generator>(spec)->generate(registry, seed);
}

/// FNV-1a over the bits of doubles.
class Checksum {
 public:
  void add(std::span<const double> values) {
    for (double value : values) {
      const auto bits = std::bit_cast<std::uint64_t>(value);
      for (int byte = 0; byte < 8; ++byte) {
        hash_ = (hash_ ^ (bits >> (8 * byte) & 0xff)) * 0x100000001b3u;
      }
    }
  }
  std::uint64_t value() const { return hash_; }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325u;
};

std::uint64_t checksum(const Simulation& simulation) {
  Checksum sum;
  for (const Graph* graph : {&simulation.graph, &simulation.truth}) {
    for (int v = 0; v < graph->variable_count(); ++v) sum.add(graph->state(v));
  }
  for (int f = 0; f < simulation.graph.factor_count(); ++f) {
    for (int v : simulation.graph.factor_variables(f)) sum.add(std::vector<double>{1.0 * v});
    sum.add(simulation.graph.measurement(f));
    sum.add(simulation.graph.information(f));
  }
  return sum.value();
}

struct Example {
  std::string spec;        // a small world of that kind
  std::uint64_t checksum;  // of seed 7
  std::string name() const { return spec.substr(0, spec.find(':')); }
  /// The spec with more options.
  std::string with(const std::string& options) const {
    return spec + (spec.find(':') == std::string::npos ? ":" : ",") + options;
  }
};
void PrintTo(const Example& example, std::ostream* out) { *out << example.spec; }

const std::vector<Example>& examples() {
  static const std::vector<Example> all = {
      {"manhattan:poses=400", 16080275264353915710u},
      {"city:poses=600", 11464288633209280911u},
      {"ring:poses=120,laps=1.2", 1195941897724609101u},
      {"landmarks2d:poses=300", 4606131115109802062u},
      {"landmarks2d:poses=300,sensor=bearing_range", 5801300894493470285u},
      {"sphere:turns=10,poses_per_turn=20", 3879260596104131331u},
      {"torus:turns=20,poses_per_turn=12", 12734335287268244742u},
      {"grid3d:nx=5,ny=6,nz=4", 14239248636458521189u},
      {"ellipse3d", 3515308168875887929u},
      {"ellipse_n:laps=2", 5238908639977323884u},
      {"bundle:cameras=12,points=300", 10826909149870899466u},
      {"bundle:cameras=12,points=300,layout=street", 13636413298935646212u},
  };
  return all;
}

class EveryGenerator : public testing::TestWithParam<Example> {
 protected:
  Registry registry;
};

std::string example_name(const testing::TestParamInfo<Example>& info) {
  std::string name = info.param.spec;
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return !std::isalnum(c); }, '_');
  return name;
}
INSTANTIATE_TEST_SUITE_P(Small, EveryGenerator, testing::ValuesIn(examples()), example_name);

TEST(Generators, AllOnOfferAreTestedHere) {
  Registry registry;
  std::vector<std::string> tested;
  for (const Example& example : examples()) tested.push_back(example.name());
  for (const std::string& name : registry.names("generator")) {
    EXPECT_THAT(tested, testing::Contains(name));
  }
}

// The promise that a seed gives the same graph on every machine: these numbers may only change with
// a change that says so to users.
TEST_P(EveryGenerator, GivesTheSameBitsOnEveryMachine) {
  EXPECT_EQ(checksum(simulate(registry, GetParam().spec)), GetParam().checksum);
}

TEST_P(EveryGenerator, GivesTheSameGraphForTheSameSeedAndAnotherForAnother) {
  const std::uint64_t first = checksum(simulate(registry, GetParam().spec, 1));
  EXPECT_EQ(checksum(simulate(registry, GetParam().spec, 1)), first);
  EXPECT_NE(checksum(simulate(registry, GetParam().spec, 2)), first);
}

TEST_P(EveryGenerator, HasNoErrorAtTheTruthWithoutNoise) {
  const Simulation simulation = simulate(registry, GetParam().with("noise=0"));
  const double n = simulation.truth.factor_count();
  EXPECT_LT(chi2(simulation.truth), 1e-18 * n);
  EXPECT_LT(chi2(simulation.graph), 1e-14 * n) << "odometry rounds on its way";
}

// Nothing is estimated at the truth: chi2 has as many degrees of freedom as there are residuals.
TEST_P(EveryGenerator, HasTheChi2OfItsNoiseAtTheTruth) {
  for (const char* options : {"noise=1", "noise=0.5"}) {
    const Simulation simulation = simulate(registry, GetParam().with(options));
    const auto n = static_cast<double>(simulation.truth.residual_size());
    EXPECT_NEAR(chi2(simulation.truth), n, 4.5 * std::sqrt(2.0 * n)) << options;
  }
}

TEST_P(EveryGenerator, TiesThePathTogether) {
  const Simulation simulation = simulate(registry, GetParam().spec);
  EXPECT_EQ(resolve_gauge(simulation.graph).components, 1);
  EXPECT_GT(simulation.graph.residual_size(), simulation.graph.tangent_size());
  EXPECT_GT(chi2(simulation.graph), 10.0 * chi2(simulation.truth))
      << "odometry should not close loops";
}

TEST_P(EveryGenerator, StartsAtTheTruthAndFollowsTheOdometry) {
  const Simulation simulation = simulate(registry, GetParam().spec);
  const auto start = simulation.graph.state(0), truth = simulation.truth.state(0);
  EXPECT_TRUE(std::equal(start.begin(), start.end(), truth.begin(), truth.end()));
  const std::vector<double> norms = squared_norms(simulation.graph);
  const std::vector<bool> loops = loop_closures(simulation.graph);
  int odometry = 0;
  for (int f = 0; f < simulation.graph.factor_count(); ++f) {
    const auto variables = simulation.graph.factor_variables(f);
    if (loops[f] || simulation.graph.pool(variables[0]) != simulation.graph.pool(variables[1]))
      continue;
    ++odometry;
    EXPECT_LT(norms[f], 1e-12) << simulation.graph.describe_factor(f);
  }
  const bool has_odometry = simulation.graph.factor_pools()[0].type->is_relative();
  EXPECT_GT(odometry, has_odometry ? 50 : -1) << "but for cameras, which have none";
}

TEST_P(EveryGenerator, ListsFactorsInTheOrderInWhichARobotMeetsThem) {
  const Simulation simulation = simulate(registry, GetParam().with("outliers=3"));
  const Graph& graph = simulation.graph;
  Id latest = 0;
  for (int f = 0; f < graph.factor_count(); ++f) {
    Id pose = 0;  // the latest pose that takes part
    for (int v : graph.factor_variables(f)) {
      if (graph.pool(v) == graph.pool(0)) pose = std::max(pose, graph.id(v));
    }
    EXPECT_GE(pose, latest);
    latest = pose;
  }
}

TEST_P(EveryGenerator, AddsAsManyWrongFactorsAsAskedFor) {
  const Simulation right = simulate(registry, GetParam().spec);
  const Simulation wrong = simulate(registry, GetParam().with("outliers=5"));
  EXPECT_EQ(wrong.graph.factor_count(), right.graph.factor_count() + 5);
  const std::vector<double> norms = squared_norms(wrong.truth);
  EXPECT_EQ(std::count_if(norms.begin(), norms.end(), [](double n) { return n > 100.0; }), 5);
}

TEST(Generators, TurningUpTheNoiseLeavesTheWorldAsItIs) {
  Registry registry;
  const Simulation quiet = simulate(registry, "manhattan:poses=300,noise=0.1");
  const Simulation loud = simulate(registry, "manhattan:poses=300,noise=3");
  ASSERT_EQ(quiet.graph.factor_count(), loud.graph.factor_count());
  EXPECT_EQ(quiet.truth.values().pools, loud.truth.values().pools);
}

TEST(Generators, LoopClosuresAreAsMuchNoisierThanOdometryAsAskedFor) {
  Registry registry;
  for (const char* kind : {"manhattan:poses=400", "ellipse_n:laps=2", "torus"}) {
    const Simulation same = simulate(registry, kind);
    const Simulation noisy = simulate(
        registry, std::string(kind) +
                      (std::string_view(kind).find(':') != std::string_view::npos ? "," : ":") +
                      "loop_noise=2");
    const auto n = static_cast<double>(noisy.truth.residual_size());
    EXPECT_NEAR(chi2(noisy.truth), n, 4.5 * std::sqrt(2.0 * n)) << kind;
    int loops = 0;
    for (int f = 0; f < same.graph.factor_count(); ++f) {
      const auto on = same.graph.factor_variables(f);
      const bool loop = std::abs(on[0] - on[1]) > 1;
      loops += loop;
      EXPECT_DOUBLE_EQ(same.graph.information(f)[0],
                       noisy.graph.information(f)[0] * (loop ? 4.0 : 1.0));
    }
    EXPECT_GT(loops, 20);
  }
}

TEST(Generators, ReproduceTheCountsOfWellKnownGraphs) {
  Registry registry;
  const Graph sphere = simulate(registry, "sphere").graph;  // sphere2500 of iSAM
  EXPECT_EQ(sphere.variable_count(), 2500);
  EXPECT_EQ(sphere.factor_count(), 4949);
  const Graph ring = simulate(registry, "ring").graph;  // ring of Vertigo
  EXPECT_EQ(ring.variable_count(), 434);
  EXPECT_EQ(ring.factor_count(), 459);
  const Graph grid = simulate(registry, "grid3d:nx=5,ny=6,nz=4,loop_density=1").graph;
  EXPECT_EQ(grid.factor_count(), 4 * 6 * 4 + 5 * 5 * 4 + 5 * 6 * 3) << "all edges of the lattice";
}

TEST(Generators, Ellipse3dHasThePosesAndLinksOfThePaper) {
  Registry registry;
  const Graph graph = simulate(registry, "ellipse3d").truth;
  EXPECT_EQ(graph.variable_count(), 170);
  const std::vector<bool> loops = loop_closures(graph);
  EXPECT_EQ(std::count(loops.begin(), loops.end(), true), 377);
  for (int f = 0; f < graph.factor_count(); ++f) {
    const auto z = graph.measurement(f);
    if (loops[f]) {
      EXPECT_LT(std::hypot(z[0], z[1], z[2]), 3.0 * 1.3);
      EXPECT_LT(2.0 * std::acos(std::min(1.0, z[6])), 0.2 * 1.3);
    }
  }
}

TEST(Generators, NumberTheirLoopsByTheDensity) {
  Registry registry;
  const auto loops = [&](const std::string& spec) {
    const Graph graph = simulate(registry, spec).graph;
    const std::vector<bool> closures = loop_closures(graph);
    return std::count(closures.begin(), closures.end(), true);
  };
  EXPECT_EQ(loops("manhattan:poses=500,loop_density=0"), 0);
  EXPECT_LT(loops("manhattan:poses=500,loop_density=0.1"),
            loops("manhattan:poses=500,loop_density=0.5"));
  EXPECT_EQ(loops("torus:turns=10,poses_per_turn=12,loop_density=1"), 120 - 12 + 12);
}

TEST(Generators, RefuseWrongLoopsWhereTheWorldIsTooSmall) {
  Registry registry;
  try {
    simulate(registry, "manhattan:poses=3,outliers=1");
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::usage);
    EXPECT_THAT(error.what(), testing::HasSubstr("outliers"));
  }
}

// A robot that passes the same streets thousands of times: the search must stay bounded a pose.
TEST(Generators, StayLinearWhereAllPosesAreCrowded) {
  Registry registry;
  const Graph graph = simulate(registry, "manhattan:poses=20000,streets=3").graph;
  EXPECT_EQ(graph.variable_count(), 20000);
  EXPECT_LE(graph.factor_count(), 4 * 20000);
}

}  // namespace
}  // namespace cairn
