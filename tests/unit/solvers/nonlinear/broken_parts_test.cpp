// SPDX-License-Identifier: BSD-3-Clause
// Optimizers with a linear solver or a factor that is wrong: none of them may claim to have
// converged.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "cairn/lie/se2.hpp"
#include "cairn/linear/iterative_solver.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/types/define_factor.hpp"
#include "cairn/types/define_variable.hpp"
#include "support/components.hpp"
#include "support/sample_graphs.hpp"

namespace cairn {
namespace {

using testing::AnyOf;
using testing::HasSubstr;

/// What a wrong solver makes of the right step.
using Spoil = std::function<void(std::span<double>)>;

/// A solver whose answers are right, but for what `spoil` does to them.
class SpoiltSolver : public LinearSolver {
 public:
  SpoiltSolver(std::unique_ptr<LinearSolver> solver, Spoil spoil)
      : solver_(std::move(solver)), spoil_(std::move(spoil)) {}
  void analyze(const BlockStructure& structure) override { solver_->analyze(structure); }
  Factorization factorize(const BlockMatrix& H) override { return solver_->factorize(H); }
  void solve(std::span<const double> g, std::span<double> x) override {
    solver_->solve(g, x);
    spoil_(x);
  }
  const LinearSolverStats& stats() const override { return solver_->stats(); }

 private:
  std::unique_ptr<LinearSolver> solver_;
  Spoil spoil_;
};

/// One that answers for its residual, as an iterative solver does.
class LooseSolver final : public SpoiltSolver, public IterativeSolver {
 public:
  using SpoiltSolver::SpoiltSolver;
  double tolerance() const override { return 1e-6; }

  void* ability(std::string_view name) override {
    return name == IterativeSolver::kAbility ? static_cast<IterativeSolver*>(this) : nullptr;
  }
};

template <class Solver = SpoiltSolver>
Summary optimize_with(const std::string& optimizer, const Spoil& spoil, Graph& graph) {
  Registry registry;
  registry.add<LinearSolver>("spoilt", OptionTable{}, [&](const Options&, Registry& all) {
    return std::make_unique<Solver>(all.make<LinearSolver>("eigen"), spoil);
  });
  return registry.make<Optimizer>(optimizer + ":linear_solver=spoilt")->optimize(graph);
}

class Optimizers : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const Registry registry;
    if (!registry.has(Optimizer::kKind, GetParam()) || !registry.has(LinearSolver::kKind, "eigen"))
      GTEST_SKIP() << "not built";
  }
};

TEST_P(Optimizers, ConvergeWithTheSolverAsItIs) {
  Graph graph = test::ring_of_poses(30, 0.05);
  EXPECT_EQ(optimize_with(
                GetParam(), [](std::span<double>) {}, graph)
                .status,
            Status::converged);
}

TEST_P(Optimizers, HaveNotConvergedWithStepsThatAreNotFinite) {
  for (const double value : {std::nan(""), 1e308, std::numeric_limits<double>::infinity()}) {
    Graph graph = test::ring_of_poses(30, 0.05);
    const double before = chi2(graph);
    const Summary summary = optimize_with(
        GetParam(), [&](std::span<double> x) { x.back() = value; }, graph);
    EXPECT_EQ(summary.status, Status::diverged) << value;
    EXPECT_EQ(chi2(graph), before);
    EXPECT_THAT(summary.notes, testing::Contains(HasSubstr("linear solver spoilt"))) << value;
  }
}

TEST_P(Optimizers, HaveNotConvergedWithStepsThatSolveNothing) {
  const std::vector<Spoil> wrong{[](std::span<double> x) { std::ranges::fill(x, 0.0); },
                                 [](std::span<double> x) { x.front() += 1e-3; },
                                 [](std::span<double> x) {
                                   for (double& value : x) value = -value;
                                 }};
  for (std::size_t k = 0; k < wrong.size(); ++k) {
    Graph graph = test::ring_of_poses(30, 0.05);
    const Summary summary = optimize_with(GetParam(), wrong[k], graph);
    EXPECT_EQ(summary.status, Status::diverged) << k;
    EXPECT_THAT(summary.notes, testing::Contains(HasSubstr("does not solve"))) << k;
  }
}

TEST_P(Optimizers, NameASolverWhoseStepsAreTooShort) {
  Graph graph = test::ring_of_poses(30, 0.05);
  int solved = 0;
  const Spoil spoil = [&](std::span<double> x) {
    if (++solved > 1) return;
    for (double& value : x) value *= 0.5;
  };
  const Summary summary = optimize_with(GetParam(), spoil, graph);
  EXPECT_EQ(summary.status, Status::converged);  // by the right steps that follow
  EXPECT_THAT(summary.notes, testing::Contains(HasSubstr("spoilt returned in iteration 1")));
}

TEST_P(Optimizers, HaveNotConvergedWithASolverThatBreaksLater) {
  Graph graph = test::ring_of_poses(30, 0.05);
  int solved = 0;
  const Spoil spoil = [&](std::span<double> x) {
    if (++solved > 2) std::ranges::fill(x, 0.0);
  };
  EXPECT_EQ(optimize_with(GetParam(), spoil, graph).status, Status::diverged);
}

// A step of nearly no length promises nearly no decrease.
TEST_P(Optimizers, HaveNotConvergedWithAnIterativeSolverThatEndsEarly) {
  for (const double part : {0.95, 1e-12}) {
    Graph graph = test::ring_of_poses(30, 0.05);
    const Summary summary = optimize_with<LooseSolver>(
        GetParam(),
        [part](std::span<double> x) {
          for (double& value : x) value *= part;
        },
        graph);
    if (part > 0.9) {
      EXPECT_EQ(summary.status, Status::converged);
      EXPECT_THAT(summary.notes, testing::Not(testing::Contains(HasSubstr("spoilt"))));
    } else {
      EXPECT_EQ(summary.status, Status::diverged);
      EXPECT_THAT(summary.notes, testing::Contains(HasSubstr("‖Hx − g‖ is 1 of ‖g‖")));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(BrokenParts, Optimizers,
                         testing::Values("gauss_newton", "levenberg_marquardt", "dogleg"));

/// A prior on a pose whose Jacobian has the wrong sign.
struct WrongSign {
  static constexpr std::string_view kTag = "WRONG_SIGN";
  static constexpr int kResidual = 3, kMeasurement = 3;
  using Variables = std::tuple<Se2>;
  template <class S>
  static Vector<S, 3> residual(const Vector<S, 3>& x, const Vector<double, 3>& z) {
    return {x[0] - z[0], x[1] - z[1], x[2] - z[2]};
  }
  static Vector<double, 3> evaluate(const Vector<double, 3>& x, const Vector<double, 3>& z,
                                    Eigen::Matrix3d& J) {
    J = -Eigen::Matrix3d::Identity();
    return x - z;
  }
};

/// A prior that fails after so many calls.
struct Failing {
  enum class How { nan, exception, number };
  static inline std::atomic<int> calls_left = 0;
  static inline How how = How::nan;
  static constexpr std::string_view kTag = "FAILING";
  static constexpr int kResidual = 3, kMeasurement = 3;
  using Variables = std::tuple<Se2>;
  template <class S>
  static Vector<S, 3> residual(const Vector<S, 3>& x, const Vector<double, 3>& z) {
    const bool fails = calls_left-- <= 0;
    if (fails && how == How::exception) throw std::domain_error("out of its range");
    if (fails && how == How::number) throw 42;
    // Not linear, so that there are several iterations.
    using std::sin;
    const S first = fails ? S(std::nan("")) : S(x[0] - z[0] + 0.5 * sin(x[0]));
    return {first, x[1] - z[1], x[2] - z[2]};
  }
};

template <class F>
Graph one_pose_with() {
  Graph graph;
  const double state[] = {0.3, -0.2, 0.1}, z[] = {3.0, 2.0, 0.5}, unit[] = {1, 0, 0, 1, 0, 1};
  const int pose[] = {graph.add_variable(define_variable<Se2>(), 7, state)};
  graph.add_factor(define_factor<F>(), pose, z, unit);
  return graph;
}

class Methods : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    if (!registry_.has(Optimizer::kKind, GetParam())) GTEST_SKIP() << "not built";
    const std::string spec = test::with_some_linear_solver(GetParam());
    if (spec.empty()) GTEST_SKIP() << "there is no linear solver";
    optimizer_ = registry_.make<Optimizer>(spec);
  }
  Registry registry_;
  std::unique_ptr<Optimizer> optimizer_;
};

TEST_P(Methods, HaveNotConvergedWithAWrongJacobian) {
  Graph graph = one_pose_with<WrongSign>();
  const double before = chi2(graph);
  const Summary summary = optimizer_->optimize(graph);
  EXPECT_NE(summary.status, Status::converged);
  EXPECT_LE(chi2(graph), before);
}

/// Seen from the origin, steps of metres are short in UTM coordinates.
TEST_P(Methods, HaveNotConvergedWithAWrongJacobianFarFromTheOrigin) {
  Graph graph;
  const auto type = define_variable<Se2>();
  const auto prior = define_factor<WrongSign>();
  const double east = 4e5, north = 5e6, unit[] = {1, 0, 0, 1, 0, 1};
  for (int k = 0; k < 2; ++k) {
    const double state[] = {east + 5.0 * k, north + 3.0 * k, 0.1}, z[] = {east + 2.0, north, 0.1};
    const int pose[] = {graph.add_variable(type, k, state)};
    graph.add_factor(prior, pose, z, unit);
  }
  EXPECT_NE(optimizer_->optimize(graph).status, Status::converged);
}

TEST_P(Methods, HaveNotConvergedWhereResidualsBecomeNan) {
  for (const int calls : {0, 1, 3, 6, 9}) {
    Failing::how = Failing::How::nan;
    Failing::calls_left = calls;
    Graph graph = one_pose_with<Failing>();
    const Status status = optimizer_->optimize(graph).status;
    const bool failed = Failing::calls_left < 0;
    EXPECT_TRUE(!failed || status != Status::converged) << calls;
  }
}

TEST_P(Methods, NameTheFactorThatThrows) {
  for (const auto how : {Failing::How::exception, Failing::How::number}) {
    for (const int calls : {0, 1, 4}) {
      Failing::how = how;
      Failing::calls_left = calls;
      Graph graph = one_pose_with<Failing>();
      try {
        optimizer_->optimize(graph);
        ADD_FAILURE() << "nothing was thrown after " << calls;
      } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::plugin);
        EXPECT_THAT(error.what(), HasSubstr("FAILING"));
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(BrokenParts, Methods,
                         testing::Values("gauss_newton", "levenberg_marquardt", "dogleg", "ceres",
                                         "ceres_line_search"));

/// At 1e9 m numbers are rounded to 1e-7 m, which a large information makes a part of chi2.
TEST_P(Optimizers, EndWhereCoordinatesAreRounded) {
  for (const double offset : {0.0, 1e9}) {
    Graph graph = test::ring_of_poses(30, 0.05);
    for (int f = 0; f < graph.factor_count(); ++f) {
      std::vector<double> information(graph.information(f).begin(), graph.information(f).end());
      for (double& value : information) value *= f % 5 == 0 ? 1e12 : 100.0;
      graph.set_measurement(f, graph.measurement(f), information);
    }
    for (int v = 0; v < graph.variable_count(); ++v) {
      std::vector<double> x(graph.state(v).begin(), graph.state(v).end());
      x[0] += offset;
      x[1] -= offset;
      graph.set_state(v, x);
    }
    const Summary summary = Registry().make<Optimizer>(GetParam())->optimize(graph);
    EXPECT_EQ(summary.status, Status::converged) << offset << ": " << summary.final_chi2;
    const auto are_rounded = testing::Contains(HasSubstr("their rounding alone"));
    if (offset > 0.0) {
      EXPECT_THAT(summary.notes, are_rounded);
    } else {
      EXPECT_THAT(summary.notes, testing::Not(are_rounded));
    }
  }
}

/// chi2 scales with the information, the estimate does not.
TEST_P(Methods, FindTheSameEstimateAtAnyScaleOfTheInformation) {
  std::vector<double> wanted;
  for (const double scale : {1.0, 1e-30, 1e-12, 1e12, 1e30, 1e60}) {
    Graph graph = test::ring_of_poses(30, 0.05);
    for (int f = 0; f < graph.factor_count(); ++f) {
      std::vector<double> information(graph.information(f).begin(), graph.information(f).end());
      for (double& value : information) value *= scale;
      graph.set_measurement(f, graph.measurement(f), information);
    }
    EXPECT_EQ(optimizer_->optimize(graph).status, Status::converged) << scale;
    std::vector<double> found;
    for (int v = 0; v < graph.variable_count(); ++v)
      found.insert(found.end(), graph.state(v).begin(), graph.state(v).end());
    if (wanted.empty()) wanted = found;
    for (std::size_t k = 0; k < wanted.size(); ++k)
      ASSERT_NEAR(found[k], wanted[k], 1e-6) << "at scale " << scale;
  }
}

/// Of the weak factors H holds no digit: where damping alone makes it positive definite, no step
/// that is short or promises little shows a minimum.
TEST_P(Methods, ClaimNoMinimumThatHDoesNotShow) {
  if (!registry_.has(LinearSolver::kKind, "spqr")) GTEST_SKIP() << "nothing to compare with";
  if (std::string(GetParam()) == "ceres") GTEST_SKIP() << "Ceres decides by rules of its own";
  for (const double strong : {1e16, 1e18, 1e20}) {
    Graph graph = test::ring_of_poses(30, 0.05);
    for (int f = 0; f < graph.factor_count(); ++f) {
      std::vector<double> information(graph.information(f).begin(), graph.information(f).end());
      for (double& value : information) value *= f % 5 < 2 ? strong : f % 5 < 4 ? 1.0 : 1 / strong;
      graph.set_measurement(f, graph.measurement(f), information);
    }
    Graph best = graph.clone();
    const Summary reference =
        registry_.make<Optimizer>("levenberg_marquardt:linear_solver=spqr")->optimize(best);
    const Summary summary = optimizer_->optimize(graph);
    if (summary.status != Status::converged) continue;
    EXPECT_LE(summary.final_chi2, 1.001 * reference.final_chi2) << strong;
  }
}

}  // namespace
}  // namespace cairn
