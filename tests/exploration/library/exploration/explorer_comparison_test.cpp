// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/explorer_comparison.hpp"

#include <array>
#include <cmath>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/exploration/exploration_measures.hpp"

namespace cairn {
namespace {

TEST(ExplorationMeasures, HaveNamesOfTheirOwn) {
  std::set<std::string_view> names;
  for (const ResultField& measure : exploration_measures())
    EXPECT_TRUE(names.insert(measure.name).second) << measure.name;
  EXPECT_EQ(names.size() * sizeof(double), sizeof(ExplorationMeasures));
}

TEST(ExplorationMeasures, EntropyOfAnotherAreaCountsUnknownCells) {
  // A map of 10 m², 4 of them known for certain, within a floor of 100 m².
  const double entropy = 6.0 * std::numbers::ln2;
  EXPECT_NEAR(entropy_of_area(entropy, 10.0, 100.0), 96.0 * std::numbers::ln2, 1e-12);
  EXPECT_NEAR(entropy_of_area(entropy, 10.0, 4.0), 0.0, 1e-12);
}

TEST(Quantile, IsTheSmallestThatSoManyDoNotExceed) {
  const std::vector<double> values{5.0, 1.0, 4.0, 2.0, 3.0};
  EXPECT_EQ(quantile(values, 0.5), 3.0);
  EXPECT_EQ(quantile(values, 0.95), 5.0);
  EXPECT_EQ(quantile(values, 0.0), 1.0);
  EXPECT_EQ(quantile({}, 0.5), 0.0);
}

/// A run whose map has errors of `slope` times its coverage, up to `reach`.
ComparedRun run_of(std::size_t explorer, std::uint64_t seed, double slope, double reach) {
  ComparedRun run;
  run.explorer = explorer;
  run.seed = seed;
  run.done = true;
  run.measures.coverage = reach;
  for (const double part : {0.2, 0.6, 1.0}) {
    const double coverage = part * reach;
    run.samples.push_back({.distance = 10.0 * part,
                           .coverage = coverage,
                           .error = slope * coverage,
                           .against = MapTruth{.floor = 200.0,
                                               .seen = 0.5 * coverage,
                                               .free_wrong = slope * coverage,
                                               .occupied_wrong = slope * coverage}});
  }
  return run;
}

TEST(DifferenceAtEqualCoverage, IsTakenWhereBothRunsHaveBeen) {
  const std::vector<ComparedRun> runs{run_of(0, 1, 0.2, 100.0), run_of(1, 1, 0.1, 150.0),
                                      run_of(0, 2, 0.2, 80.0), run_of(1, 2, 0.1, 60.0)};
  // At 100 m² 20 and 10, at 60 m² 12 and 6.
  const MeanInterval difference =
      difference_at_equal_coverage(runs, 1, 0, MapQuality::contradicted);
  EXPECT_EQ(difference.count, 2);
  EXPECT_NEAR(difference.mean, -8.0, 1e-12);
  // Of both kinds of wrong cells there are as many.
  EXPECT_NEAR(difference_at_equal_coverage(runs, 1, 0, MapQuality::wrong).mean, -16.0, 1e-12);
  // A run that is not done has no partner.
  std::vector<ComparedRun> fewer = runs;
  fewer[3].done = false;
  EXPECT_EQ(difference_at_equal_coverage(fewer, 1, 0, MapQuality::contradicted).count, 1);
  EXPECT_TRUE(std::isnan(values_of(fewer, 1, 3)[1]));
}

TEST(OverDistance, MapEntropyIsThatOfTheFloorsGrid) {
  ComparedRun run;
  for (const auto& [distance, entropy, area] : {std::array{0.0, 5.0, 20.0}, {0.4, 9.0, 30.0}}) {
    ExplorationStep step;
    step.step = static_cast<int>(run.steps.size());
    step.distance = distance;
    step.map_entropy = entropy;
    step.grid_area = area;
    run.steps.push_back(step);
  }
  const RunCurve curve = over_distance(run, StepQuantity::map_entropy, 50.0);
  EXPECT_EQ(curve.x, (std::vector{0.0, 0.4}));
  EXPECT_NEAR(curve.y[0], 5.0 + 30.0 * std::numbers::ln2, 1e-12);
  EXPECT_NEAR(curve.y[1], 9.0 + 20.0 * std::numbers::ln2, 1e-12);
  EXPECT_EQ(over_motions(run, StepQuantity::coverage, 50.0).x, (std::vector{0.0, 1.0}));
}

}  // namespace
}  // namespace cairn
