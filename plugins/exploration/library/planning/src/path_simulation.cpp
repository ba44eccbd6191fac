// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/path_simulation.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include <Eigen/LU>

#include "cairn/exploration/exploration.hpp"
#include "cairn/information/gaussian.hpp"
#include "cairn/planning/path_motions.hpp"
#include "cairn/runtime/error.hpp"
#include "in_sight.hpp"
#include "match_index.hpp"

namespace cairn {
namespace {

using Eigen::Matrix3d;

[[noreturn]] void fail_singular() {
  throw Error(ErrorCode::numerical,
              "the pose graph has no covariances: its information matrix is singular");
}

}  // namespace

PathSimulation::PathSimulation(const Situation& situation, const PathSimulationOptions& options,
                               Registry& registry)
    : situation_(situation),
      options_(options),
      registry_(registry),
      seen_(situation.map, situation.robot.lidar,
            std::min(options.simulated_range, situation.robot.lidar.range)) {
  if (situation.poses.empty())
    throw Error(ErrorCode::usage, "a simulated drive needs a pose graph");
  for (const Id id : situation.poses)
    poses_.push_back(Pose2::from_state(situation.estimator.state(id)));
  entropy_now_ = trajectory_entropy(situation.estimator, situation.poses, situation.first_sigma);
  if (std::isnan(entropy_now_)) fail_singular();
}

SimulatedDrive PathSimulation::drive(const PlannedPath& path) const {
  SimulatedDrive drive;
  SimulatedGraph graph(situation_, registry_);
  graph.update();
  MatchIndex index(poses_, situation_.pose, situation_.match);
  CellSet cells = seen_.none();
  Pose2 at = situation_.pose;
  for (const Pose2& motion : motions_along(at, path, situation_.robot)) {
    at = at * motion;
    ++drive.motions;
    drive.length += motion.translation().norm();
    graph.add(at);
    graph.update();
    if (const auto found = closure(graph, index, at)) {
      graph.close(found->older);
      graph.update();
      drive.closures.push_back(*found);
    }
    cells.add(seen_.look({&at, 1}));
  }
  const double entropy =
      trajectory_entropy(graph.estimator(), graph.poses(), situation_.first_sigma);
  if (std::isnan(entropy)) fail_singular();
  // (5.13) is of the thesis's entropy, which is twice the standard one but for a constant.
  const double factor = options_.entropy == EntropyForm::standard ? 0.5 : 1.0;
  drive.cells = cells.count();
  drive.change = {.trajectory = factor * (entropy - entropy_now_),
                  .map = seen_.entropy_change(drive.cells)};
  drive.poses = graph.poses();
  return drive;
}

std::optional<SimulatedDrive::Closure> PathSimulation::closure(SimulatedGraph& graph,
                                                               MatchIndex& index,
                                                               const Pose2& at) const {
  std::vector<Id> ids;
  std::vector<Pose2> poses;
  index.for_each(at, [&](int number) {
    const Pose2& older = poses_[static_cast<std::size_t>(number)];
    if (!in_sight(situation_.map, older, at)) return;
    ids.push_back(situation_.poses[static_cast<std::size_t>(number)]);
    poses.push_back(older);
  });
  if (ids.empty()) return std::nullopt;
  const Id newest = graph.poses().back();
  std::vector<Id> rows = ids;
  rows.push_back(newest);
  Eigen::MatrixXd column(static_cast<Eigen::Index>(3 * rows.size()), 3);
  const std::span out(column.data(), static_cast<std::size_t>(column.size()));
  if (!graph.estimator().covariance_column(newest, rows, out)) fail_singular();
  const Matrix3d kk = column.bottomRows<3>();
  const Matrix3d moved = at.between(poses_.front()).adjoint();
  const Matrix3d prior =
      moved * situation_.first_sigma.array().square().matrix().asDiagonal() * moved.transpose();
  const Matrix3d R = situation_.match.covariance();
  const double loop_gain = situation_.match.loop_gain_unless(options_.loop_gain);
  SimulatedDrive::Closure best{.newer = newest};
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < ids.size(); ++k) {
    // y = δ_k − Ad(x_k⁻¹ x_l) δ_l on the right tangents, and noise.
    const Matrix3d A = at.between(poses[k]).adjoint();
    Matrix3d ll;
    if (!graph.estimator().covariance(ids[k], ids[k], {ll.data(), 9})) fail_singular();
    const Matrix3d kl = column.middleRows<3>(static_cast<Eigen::Index>(3 * k)).transpose();
    const Matrix3d K = kk - kl * A.transpose();
    const Matrix3d S = K - A * (kl.transpose() - ll * A.transpose());
    const double gain = information_gain(S, R);
    if (!(gain > loop_gain)) continue;
    const Matrix3d after = kk + prior - K * (S + R).inverse() * K.transpose();
    const double determinant = after.determinant();
    if (!(determinant < least)) continue;
    least = determinant;
    best.older = ids[k];
    best.gain = gain;
  }
  if (!std::isfinite(least)) return std::nullopt;
  return best;
}

}  // namespace cairn
