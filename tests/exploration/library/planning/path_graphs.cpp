// SPDX-License-Identifier: BSD-3-Clause
#include "path_graphs.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include <Eigen/Dense>

#include "cairn/exploration/exploration.hpp"
#include "exploration/library/exploration/drawn_map.hpp"

namespace cairn::test {
namespace {

Information information_of(const Eigen::Matrix3d& covariance) {
  return Information::covariance(covariance);
}

Pose2 noisy(const Pose2& motion, const Eigen::Vector3d& sigma, RandomNumbers& random) {
  // Braces, so that every compiler draws in this order.
  const Eigen::Vector3d xi{sigma[0] * random.gaussian(), sigma[1] * random.gaussian(),
                           sigma[2] * random.gaussian()};
  return motion.retract(xi);
}

Pose2 random_motion(const Pose2& at, double side, RandomNumbers& random) {
  const bool leaves = std::max(std::abs(at.x()), std::abs(at.y())) > 0.5 * side;
  const Eigen::Vector2d home = at.transform_to(Eigen::Vector2d(0.0, 0.0));
  const double turn =
      leaves ? std::clamp(std::atan2(home.y(), home.x()), -0.5, 0.5) : 0.25 * random.gaussian();
  return {random.uniform(0.2, 0.5), 0.02 * random.gaussian(), turn};
}

bool matches(const Pose2& older, const Pose2& newer, const MatchModel& match) {
  const Pose2 seen = older.between(newer);
  return std::abs(seen.x()) <= match.range && std::abs(seen.y()) <= match.range &&
         std::abs(seen.theta()) <= match.angle;
}

PathGraph empty_graph() {
  PathGraph graph;
  graph.estimator = default_registry().make<Estimator>("incremental_cholesky");
  graph.robot.odometry = {.absolute = {0.02, 0.015, 0.01}, .relative = 0.1};
  return graph;
}

}  // namespace

PathGraph wandering(int poses, double side, std::uint64_t seed) {
  constexpr int kLag = 10;
  PathGraph graph = empty_graph();
  RandomNumbers random(seed);
  std::vector<Pose2> truth{Pose2(0.0, 0.0, random.uniform(-3.0, 3.0))};
  GraphUpdate update;
  Variable first = make_variable(0, truth.front());
  first.fixed = true;
  update.variables.push_back(first);
  graph.poses.push_back(0);
  Pose2 estimate = truth.front();
  for (Id id = 1; id < poses; ++id) {
    const Pose2 motion = random_motion(truth.back(), side, random);
    const Pose2 measured = noisy(motion, graph.robot.odometry.sigma(motion), random);
    truth.push_back(truth.back() * motion);
    estimate = estimate * measured;
    update.variables.push_back(make_variable(id, estimate));
    update.factors.push_back(make_factor(Between(id - 1, id, measured),
                                         information_of(graph.robot.odometry.covariance(motion))));
    for (Id other = 0; other + kLag < id; ++other) {
      const Pose2& older = truth[static_cast<std::size_t>(other)];
      if (!matches(older, truth.back(), graph.match) || !random.chance(0.4)) continue;
      update.factors.push_back(make_factor(
          Between(other, id, noisy(older.between(truth.back()), graph.match.sigma, random)),
          information_of(graph.match.covariance())));
    }
    graph.poses.push_back(id);
  }
  graph.estimator->update(update, {.full = true});
  graph.pose = Pose2::from_state(graph.estimator->state(graph.poses.back()));
  return graph;
}

PathGraph straight(int poses, const Pose2& motion) {
  PathGraph graph = empty_graph();
  GraphUpdate update;
  Pose2 at(1.0, -2.0, 0.4);
  for (Id id = 0; id < poses; ++id) {
    Variable pose = make_variable(id, at);
    pose.fixed = id == 0;
    update.variables.push_back(pose);
    if (id > 0) {
      update.factors.push_back(make_factor(
          Between(id - 1, id, motion), information_of(graph.robot.odometry.covariance(motion))));
    }
    graph.poses.push_back(id);
    graph.pose = at;
    at = at * motion;
  }
  graph.estimator->update(update, {.full = true});
  return graph;
}

PathGraph partly_explored(std::uint64_t seed) {
  test::PathGraph graph = wandering(60, 8.0, seed);
  constexpr int kSide = 64;
  RandomNumbers random(seed);
  std::vector<std::string> rows(kSide, std::string(kSide, '.'));
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      char& cell = rows[static_cast<std::size_t>(y)][static_cast<std::size_t>(x)];
      if (std::max(std::abs(x - 32), std::abs(y - 32)) > 15) cell = '?';
      const bool near = std::max(std::abs(x - 32), std::abs(y - 32)) < 4;
      if (random.chance(0.01) && !near) cell = '#';
    }
  }
  graph.map = drawn_map(rows, 0.25);
  graph.map.frame.origin = graph.pose.translation() - Eigen::Vector2d(8.0, 8.0);
  graph.robot.lidar.beams = 61;
  if (seed % 2 == 1) graph.robot.lidar.aperture = 0.7;  // less than a turn on the spot may be
  return graph;
}

std::vector<Pose2> random_motions(Pose2 at, int count, double side, RandomNumbers& random) {
  std::vector<Pose2> motions;
  for (int k = 0; k < count; ++k) {
    motions.push_back(random_motion(at, side, random));
    at = at * motions.back();
  }
  return motions;
}

std::unique_ptr<Estimator> with_path(const PathGraph& graph, const PathInformation::State& path,
                                     std::vector<Id>& poses) {
  std::vector<PathInformation::State> states;
  for (PathInformation::State state = path; state.steps() > 0; state = state.before())
    states.push_back(state);
  std::ranges::reverse(states);
  GraphUpdate update;
  poses = graph.poses;
  Pose2 last = graph.pose;
  for (const PathInformation::State& state : states) {
    const Id id = poses.back() + 1;
    const Pose2 motion = last.between(state.pose());
    update.variables.push_back(make_variable(id, state.pose()));
    update.factors.push_back(make_factor(Between(poses.back(), id, motion),
                                         information_of(graph.robot.odometry.covariance(motion))));
    if (const auto other = state.closes_with()) {
      const Pose2 older = Pose2::from_state(graph.estimator->state(*other));
      update.factors.push_back(make_factor(Between(*other, id, older.between(state.pose())),
                                           information_of(graph.match.covariance())));
    }
    last = state.pose();
    poses.push_back(id);
  }
  std::unique_ptr<Estimator> copy = graph.estimator->clone();
  copy->update(update);
  return copy;
}

FullInference infer(const PathGraph& graph, const PathInformation::State& path) {
  std::vector<Id> poses;
  const std::unique_ptr<Estimator> estimator = with_path(graph, path, poses);
  FullInference result;
  result.trajectory_entropy = trajectory_entropy(*estimator, poses, graph.first_sigma) -
                              trajectory_entropy(*graph.estimator, graph.poses, graph.first_sigma);
  const Pose2 first = Pose2::from_state(estimator->state(poses.front()));
  const Eigen::Matrix3d prior = graph.first_sigma.array().square().matrix().asDiagonal();
  for (const Id id : poses) {
    std::array<double, 9> block{};
    estimator->covariance(id, id, block);
    const Eigen::Matrix3d Ad = Pose2::from_state(estimator->state(id)).between(first).adjoint();
    result.end = Eigen::Map<const Eigen::Matrix3d>(block.data()) + Ad * prior * Ad.transpose();
    result.log_determinants.push_back(std::log(result.end.determinant()));
  }
  return result;
}

double dense_log_determinant(Estimator& estimator, const std::vector<Id>& poses) {
  const std::vector<Id> free(poses.begin() + 1, poses.end());
  const std::vector<double> numbers = joint_covariance(estimator, free, 3);
  const auto n = static_cast<Eigen::Index>(3 * free.size());
  const Eigen::MatrixXd Sigma = Eigen::Map<const Eigen::MatrixXd>(numbers.data(), n, n);
  const Eigen::MatrixXd L = Eigen::LLT<Eigen::MatrixXd>(Sigma).matrixL();
  return 2.0 * L.diagonal().array().log().sum();
}

}  // namespace cairn::test
