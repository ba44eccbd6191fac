// SPDX-License-Identifier: BSD-3-Clause
// Updates that may take so much work each: what is left goes on in later ones.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <ostream>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "cairn/plugin/registry.hpp"
#include "counting_clock.hpp"
#include "engine.hpp"
#include "growing_graph.hpp"

namespace cairn::incremental {
namespace {

constexpr double kNothing = 1e-4;

struct Case {
  std::string name;
  bool spatial;
  double noise;
  int pieces;  ///< of an update
};

std::vector<Case> cases() {
  std::vector<Case> all;
  for (const bool spatial : {false, true}) {
    for (const double noise : {0.03, 0.5}) {
      for (const int pieces : {1, 7, 60}) {
        all.push_back({(spatial ? "InSpace" : "InThePlane") +
                           std::string(noise > 0.1 ? "BadOdometry" : "") + "By" +
                           std::to_string(pieces),
                       spatial, noise, pieces});
      }
    }
  }
  return all;
}

void PrintTo(const Case& of, std::ostream* out) { *out << of.name; }

/// A pose or a loop closure.
void grow(GrowingGraph& graph, Engine& engine, std::mt19937& rng) {
  if (engine.graph().variable_count() < 4 || rng() % 3 > 0) {
    graph.add_pose(engine);
  } else {
    graph.add_loop(engine);
  }
}

class EngineWithALimit : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    if (!registry_.has("optimizer", "levenberg_marquardt"))
      GTEST_SKIP() << "there is no optimizer levenberg_marquardt";
    rescuer_->optimizer = registry_.make<Optimizer>("levenberg_marquardt");
  }
  GrowingGraph graph(unsigned seed) const {
    return {
        GetParam().spatial ? spatial_types() : planar_types(), {.noise = GetParam().noise}, seed};
  }
  /// chi2 of the minimum next to the engine's estimate.
  double minimum(const Engine& engine) {
    Graph graph = engine.snapshot();
    return rescuer_->optimizer->optimize(graph, {.max_iterations = 200, .tolerance = 1e-12})
        .final_chi2;
  }

  Registry registry_;
  std::shared_ptr<Rescuer> rescuer_ = std::make_shared<Rescuer>();
};

TEST_P(EngineWithALimit, ComesToTheMinimumOnceItMayTakeItsTime) {
  for (unsigned seed = 1; seed <= 8; ++seed) {
    Engine engine({.accuracy = 0.0, .iterations = 100}, rescuer_);
    CountingClock clock;
    clock.drive(engine);
    GrowingGraph growing = graph(seed);
    std::mt19937 rng(seed);
    for (int step = 0; step < 60; ++step) {
      grow(growing, engine, rng);
      UpdateReport report;
      engine.solve(GetParam().pieces, report);
      ASSERT_TRUE(report.ok) << "seed " << seed << ", step " << step;
      if (engine.up_to_date()) continue;
      EXPECT_GT(report.owed, 0);
    }
    UpdateReport report;
    engine.solve(0.0, report);
    EXPECT_TRUE(engine.up_to_date());
    EXPECT_TRUE(report.ok);
    // Where measurements contradict each other much, Gauss-Newton may need more steps than it has.
    if (GetParam().noise > 0.1) {
      engine.solve_fully(report);
    } else {
      EXPECT_EQ(report.owed, 0);
    }
    const double least = minimum(engine);
    EXPECT_NEAR(engine.chi2(), least, 1e-6 * least + 1e-9) << "seed " << seed;
  }
}

TEST_P(EngineWithALimit, DoesNoMoreWorkInAnUpdateThanItMay) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    Engine engine({}, rescuer_);
    CountingClock clock;
    clock.drive(engine);
    GrowingGraph growing = graph(seed);
    std::mt19937 rng(seed);
    int left = 0;
    for (int step = 0; step < 80; ++step) {
      grow(growing, engine, rng);
      const double before = clock.reads;
      UpdateReport report;
      engine.solve(GetParam().pieces, report);
      // Each piece reads the clock before it; the update does once at its beginning, and once more
      // where it stops.
      EXPECT_LE(clock.reads - before, GetParam().pieces + 2)
          << "seed " << seed << ", step " << step;
      left += !engine.up_to_date();
    }
    if (GetParam().pieces == 1) {
      EXPECT_GT(left, 20);
    }
  }
}

TEST_P(EngineWithALimit, TheSameEstimateIsThereAsWithoutALimitOnceNothingIsOwed) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    Engine limited({.iterations = 10}, rescuer_);
    CountingClock clock;
    clock.drive(limited);
    GrowingGraph growing = graph(seed);
    std::mt19937 rng(seed);
    for (int step = 0; step < 40; ++step) {
      grow(growing, limited, rng);
      UpdateReport report;
      limited.solve(GetParam().pieces, report);
    }
    // Where measurements contradict each other much, a solution may need more iterations than it
    // has; the next update goes on.
    int owed = 1;
    for (int update = 0; update < 200000 && owed > 0; ++update) {
      UpdateReport report;
      limited.solve(GetParam().pieces, report);
      owed = report.owed;
      EXPECT_TRUE(limited.up_to_date() || owed > 0);
    }
    ASSERT_EQ(owed, 0) << "updates without anything new come to an end";
    EXPECT_TRUE(limited.up_to_date());
    EXPECT_LE(limited.chi2(), 1.01 * minimum(limited) + kNothing) << "seed " << seed;
  }
}

TEST_P(EngineWithALimit, WhileAJobIsNotDoneTheEstimateIsOneThatWasEvaluated) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    Engine engine({}, rescuer_);
    CountingClock clock;
    clock.drive(engine);
    GrowingGraph growing = graph(seed);
    std::mt19937 rng(seed);
    for (int step = 0; step < 25; ++step) {
      grow(growing, engine, rng);
      UpdateReport report;
      engine.solve(0.0, report);
    }
    growing.add_loop(engine);
    const double composed = engine.chi2();
    double least = composed;
    for (int update = 0; update < 20000 && !engine.up_to_date(); ++update) {
      UpdateReport report;
      engine.solve(GetParam().pieces, report);
      const double chi2 = engine.chi2();
      ASSERT_LE(chi2, composed * (1.0 + 1e-9) + 1e-9) << "seed " << seed << ", update " << update;
      least = std::min(least, chi2);
      // Settling rounds, reading does not.
      ASSERT_EQ(engine.chi2(), chi2);
    }
    EXPECT_LE(engine.chi2(), 1.01 * minimum(engine) + kNothing);
  }
}

TEST_P(EngineWithALimit, ACopyInTheMiddleOfAJobGoesOnAsTheOriginalDoes) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    Engine engine({}, rescuer_);
    CountingClock clock;
    clock.drive(engine);
    GrowingGraph growing = graph(seed);
    std::mt19937 rng(seed);
    int copies = 0;
    for (int step = 0; step < 60; ++step) {
      grow(growing, engine, rng);
      UpdateReport report;
      engine.solve(GetParam().pieces, report);
      if (!engine.busy()) continue;
      ++copies;
      const double read = engine.chi2();
      Engine copy(engine), other(engine);
      for (Engine* one : {&copy, &other}) one->solve(0.0, report);
      EXPECT_EQ(copy.chi2(), other.chi2());
      EXPECT_EQ(copy.problem().tree.log_determinant(), other.problem().tree.log_determinant());
      EXPECT_EQ(engine.chi2(), read) << "the original has not moved";
    }
    if (GetParam().pieces == 1) {
      EXPECT_GT(copies, 20);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Random, EngineWithALimit, testing::ValuesIn(cases()),
                         [](const auto& named) { return named.param.name; });

}  // namespace
}  // namespace cairn::incremental
