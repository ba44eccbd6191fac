// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/typed/run.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <numbers>
#include <string>
#include <utility>

#include "cairn/io/generator.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/typed/build.hpp"
#include "support/components.hpp"

namespace cairn {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::StartsWith;

Graph drifted_square() {
  constexpr double kQuarter = std::numbers::pi / 2;
  Graph graph;
  graph.add(0, Pose2(0.0, 0.0, 0.0));
  graph.add(1, Pose2(4.1, 0.0, kQuarter));
  graph.add(2, Pose2(4.2, 4.1, 2 * kQuarter));
  graph.add(3, Pose2(0.1, 4.2, 3 * kQuarter));
  for (const Id from : {0, 1, 2, 3})
    graph.add(Between(from, (from + 1) % 4, Pose2(4.0, 0.0, kQuarter)),
              Information::sigmas(0.1, 0.1, 0.05));
  return graph;
}

TEST(Optimize, FindsTheMinimumByDefaultAndByName) {
  for (const char* name :
       {"levenberg_marquardt", "dogleg:linear_solver=cholmod", "dogleg:linear_solver=eigen"}) {
    Graph graph = drifted_square();
    const double before = chi2(graph);
    Graph from_states = drifted_square();
    const Summary summary = optimize(graph, name), other = optimize_from_states(from_states, name);
    EXPECT_EQ(summary.status, Status::converged) << name;
    EXPECT_NEAR(chi2(graph), summary.final_chi2, 1e-12);
    EXPECT_NEAR(other.initial_chi2, before, 1e-12 * before);
    EXPECT_NEAR(other.final_chi2, summary.final_chi2, 1e-9);
    EXPECT_TRUE(graph.at<Pose2>(2).equals({4.0, 4.0, std::numbers::pi}, 1e-6)) << name;
  }
  Graph graph = drifted_square();
  EXPECT_EQ(optimize(graph).optimizer, "levenberg_marquardt");
}

TEST(Optimize, TakesAStopAndARegistry) {
  Registry registry;
  Graph graph = drifted_square();
  const Summary summary =
      optimize(graph, "gauss_newton", {.max_iterations = 1, .tolerance = 0.0}, registry);
  EXPECT_EQ(summary.iterations.size(), 1U);
}

TEST(Optimize, FindsTheMinimumWhereTheStatesEndInAnother) {
  CAIRN_NEEDS("generator", "manhattan");
  CAIRN_NEEDS("initial_guess", "auto");
  Registry& registry = default_registry();
  // With this much noise in the headings, steps from odometry end in a local minimum.
  Graph graph = std::move(registry.make<Generator>("manhattan:poses=1500,rotation_sigma=0.1")
                              ->generate(registry, 7)
                              .graph);
  Graph stuck = graph.clone();
  const Summary chosen = optimize(graph), given = optimize_from_states(stuck);
  EXPECT_EQ(chosen.status, Status::converged);
  EXPECT_GT(given.final_chi2, 1.2 * chosen.final_chi2);
  EXPECT_THAT(chosen.notes, Contains(AllOf(StartsWith("initial guess auto: chordal (chi2"),
                                           HasSubstr("not as_given (chi2"))));
  // From the minimum that is left it is found too.
  EXPECT_NEAR(optimize(stuck).final_chi2, chosen.final_chi2, 1e-6 * chosen.final_chi2);
  // An optimised graph stays as it is, and nothing is said of a choice.
  EXPECT_THAT(optimize(graph).notes, Not(Contains(StartsWith("initial guess"))));
}

TEST(Write, SaysThatLossesAreNotInTheFile) {
  CAIRN_NEEDS("format", "g2o");
  CAIRN_NEEDS("loss", "cauchy");
  const std::filesystem::path file =
      std::filesystem::path(testing::TempDir()) / "losses_not_written.g2o";
  Graph graph = drifted_square();
  EXPECT_THAT(write(graph, file), IsEmpty());
  graph.set_loss(0, make<Loss>("cauchy"));
  EXPECT_THAT(write(graph, file), StartsWith("the losses of 1 factor are not in the file"));
  EXPECT_FALSE(read(file).has_losses());
  graph.set_loss(nullptr);
  EXPECT_THAT(write(graph, file), IsEmpty());
  std::filesystem::remove(file);
}

TEST(Optimize, SaysThatChi2IsImplausible) {
  Graph graph = drifted_square();
  graph.add(Between(0, 2, Pose2(40.0, 0.0, 0.0)), Information::sigmas(0.1, 0.1, 0.05));
  EXPECT_THAT(optimize(graph).notes, Contains(HasSubstr("degrees of freedom")));
}

TEST(Optimize, RefusesAWrongNameBeforeItMovesTheStates) {
  Graph graph = drifted_square();
  EXPECT_THROW(optimize(graph, "gaus_newton"), Error);
  EXPECT_TRUE(graph.at<Pose2>(1).equals({4.1, 0.0, std::numbers::pi / 2}, 0.0));
}

TEST(Optimize, DoesNotMoveWhatIsInterruptedBeforeItBegins) {
  Graph graph = drifted_square();
  const std::atomic<bool> interrupt{true};
  EXPECT_EQ(optimize(graph, "gauss_newton", {.interrupt = &interrupt}).status, Status::interrupted);
  EXPECT_TRUE(graph.at<Pose2>(1).equals({4.1, 0.0, std::numbers::pi / 2}, 0.0));
}

TEST(Chi2, HasTheLossOfTheGraph) {
  Graph graph = drifted_square();
  const double square = chi2(graph);
  graph.set_loss(make<Loss>("cauchy:scale=0.5"));
  EXPECT_LT(chi2(graph), square);
  EXPECT_NEAR(chi2(graph),
              optimize_from_states(graph, "gauss_newton", {.max_iterations = 0}).initial_chi2,
              1e-12);
}

TEST(ReadAndWrite, KeepTheGraph) {
  CAIRN_NEEDS("format", "g2o");
  std::string folder = (std::filesystem::temp_directory_path() / "cairn-typed-XXXXXX").string();
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  const std::filesystem::path file = std::filesystem::path(folder) / "square.g2o";
  const Graph graph = drifted_square();
  write(graph, file);
  const Graph back = read(file);
  std::filesystem::remove_all(folder);
  EXPECT_EQ(back.variable_count(), 4);
  EXPECT_EQ(back.factor_count(), 4);
  EXPECT_EQ(chi2(back), chi2(graph));
  EXPECT_TRUE(back.at<Pose2>(3).equals(graph.at<Pose2>(3), 0.0));
}

}  // namespace
}  // namespace cairn
