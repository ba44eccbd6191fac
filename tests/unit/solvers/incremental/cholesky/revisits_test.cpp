// SPDX-License-Identifier: BSD-3-Clause
// Runs of observations of earlier poses, and what the engine does before they go on.
#include "revisits.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <vector>

#include "cairn/plugin/registry.hpp"
#include "counting_clock.hpp"
#include "engine.hpp"
#include "growing_graph.hpp"

namespace cairn::incremental {
namespace {

/// What is noted in one update.
std::vector<Revisits::Run> update(Revisits& revisits, std::int64_t time,
                                  std::initializer_list<std::int32_t> variables) {
  for (const std::int32_t v : variables) revisits.note(v);
  const auto runs = revisits.at(time);
  return {runs.begin(), runs.end()};
}

TEST(Revisits, ARunIsExpectedToGoOnForHalfAsLongAsItHasLasted) {
  for (const std::int32_t direction : {1, -1}) {
    Revisits revisits;
    for (std::int32_t k = 0; k <= 60; ++k) {
      const auto runs = update(revisits, k, {100 + direction * k});
      ASSERT_EQ(runs.size(), 1U);
      EXPECT_EQ(runs[0].variable, 100 + direction * k);
      EXPECT_EQ(runs[0].length, k);
      EXPECT_EQ(runs[0].direction, k == 0 ? 0 : direction);
      const std::int32_t expected = k < 4 ? 0 : k < 40 ? k / 2 : 20;
      EXPECT_EQ(runs[0].expected(), expected) << k;
    }
  }
}

TEST(Revisits, ARunBearsSmallGapsAndShortPauses) {
  Revisits revisits;
  std::int64_t time = 0;
  std::int32_t v = 0;
  for (int k = 0; k < 5; ++k) update(revisits, time += 3, {v += 2});
  EXPECT_EQ(update(revisits, time += 1, {v += 1}).at(0).length, 5);
  EXPECT_EQ(update(revisits, time += 1, {v + 3}).at(0).length, 0);
  EXPECT_EQ(update(revisits, time += 1, {v + 1}).at(0).length, 6);
  EXPECT_EQ(update(revisits, time += 4, {v + 2}).at(0).length, 0);
}

TEST(Revisits, ATurnBeginsANewRun) {
  Revisits revisits;
  for (std::int32_t k = 0; k < 9; ++k) update(revisits, k, {k});
  EXPECT_EQ(update(revisits, 9, {7}).at(0).length, 1);
  EXPECT_EQ(update(revisits, 10, {6}).at(0).length, 2);
  EXPECT_TRUE(update(revisits, 11, {}).empty());
}

TEST(Revisits, RunsSideBySideAreFollowed) {
  Revisits revisits;
  for (std::int32_t k = 0; k < 9; ++k) {
    const auto runs = update(revisits, k, {100 - k, 50, 200 + k, 100 - k});
    ASSERT_EQ(runs.size(), 3U);
    EXPECT_EQ(runs[0].length, k);
    EXPECT_EQ(runs[1].length, k);
    EXPECT_EQ(runs[2].length, 0);  // of 50
  }
  revisits.clear();
  EXPECT_TRUE(revisits.at(9).empty());
}

TEST(Revisits, OfManyTheLongestAreFollowed) {
  Revisits revisits;
  for (std::int32_t k = 0; k < 9; ++k) {
    for (std::int32_t other = 0; other < 1000; ++other) revisits.note(10 * other + 3000 * (k % 2));
    const auto runs = update(revisits, k, {50000 - k, 60000 + 2 * k});
    ASSERT_EQ(std::ssize(runs), Revisits::kMostRuns);
    EXPECT_EQ(runs[0].length, k);
    EXPECT_EQ(runs[1].length, k);
  }
}

TEST(Revisits, AskedTwiceTheAnswerIsTheSame) {
  Revisits revisits;
  for (std::int32_t k = 0; k < 9; ++k) update(revisits, k, {k});
  const auto again = update(revisits, 8, {});
  ASSERT_EQ(again.size(), 1U);
  EXPECT_EQ(again[0].length, 8);
}

TEST(Revisits, RemembersHowFarItWasPreparedFor) {
  for (const std::int32_t direction : {1, -1}) {
    Revisits revisits;
    for (std::int32_t k = 0; k < 9; ++k)
      EXPECT_FALSE(update(revisits, k, {100 + direction * k}).at(0).was_prepared()) << k;
    Revisits::Run& run = revisits.at(8)[0];
    run.prepared_to = 100 + direction * 10;
    run.prepared_at = 8;
    EXPECT_FALSE(run.was_prepared()) << "at the same time";
    EXPECT_TRUE(update(revisits, 9, {100 + direction * 9}).at(0).was_prepared());
    EXPECT_TRUE(update(revisits, 10, {100 + direction * 10}).at(0).was_prepared());
    EXPECT_FALSE(update(revisits, 11, {100 + direction * 11}).at(0).was_prepared());
  }
}

class EngineThatComesAlongAgain : public testing::Test {
 protected:
  void SetUp() override {
    if (!registry_.has("optimizer", "levenberg_marquardt"))
      GTEST_SKIP() << "there is no optimizer levenberg_marquardt";
    rescuer_->optimizer = registry_.make<Optimizer>("levenberg_marquardt");
  }
  double minimum(const Engine& engine) {
    Graph graph = engine.snapshot();
    return rescuer_->optimizer->optimize(graph, {.max_iterations = 200, .tolerance = 1e-12})
        .final_chi2;
  }
  /// The next pose of a robot that goes round and round, joined with that of the round before.
  static void go_round(GrowingGraph& graph, Engine& engine, std::size_t round) {
    graph.add_pose(engine);
    graph.add_loop_back(engine, round);
  }
  /// The same; but in the last third of every 150 steps it goes back the way it has come.
  static void go_there_and_back(GrowingGraph& graph, Engine& engine, int step, std::size_t round) {
    const std::size_t back = static_cast<std::size_t>(std::max(0, step % 150 - 100));
    go_round(graph, engine, round + 2 * back);
  }
  /// What has been prepared has come from something, and has lost nothing.
  static void expect_prepared(const Engine& engine) {
    EXPECT_GT(engine.prepared(), 10);
    EXPECT_EQ(engine.problem().tree.unsettled(), 0);
  }

  Registry registry_;
  std::shared_ptr<Rescuer> rescuer_ = std::make_shared<Rescuer>();
};

TEST_F(EngineThatComesAlongAgain, MostUpdatesReachFewVariables) {
  Engine engine({}, rescuer_);
  GrowingGraph graph(spatial_types(), {.noise = 0.003}, 1);
  int many = 0;
  for (int step = 0; step < 400; ++step) {
    go_round(graph, engine, 70);
    UpdateReport report;
    engine.solve(0.0, report);
    if (step >= 300) many += report.affected_variables > 50;
  }
  // 8; where nothing is expected 26.
  EXPECT_LT(many, 16);
  expect_prepared(engine);
}

TEST_F(EngineThatComesAlongAgain, AlsoOnTheWayBack) {
  Engine engine({.prepares_above = 0.0}, rescuer_);
  GrowingGraph graph(spatial_types(), {.noise = 0.003}, 5);
  std::int64_t before = 0;
  for (int step = 0; step < 150; ++step) {
    go_there_and_back(graph, engine, step, 40);
    UpdateReport report;
    engine.solve(0.0, report);
    if (step == 110) before = engine.prepared();
  }
  EXPECT_GT(engine.prepared(), before + 5);
  expect_prepared(engine);
}

TEST_F(EngineThatComesAlongAgain, TheEstimateStaysAsAccurateAsItIsAskedToBe) {
  for (const bool cuts : {false, true}) {
    Engine engine({.prepares_above = 0.0}, rescuer_);
    GrowingGraph graph(spatial_types(), {.cuts = cuts, .priors = !cuts}, 2);
    for (int step = 0; step < 300; ++step) {
      if (step % 23 == 22) graph.grow(engine);
      go_there_and_back(graph, engine, step, 30);
      UpdateReport report;
      engine.solve(0.0, report);
      ASSERT_TRUE(report.ok) << step;
      if (step % 7 != 0) continue;
      Engine copy(engine);
      EXPECT_LE(copy.chi2(), 1.01 * minimum(copy) + 1e-4) << step;
    }
    expect_prepared(engine);
  }
}

TEST_F(EngineThatComesAlongAgain, AlsoWithALimitThatOneUpdateDoesNotKeep) {
  Engine engine({.accuracy = 0.0, .iterations = 100, .prepares_above = 0.0}, rescuer_);
  CountingClock clock;
  clock.drive(engine);
  GrowingGraph graph(spatial_types(), {}, 3);
  int unfinished = 0;
  for (int step = 0; step < 250; ++step) {
    go_round(graph, engine, 30);
    UpdateReport report;
    engine.solve(step % 10 < 7 ? 0.0 : 60.0, report);
    ASSERT_TRUE(report.ok) << step;
    unfinished += !engine.up_to_date();
  }
  EXPECT_GT(unfinished, 20);
  expect_prepared(engine);
  UpdateReport report;
  engine.solve(0.0, report);
  EXPECT_TRUE(engine.up_to_date());
  const double least = minimum(engine);
  EXPECT_NEAR(engine.chi2(), least, 1e-6 * least + 1e-9);
}

TEST_F(EngineThatComesAlongAgain, ACopyGoesOnAsTheOriginalDoes) {
  Engine engine({.prepares_above = 0.0}, rescuer_);
  GrowingGraph graph(spatial_types(), {}, 4);
  const auto step_of = [](GrowingGraph& growing, Engine& of) {
    go_round(growing, of, 30);
    UpdateReport report;
    of.solve(0.0, report);
    return report.affected_variables;
  };
  for (int step = 0; step < 103; ++step) step_of(graph, engine);
  Engine copy(engine);
  GrowingGraph copy_of_graph = graph;
  for (int step = 103; step < 160; ++step)
    EXPECT_EQ(step_of(graph, engine), step_of(copy_of_graph, copy));
  EXPECT_EQ(engine.problem().tree.log_determinant(), copy.problem().tree.log_determinant());
  EXPECT_EQ(engine.prepared(), copy.prepared());
  expect_prepared(engine);
}

}  // namespace
}  // namespace cairn::incremental
