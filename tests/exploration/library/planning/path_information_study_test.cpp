// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <ctime>
#include <iostream>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "cairn/planning/path_information.hpp"
#include "path_graphs.hpp"

namespace cairn {
namespace {

using State = PathInformation::State;

/// Of the processor.
double seconds_since(std::clock_t begin) {
  return static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
}

/// What one way to value loops made of many paths.
struct Tally {
  std::vector<double> errors;  ///< of the change of (5.13) [nats]
  double change = 0.0;         ///< Σ |change| by full inference [nats]
  double path_seconds = 0.0, full_seconds = 0.0;
  int loops = 0, motions = 0;

  double quantile(double q) {
    std::ranges::sort(errors);
    return errors[static_cast<std::size_t>(q * static_cast<double>(errors.size() - 1))];
  }
};

/// Paths with at least one loop from a graph, until there are `most` of them.
void add_paths(LoopForm loops, const test::PathGraph& graph, double side, std::uint64_t seed,
               std::size_t most, Tally& tally) {
  PathInformation information(graph.situation(), {.loops = loops, .entropy = EntropyForm::thesis});
  RandomNumbers random(seed);
  for (int tries = 0; tally.errors.size() < most && tries < 1000; ++tries) {
    const auto count = 20 + random.below(40);
    const std::vector<Pose2> motions =
        test::random_motions(graph.pose, static_cast<int>(count), side, random);
    // Once before the clock starts: columns of the covariance are taken once per decision.
    if (information.extended(information.start(), motions).loops() == 0) continue;
    std::clock_t begin = std::clock();
    const State end = information.extended(information.start(), motions);
    tally.path_seconds += seconds_since(begin);
    begin = std::clock();
    const test::FullInference full = test::infer(graph, end);
    tally.full_seconds += seconds_since(begin);
    tally.errors.push_back(std::abs(end.trajectory_change() - full.trajectory_entropy));
    tally.change += std::abs(full.trajectory_entropy);
    tally.loops += end.loops();
    tally.motions += end.steps();
  }
}

/// 1,000 random paths with loops, valued exactly and by the thesis's (5.16), against an estimator
/// that has their poses and loop closures.
TEST(PathInformationStudy, ExactLoopsAndThoseOfTheThesisAgainstFullInference) {
  constexpr std::size_t kPaths = 1000, kGraphs = 10;
  constexpr double kSide = 8.0;
  Tally exact, thesis;
  for (std::size_t g = 0; g < kGraphs; ++g) {
    const test::PathGraph graph = test::wandering(60, kSide, 20 + g);
    const std::size_t most = (g + 1) * kPaths / kGraphs;
    add_paths(LoopForm::exact, graph, kSide, g, most, exact);
    add_paths(LoopForm::thesis, graph, kSide, g, most, thesis);
  }
  for (auto& [name, tally] : {std::pair<const char*, Tally&>{"exact", exact}, {"(5.16)", thesis}}) {
    const auto n = static_cast<double>(tally.errors.size());
    std::cout << fmt::format(
        "{:7} {} paths, {:.1f} motions and {:.2f} loops each; |change| {:.3f}, error median "
        "{:.2g}, "
        "95 % {:.2g}, max {:.2g} nats; {:.1f} us per path, full inference {:.0f} us\n",
        name, tally.errors.size(), tally.motions / n, tally.loops / n, tally.change / n,
        tally.quantile(0.5), tally.quantile(0.95), tally.quantile(1.0),
        1e6 * tally.path_seconds / n, 1e6 * tally.full_seconds / n);
  }
  ASSERT_EQ(exact.errors.size(), kPaths);
  ASSERT_EQ(thesis.errors.size(), kPaths);
  EXPECT_LT(exact.quantile(1.0), 1e-7);
  EXPECT_GT(thesis.quantile(0.5), 1e-3);
}

}  // namespace
}  // namespace cairn
