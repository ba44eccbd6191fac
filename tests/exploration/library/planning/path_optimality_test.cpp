// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/path_optimality.hpp"

#include <cmath>
#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "cairn/planning/loop_closure_value.hpp"
#include "cairn/planning/path_information.hpp"
#include "cairn/runtime/error.hpp"
#include "path_graphs.hpp"
#include "support/components.hpp"

namespace cairn {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using test::PathGraph;

std::unique_ptr<LinearSolver> solver() {
  return default_registry().make<LinearSolver>("block_cholesky");
}

TEST(PathOptimalities, ExactLogDeterminantsAreTheDenseOnes) {
  CAIRN_NEEDS("linear_solver", "block_cholesky");
  const auto sparse = solver();
  int loops = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const PathGraph graph = test::wandering(40, 4.0, seed);
    const Situation situation = graph.situation();
    PathOptimalities optimalities(situation, {.loop_gain = 0.1}, *sparse);
    EXPECT_EQ(optimalities.now().size, 3 * 39);
    const double now = -test::dense_log_determinant(*graph.estimator, graph.poses);
    EXPECT_NEAR(optimalities.now().log_determinant, now, 1e-9 * std::abs(now));
    PathInformation information(situation, {.loop_gain = 0.1});
    RandomNumbers random(seed);
    for (int k = 0; k < 3; ++k) {
      const auto motions = test::random_motions(graph.pose, 20 + 5 * k, 4.0, random);
      const PathOptimality path = optimalities.along(motions);
      const auto state = information.extended(information.start(), motions);
      std::vector<Id> poses;
      const auto after = test::with_path(graph, state, poses);
      const double dense = -test::dense_log_determinant(*after, poses);
      EXPECT_NEAR(path.log_determinant, dense, 1e-9 * std::abs(dense));
      EXPECT_EQ(path.size, 3 * static_cast<int>(poses.size() - 1));
      EXPECT_DOUBLE_EQ(path.log_optimality, path.log_determinant / path.size);
      EXPECT_EQ(path.loops, state.loops());
      EXPECT_DOUBLE_EQ(path.length, state.length());
      loops += path.loops;
    }
  }
  EXPECT_GT(loops, 50);
}

/// Nothing of a path is left for those that are asked for after it.
TEST(PathOptimalities, DoNotDependOnThePathsBefore) {
  CAIRN_NEEDS("linear_solver", "block_cholesky");
  const PathGraph graph = test::wandering(60, 5.0, 3);
  const Situation situation = graph.situation();
  for (const OptimalityForm by : {OptimalityForm::exact, OptimalityForm::laplacian}) {
    const auto sparse = solver();
    PathOptimalities together(situation, {.by = by, .loop_gain = 0.1}, *sparse);
    RandomNumbers random(5);
    int loops = 0;
    for (const int count : {40, 3, 1, 70, 40, 12}) {
      const auto motions = test::random_motions(graph.pose, count, 5.0, random);
      const PathOptimality path = together.along(motions);
      const auto own = solver();
      PathOptimalities alone(situation, {.by = by, .loop_gain = 0.1}, *own);
      const PathOptimality expected = alone.along(motions);
      EXPECT_EQ(path.log_determinant, expected.log_determinant);
      EXPECT_EQ(path.loops, expected.loops);
      loops += path.loops;
    }
    EXPECT_GT(loops, 20);
    EXPECT_EQ(together.along({}).log_determinant, together.now().log_determinant);
  }
}

/// The Laplacian of a graph by its definition, with all poses, the first of which is grounded.
class DenseLaplacian {
 public:
  explicit DenseLaplacian(const PathGraph& graph) : graph_(graph) {
    L_ = MatrixXd::Zero(std::ssize(graph.poses), std::ssize(graph.poses));
    for (const FactorId f : graph.estimator->factors()) {
      const Factor factor = graph.estimator->factor(f);
      const MatrixXd Omega = Information::packed(factor.information).matrix();
      join(static_cast<Eigen::Index>(factor.variables[0]),
           static_cast<Eigen::Index>(factor.variables[1]), std::cbrt(Omega.determinant()));
    }
  }
  void add(const Pose2& motion) {
    L_.conservativeResizeLike(MatrixXd::Zero(L_.rows() + 1, L_.cols() + 1));
    join(L_.rows() - 2, L_.rows() - 1,
         std::cbrt(graph_.robot.odometry.covariance(motion).inverse().determinant()));
  }
  /// Closes the loop of the last pose with the best one that is allowed.
  bool close(const Pose2& at, double loop_gain) {
    const MatrixXd G = reduced().inverse();
    const double weight = std::cbrt(graph_.match.covariance().inverse().determinant());
    Eigen::Index best = -1;
    double most = 0.0;
    for (std::size_t k = 0; k + 1 < graph_.poses.size(); ++k) {
      const Pose2 older = Pose2::from_state(graph_.estimator->state(graph_.poses[k]));
      if (can_match(older, graph_.pose, graph_.match) || !can_match(older, at, graph_.match))
        continue;
      VectorXd e = VectorXd::Zero(L_.rows());
      e[static_cast<Eigen::Index>(k)] = 1.0;
      e[L_.rows() - 1] = -1.0;
      const VectorXd r = e.tail(L_.rows() - 1);
      const double gain = 1.5 * std::log(1.0 + weight * r.dot(G * r));
      if (gain <= loop_gain || gain <= most) continue;
      most = gain;
      best = static_cast<Eigen::Index>(k);
    }
    if (best < 0) return false;
    join(best, L_.rows() - 1, weight);
    return true;
  }
  double log_determinant() const {
    const MatrixXd L = Eigen::LLT<MatrixXd>(reduced()).matrixL();
    return 2.0 * L.diagonal().array().log().sum();
  }
  /// (Π λ)^{1/n} of the eigenvalues but for the zero of the constant vector.
  double optimality() const {
    const VectorXd lambda = Eigen::SelfAdjointEigenSolver<MatrixXd>(L_).eigenvalues();
    return std::exp(lambda.tail(lambda.size() - 1).array().log().sum() /
                    static_cast<double>(lambda.size()));
  }

 private:
  void join(Eigen::Index a, Eigen::Index b, double weight) {
    L_(a, a) += weight;
    L_(b, b) += weight;
    L_(a, b) -= weight;
    L_(b, a) -= weight;
  }
  MatrixXd reduced() const { return L_.bottomRightCorner(L_.rows() - 1, L_.cols() - 1); }

  const PathGraph& graph_;
  MatrixXd L_;
};

TEST(PathOptimalities, TheLaplacianIsThatOfTheGraphWithThePath) {
  CAIRN_NEEDS("linear_solver", "block_cholesky");
  int loops = 0, most = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const PathGraph graph = test::wandering(40, 4.0, seed);
    const Situation situation = graph.situation();
    const auto sparse = solver();
    PathOptimalities optimalities(situation, {.by = OptimalityForm::laplacian, .loop_gain = 0.3},
                                  *sparse);
    EXPECT_EQ(optimalities.now().size, 40);
    EXPECT_NEAR(std::exp(optimalities.now().log_optimality), DenseLaplacian(graph).optimality(),
                1e-6 * DenseLaplacian(graph).optimality());
    RandomNumbers random(seed);
    for (int k = 0; k < 3; ++k) {
      const auto motions = test::random_motions(graph.pose, 20 + 5 * k, 4.0, random);
      const PathOptimality path = optimalities.along(motions);
      DenseLaplacian dense(graph);
      int closed = 0;
      Pose2 at = graph.pose;
      for (const Pose2& motion : motions) {
        at = at * motion;
        dense.add(motion);
        closed += dense.close(at, 0.3);
      }
      EXPECT_EQ(path.loops, closed);
      EXPECT_EQ(path.size, 40 + static_cast<int>(motions.size()));
      EXPECT_NEAR(path.log_determinant, dense.log_determinant(),
                  1e-9 * std::abs(dense.log_determinant()));
      EXPECT_NEAR(std::exp(path.log_optimality), dense.optimality(), 1e-6 * dense.optimality());
      loops += closed;
      most = std::max(most, closed);
    }
  }
  EXPECT_GT(loops, 50);
  EXPECT_GE(most, 3);
}

/// A robot that has driven on from the last pose that is kept has a pose where it is.
TEST(PathOptimalities, BeyondTheLastPoseThatIsKeptThereIsOneMore) {
  CAIRN_NEEDS("linear_solver", "block_cholesky");
  for (const OptimalityForm by : {OptimalityForm::exact, OptimalityForm::laplacian}) {
    PathGraph graph = test::straight(20, Pose2(0.4, 0.0, 0.0));
    const Pose2 since(0.3, 0.0, 0.1);
    const auto sparse = solver(), other = solver();
    PathOptimality expected = [&] {
      const Situation situation = graph.situation();
      return PathOptimalities(situation, {.by = by}, *sparse).along({&since, 1});
    }();
    graph.pose = graph.pose * since;
    const Situation situation = graph.situation();
    const PathOptimality now = PathOptimalities(situation, {.by = by}, *other).now();
    EXPECT_EQ(now.size, expected.size);
    EXPECT_NEAR(now.log_determinant, expected.log_determinant, 1e-9);
    EXPECT_NEAR(now.log_optimality, expected.log_optimality, 1e-12);
  }
}

TEST(PathOptimalities, ALoopClosureMakesBothLarger) {
  CAIRN_NEEDS("linear_solver", "block_cholesky");
  const PathGraph graph = test::straight(40, Pose2(0.4, 0.0, 0.0));
  const Situation situation = graph.situation();
  const std::vector<Pose2> back(30, Pose2(-0.4, 0.0, 0.0));
  for (const OptimalityForm by : {OptimalityForm::exact, OptimalityForm::laplacian}) {
    const auto sparse = solver();
    const auto along = [&](double loop_gain) {
      PathOptimalities optimalities(situation, {.by = by, .loop_gain = loop_gain}, *sparse);
      return optimalities.along(back);
    };
    const PathOptimality with = along(1.0), without = along(1e6);
    EXPECT_EQ(without.loops, 0);
    EXPECT_GT(with.loops, 0);
    EXPECT_GT(with.log_optimality, without.log_optimality);
  }
}

/// A linear solver without any ability.
class PlainSolver final : public LinearSolver {
 public:
  void analyze(const BlockStructure&) override {}
  Factorization factorize(const BlockMatrix&) override { return {}; }
  void solve(std::span<const double>, std::span<double>) override {}
  const LinearSolverStats& stats() const override { return stats_; }

 private:
  LinearSolverStats stats_;
};

TEST(PathOptimalities, SayWhatTheyLack) {
  PathGraph graph = test::straight(5, Pose2(0.4, 0.0, 0.0));
  PlainSolver plain;
  {
    const Situation situation = graph.situation();
    try {
      const PathOptimalities none(situation, {}, plain);
      FAIL() << "a solver without determinants was taken";
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("log_determinant"), std::string::npos);
    }
  }
  graph.poses.clear();
  const Situation situation = graph.situation();
  EXPECT_THROW(PathOptimalities(situation, {}, plain), Error);
}

}  // namespace
}  // namespace cairn
