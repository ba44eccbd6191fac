// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/path_simulation.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "cairn/planning/path_information.hpp"
#include "cairn/planning/path_motions.hpp"
#include "cairn/runtime/error.hpp"
#include "exploration/library/exploration/drawn_map.hpp"
#include "path_graphs.hpp"

namespace cairn {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using test::PathGraph;

/// The information matrix of a pose graph with right tangents and residuals that are zero, by its
/// definition; the first pose is fixed.
class DenseGraph {
 public:
  DenseGraph(const PathGraph& graph) : graph_(graph) {  // NOLINT(google-explicit-constructor)
    for (const Id id : graph.poses) {
      const Pose2 pose = Pose2::from_state(graph.estimator->state(id));
      if (poses_.empty())
        poses_.push_back(pose);
      else
        add(pose);
    }
  }
  void add(const Pose2& pose) {
    const auto size = static_cast<Eigen::Index>(3 * poses_.size());
    const MatrixXd before = Lambda_;
    Lambda_ = MatrixXd::Zero(size, size);
    Lambda_.topLeftCorner(before.rows(), before.cols()) = before;
    poses_.push_back(pose);
    const Pose2 motion = poses_[poses_.size() - 2].between(pose);
    join(poses_.size() - 2, graph_.robot.odometry.covariance(motion));
  }
  void close(std::size_t older) { join(older, graph_.match.covariance()); }

  MatrixXd covariance() const { return Lambda_.inverse(); }
  static Matrix3d block(const MatrixXd& Sigma, std::size_t a, std::size_t b) {
    if (a == 0 || b == 0) return Matrix3d::Zero();
    return Sigma.block<3, 3>(static_cast<Eigen::Index>(3 * (a - 1)),
                             static_cast<Eigen::Index>(3 * (b - 1)));
  }
  Matrix3d prior(std::size_t k) const {
    const Matrix3d A = poses_[k].between(poses_.front()).adjoint();
    return A * graph_.first_sigma.array().square().matrix().asDiagonal() * A.transpose();
  }
  /// (5.13) with the standard entropy.
  double entropy() const {
    const MatrixXd Sigma = covariance();
    double sum = 0.0;
    for (std::size_t k = 0; k < poses_.size(); ++k) {
      const Matrix3d S = block(Sigma, k, k) + prior(k);
      sum +=
          0.5 * std::log(std::pow(2.0 * std::numbers::pi * std::numbers::e, 3.0) * S.determinant());
    }
    return sum / static_cast<double>(poses_.size());
  }
  /// The pose, of the first `count`, by which the newest pose's |Σ| becomes least, and the
  /// information gain.
  struct Best {
    std::optional<std::size_t> pose = {};
    double gain = 0.0;
  };
  Best best(std::size_t count, const Pose2& robot, double loop_gain) const {
    const MatrixXd Sigma = covariance();
    const std::size_t k = poses_.size() - 1;
    Best found;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t l = 0; l < count; ++l) {
      const auto in_area = [&](const Pose2& newer) {
        const Pose2 seen = poses_[l].between(newer);
        return std::abs(seen.x()) <= graph_.match.range &&
               std::abs(seen.y()) <= graph_.match.range &&
               std::abs(seen.theta()) <= graph_.match.angle;
      };
      if (!in_area(poses_[k]) || in_area(robot)) continue;
      Eigen::Matrix<double, 3, 6> J;
      J << -poses_[k].between(poses_[l]).adjoint(), Matrix3d::Identity();
      Eigen::Matrix<double, 6, 6> joint;
      joint << block(Sigma, l, l), block(Sigma, l, k), block(Sigma, k, l), block(Sigma, k, k);
      const Matrix3d R = graph_.match.covariance();
      const Matrix3d S = J * joint * J.transpose() + R;
      const double gain = 0.5 * std::log(S.determinant() / R.determinant());
      const Eigen::Matrix<double, 6, 6> after =
          joint - joint * J.transpose() * S.inverse() * J * joint;
      const double determinant = (after.bottomRightCorner<3, 3>() + prior(k)).determinant();
      if (gain > loop_gain && determinant < least) {
        least = determinant;
        found = {l, gain};
      }
    }
    return found;
  }

 private:
  void join(std::size_t older, const Matrix3d& noise) {
    const std::size_t newer = poses_.size() - 1;
    MatrixXd J = MatrixXd::Zero(3, Lambda_.cols());
    J.rightCols<3>().setIdentity();
    if (older > 0)
      J.middleCols<3>(static_cast<Eigen::Index>(3 * (older - 1))) -=
          poses_[newer].between(poses_[older]).adjoint();
    Lambda_ += J.transpose() * noise.inverse() * J;
  }

  const PathGraph& graph_;
  std::vector<Pose2> poses_;
  MatrixXd Lambda_;
};

/// A robot that has driven along a line, on floor of which some is unknown, and may drive back.
PathGraph along_a_line() {
  PathGraph graph = test::straight(25, Pose2(0.4, 0.0, 0.0));
  graph.map = test::drawn_map(std::vector<std::string>(60, std::string(90, '.')), 0.2);
  for (int y = 30; y < 60; ++y) {
    for (int x = 0; x < 90; ++x) graph.map.cells[graph.map.frame.index(x, y)] = CellState::unknown;
  }
  graph.map.frame.origin = {-2.0, -5.0};
  graph.robot.lidar.beams = 61;
  return graph;
}

PlannedPath path_through(const PathGraph& graph, const std::vector<Eigen::Vector2d>& points) {
  PlannedPath path{.points = {graph.pose.translation()}};
  for (const Eigen::Vector2d& point : points) {
    path.length += (point - path.points.back()).norm();
    path.points.push_back(point);
  }
  return path;
}

TEST(PathSimulation, IsThatOfDenseAlgebra) {
  const PathGraph graph = along_a_line();
  const Situation situation = graph.situation();
  constexpr double kGain = 0.3;
  // Around, and along the line again from its beginning.
  const Eigen::Vector2d first = Pose2::from_state(graph.estimator->state(0)).translation();
  const PlannedPath path =
      path_through(graph, {first - Eigen::Vector2d(1.5, 0.6), first + Eigen::Vector2d(3.0, 1.3)});
  const PathSimulation simulation(situation, {.loop_gain = kGain}, default_registry());
  const SimulatedDrive drive = simulation.drive(path);

  DenseGraph dense(graph);
  const double before = dense.entropy();
  const std::size_t count = graph.poses.size() - 1;
  std::vector<SimulatedDrive::Closure> closures;
  Pose2 at = graph.pose;
  Id newer = graph.poses.back();
  for (const Pose2& motion : motions_along(at, path, graph.robot)) {
    at = at * motion;
    dense.add(at);
    ++newer;
    const DenseGraph::Best best = dense.best(count, graph.pose, kGain);
    if (!best.pose) continue;
    dense.close(*best.pose);
    closures.push_back({graph.poses[*best.pose], newer, best.gain});
  }
  ASSERT_GE(closures.size(), 2U);
  ASSERT_EQ(drive.closures.size(), closures.size());
  for (std::size_t k = 0; k < closures.size(); ++k) {
    EXPECT_EQ(drive.closures[k].older, closures[k].older);
    EXPECT_EQ(drive.closures[k].newer, closures[k].newer);
    EXPECT_NEAR(drive.closures[k].gain, closures[k].gain, 1e-8);
  }
  EXPECT_NEAR(drive.change.trajectory, dense.entropy() - before, 1e-9);
  EXPECT_EQ(drive.change.alpha, 1.0);
  EXPECT_DOUBLE_EQ(drive.value(), drive.change.trajectory + drive.change.map);
  EXPECT_NEAR(drive.length, path.length, 0.05);
}

/// Of noisy graphs that are optimised, several loops per path: by the determinant lemma.
TEST(PathSimulation, IsThatOfPathInformation) {
  std::size_t loops = 0, cells = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const PathGraph graph = test::partly_explored(seed);
    const Situation situation = graph.situation();
    const PathSimulation simulation(situation, {.loop_gain = 0.4, .simulated_range = 3.0},
                                    default_registry());
    PathInformation information(
        situation, {.loop_gain = 0.4}, [&](const Pose2& older, const Pose2& newer) {
          constexpr int kPoints = 1000;
          for (int k = 0; k <= kPoints; ++k) {
            const Eigen::Vector2d point =
                older.translation() +
                (newer.translation() - older.translation()) * (double(k) / kPoints);
            const Eigen::Vector2d cell = graph.map.frame.to_cells(point).array().floor();
            const int x = int(cell.x()), y = int(cell.y());
            if (graph.map.frame.contains(x, y) &&
                graph.map.cells[graph.map.frame.index(x, y)] == CellState::occupied)
              return false;
          }
          return true;
        });
    const SeenCells seen(graph.map, graph.robot.lidar, 3.0);
    RandomNumbers random(seed);
    for (int k = 0; k < 3; ++k) {
      const PlannedPath path =
          path_through(graph, {{random.uniform(-4, 4), random.uniform(-4, 4)},
                               {random.uniform(-4, 4), random.uniform(-4, 4)}});
      const SimulatedDrive drive = simulation.drive(path);
      PathInformation::State state = information.start();
      CellSet expected = seen.none();
      for (const Pose2& motion : motions_along(graph.pose, path, graph.robot)) {
        state = information.extended(state, motion);
        const Pose2 pose = state.pose();
        expected.add(seen.look({&pose, 1}));
      }
      EXPECT_EQ(static_cast<int>(drive.closures.size()), state.loops());
      // An update of the copy may linearise some factors anew.
      EXPECT_NEAR(drive.change.trajectory, state.trajectory_change(),
                  1e-4 * std::abs(state.trajectory_change()) + 1e-6);
      EXPECT_EQ(drive.cells, expected.count());
      EXPECT_DOUBLE_EQ(drive.change.map, seen.entropy_change(expected.count()));
      loops += drive.closures.size();
      cells += drive.cells;
    }
  }
  EXPECT_GT(loops, 40U);
  EXPECT_GT(cells, 200U);
}

TEST(PathSimulation, LeavesTheGraphAsItIs) {
  const PathGraph graph = along_a_line();
  const Situation situation = graph.situation();
  const auto numbers = [&] {
    std::vector<double> all;
    for (const Id id : graph.poses) {
      const auto state = graph.estimator->state(id);
      all.insert(all.end(), state.begin(), state.end());
      std::array<double, 9> block{};
      graph.estimator->covariance(id, id, block);
      all.insert(all.end(), block.begin(), block.end());
    }
    return all;
  };
  const std::vector<double> before = numbers();
  const PathSimulation simulation(situation, {}, default_registry());
  const PlannedPath path = path_through(graph, {{2.0, 2.0}, {1.0, -2.0}});
  const SimulatedDrive first = simulation.drive(path), second = simulation.drive(path);
  EXPECT_EQ(first.change.trajectory, second.change.trajectory);
  EXPECT_EQ(numbers(), before);
  EXPECT_EQ(graph.estimator->variable_count(), 25);
  EXPECT_EQ(first.poses.size(), 25U + static_cast<std::size_t>(first.motions));
}

TEST(PathSimulation, TheEntropyOfTheThesisChangesTwiceAsMuch) {
  const PathGraph graph = along_a_line();
  const Situation situation = graph.situation();
  const PlannedPath path = path_through(graph, {{2.0, 2.0}});
  const auto change = [&](EntropyForm form) {
    return PathSimulation(situation, {.entropy = form}, default_registry()).drive(path).change;
  };
  EXPECT_NEAR(change(EntropyForm::thesis).trajectory,
              2.0 * change(EntropyForm::standard).trajectory, 1e-12);
}

TEST(PathSimulation, WithoutPosesItSaysSo) {
  PathGraph graph = along_a_line();
  graph.poses.clear();
  EXPECT_THROW(PathSimulation(graph.situation(), {}, default_registry()), Error);
}

}  // namespace
}  // namespace cairn
