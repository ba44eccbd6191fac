// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/optimization.hpp"

#include <algorithm>
#include <atomic>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/io/generator.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/types/loss.hpp"
#include "support/sample_graphs.hpp"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

/// Moves the point of `overshooting` to (x, 1), unless it may not go on.
class MovesTo final : public InitialGuess, public WatchedGuess {
 public:
  explicit MovesTo(double x) : x_(x) {}
  void* ability(std::string_view name) override {
    return name == kAbility ? static_cast<WatchedGuess*>(this) : nullptr;
  }
  void watch(GoOn go_on) override { go_on_ = std::move(go_on); }
  std::vector<std::string> compute(Graph& graph) override {
    if (go_on_ && !go_on_("moves", 0.5)) return {"ended"};
    const double state[] = {x_, 1.0};
    graph.set_state(0, state);
    return {"moved"};
  }

 private:
  double x_;
  GoOn go_on_;
};

/// Changes nothing; ends with the status that it is given.
class Stays final : public Optimizer {
 public:
  explicit Stays(Status status) : status_(status) {}
  Summary optimize(Graph& graph, const Stop&, Observer&) override {
    Summary summary;
    summary.status = status_;
    summary.initial_chi2 = summary.final_chi2 = test::chi2_of(graph);
    summary.notes = {"stayed"};
    return summary;
  }

 private:
  Status status_;
};

class Fails final : public Optimizer {
 public:
  Summary optimize(Graph&, const Stop&, Observer&) override { throw std::runtime_error("no"); }
};

/// Of no weight anywhere.
class Weightless final : public Loss {
 public:
  void evaluate(std::span<const double>, std::span<double> rho,
                std::span<double> weights) const override {
    std::ranges::fill(rho, 0.0);
    std::ranges::fill(weights, 0.0);
  }
  double second_derivative(double) const override { return 0.0; }
};

class Optimizations : public testing::Test {
 protected:
  Summary run(Optimizer& optimizer, InitialGuess* guess, const WatchedGuess::GoOn& go_on = {}) {
    return optimize(graph_, {optimizer, "stays", guess, "moves"}, stop_, silent_, go_on);
  }
  double x() const { return graph_.state(0)[0]; }

  Graph graph_ = test::overshooting(3.0);
  Stop stop_;
  Observer silent_;
};

TEST_F(Optimizations, BeginWithTheGuessAndEndWithWhatSpeaksAgainstTheEstimate) {
  graph_.set_loss(std::make_shared<Weightless>());
  MovesTo near(0.1);
  Stays optimizer(Status::converged);
  const Summary summary = run(optimizer, &near);
  EXPECT_THAT(summary.notes, ElementsAre("initial guess moves: moved", "stayed",
                                         HasSubstr("no factor any weight")));
  EXPECT_THAT(summary.doubts, ElementsAre(summary.notes.back())) << "what informs is no doubt";
}

TEST_F(Optimizations, DoNotDoubtWhatWasInterrupted) {
  graph_.set_loss(std::make_shared<Weightless>());
  MovesTo near(0.1);
  Stays optimizer(Status::interrupted);
  EXPECT_THAT(run(optimizer, &near).notes, ElementsAre("initial guess moves: moved", "stayed"));
}

// Whoever uses the states afterwards asks this one question.
TEST_F(Optimizations, LeaveAnEstimateWhereTheyDidWhatWasAsked) {
  const Stop exactly{.tolerance = 0.0};
  for (const Status status : {Status::converged, Status::max_iterations, Status::diverged,
                              Status::not_positive_definite, Status::interrupted}) {
    Summary summary;
    summary.status = status;
    EXPECT_EQ(is_estimate(summary, Stop()), status == Status::converged) << to_string(status);
    EXPECT_EQ(is_estimate(summary, exactly),
              status == Status::converged || status == Status::max_iterations)
        << to_string(status);
  }
}

TEST_F(Optimizations, SayThatTheirLimitEndedThem) {
  Summary summary;
  summary.final_chi2 = test::chi2_of(graph_);
  summary.iterations.resize(3);
  const auto notes = [&](const Stop& stop) {
    Summary ended = summary;
    note_the_end(ended, stop, graph_);
    EXPECT_EQ(ended.doubts, ended.notes);
    return ended.notes;
  };
  EXPECT_THAT(notes({.max_iterations = 3}),
              testing::Contains("stopped by max_iterations 3 before it converged"));
  EXPECT_THAT(notes({.max_iterations = 3, .tolerance = 0.0}),
              testing::Not(testing::Contains(HasSubstr("stopped by"))));
  EXPECT_THAT(notes({.max_iterations = 4}),
              testing::Not(testing::Contains(HasSubstr("stopped by"))))
      << "that was the limit of time";
}

// Bundle adjustment by default: as fast as the user who knows all names has it.
TEST(SuitedLinearSolver, EliminatesPointsThatNoFactorJoinsFirst) {
  Registry registry;
  for (const auto& [kind, name] : {std::pair("generator", "bundle"),
                                   {"generator", "ring"},
                                   {"types", "bundle"},
                                   {"types", "slam2d"},
                                   {"linear_solver", "schur"},
                                   {"linear_solver", "pcg"},
                                   {"optimizer", "levenberg_marquardt"},
                                   {"optimizer", "ceres"}}) {
    if (!registry.has(kind, name)) GTEST_SKIP() << "there is no " << kind << " " << name;
  }
  const auto simulate = [&](const char* world) {
    return std::move(registry.make<Generator>(world)->generate(registry, 7).graph);
  };
  const Graph cameras = simulate("bundle:cameras=20,points=400"), poses = simulate("ring:poses=50");
  const auto suited = [&](const char* optimizer, const Graph& graph) {
    return to_text(with_suited_linear_solver(parse_component(optimizer), graph, registry));
  };
  EXPECT_EQ(suited("levenberg_marquardt", cameras),
            "levenberg_marquardt:linear_solver=schur:dense=pcg");
  EXPECT_EQ(suited("levenberg_marquardt:linear_solver=eigen", cameras),
            "levenberg_marquardt:linear_solver=eigen");
  EXPECT_EQ(suited("levenberg_marquardt", poses), "levenberg_marquardt");
  EXPECT_EQ(suited("ceres", cameras), "ceres") << "has solvers of its own";
  // With the gauge free, steps that gain nothing but rounding end the run.
  Graph graph = cameras.clone();
  const auto optimizer = registry.make<Optimizer>(
      with_suited_linear_solver({"levenberg_marquardt", {}}, graph, registry));
  const Summary summary = optimizer->optimize(graph, {});
  EXPECT_EQ(summary.status, Status::converged);
  EXPECT_LE(summary.iterations.size(), 12U);
}

TEST_F(Optimizations, WithoutAGuessStartFromTheStates) {
  Stays optimizer(Status::converged);
  EXPECT_THAT(run(optimizer, nullptr).notes, ElementsAre("stayed"));
  EXPECT_EQ(x(), 3.0);
}

TEST_F(Optimizations, EndAGuessByTheInterruptOrByWhatIsAsked) {
  MovesTo near(0.1);
  Stays optimizer(Status::interrupted);
  std::atomic<bool> interrupt{true};
  stop_.interrupt = &interrupt;
  EXPECT_THAT(run(optimizer, &near).notes, ElementsAre("initial guess moves: ended", "stayed"));
  EXPECT_EQ(x(), 3.0);
  interrupt = false;
  run(optimizer, &near, [](std::string_view, double) { return false; });
  EXPECT_EQ(x(), 3.0);
  run(optimizer, &near);
  EXPECT_EQ(x(), 0.1);
}

TEST_F(Optimizations, NameTheComponentThatThrows) {
  Fails optimizer;
  try {
    run(optimizer, nullptr);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::plugin);
    EXPECT_THAT(error.what(), HasSubstr("optimizer 'stays' failed: no"));
  }
}

}  // namespace
}  // namespace cairn
