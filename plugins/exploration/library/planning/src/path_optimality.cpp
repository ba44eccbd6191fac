// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/path_optimality.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/LU>

#include "cairn/information/graph_information.hpp"
#include "cairn/runtime/error.hpp"
#include "in_sight.hpp"
#include "match_index.hpp"
#include "path_determinants.hpp"
#include "pose_covariances.hpp"
#include "pose_laplacian.hpp"

namespace cairn {
class PathOptimalities::Model {
 public:
  virtual ~Model() = default;
  virtual PathOptimality along(std::span<const Pose2> motions) = 0;
  const PathOptimality& now() const { return now_; }

 protected:
  PathOptimality now_;
};

namespace {

/// By |Λ|.
class ExactOptimalities final : public PathOptimalities::Model {
 public:
  ExactOptimalities(const Situation& situation, const PathOptimalityOptions& options,
                    LinearSolver& solver)
      : determinants_(situation, options.loop_gain,
                      [&map = situation.map](const Pose2& older, const Pose2& newer) {
                        return in_sight(map, older, newer);
                      }) {
    const GraphEntropy graph = entropy(situation.estimator.graph(), solver);
    now_.size = static_cast<int>(graph.size);
    now_.log_determinant = graph.log_determinant;
    if (const auto since = motion_since_newest(situation)) {
      now_.size += 3;
      now_.log_determinant -= std::log(situation.robot.odometry.covariance(*since).determinant());
    }
    finish(now_);
  }

  PathOptimality along(std::span<const Pose2> motions) override {
    const PathDeterminants::Path added = determinants_.along(motions);
    PathOptimality path = now_;
    path.size += 3 * static_cast<int>(motions.size());
    path.log_determinant += added.log_determinant;
    path.loops = added.loops;
    path.length = added.length;
    finish(path);
    return path;
  }

 private:
  static void finish(PathOptimality& of) {
    of.log_optimality = of.size == 0 ? 0.0 : of.log_determinant / of.size;
  }

  PathDeterminants determinants_;
};

/// By |L|: as `PathInformation`, with one number for each pose.
class LaplacianOptimalities final : public PathOptimalities::Model {
 public:
  LaplacianOptimalities(const Situation& situation, const PathOptimalityOptions& options,
                        LinearSolver& solver)
      : situation_(situation),
        loop_gain_(situation.match.loop_gain_unless(options.loop_gain)),
        match_weight_(edge_weight(situation.match.covariance())),
        laplacian_(situation.estimator.graph(), situation.poses, solver),
        poses_(poses_of(situation)),
        index_(poses_, situation.pose, situation.match),
        newest_(static_cast<int>(poses_.size()) - 1) {
    now_.size = laplacian_.free() + 1;
    now_.log_determinant = laplacian_.log_determinant();
    if (const auto since = motion_since_newest(situation)) {
      const double weight = edge_weight(situation.robot.odometry.covariance(*since));
      now_.size += 1;
      now_.log_determinant += std::log(weight);
      since_ = 1.0 / weight;
    }
    finish(now_);
  }

  PathOptimality along(std::span<const Pose2> motions) override {
    PathOptimality path = now_;
    closures_.clear();
    Pose2 at = situation_.pose;
    double resistance = since_;  // of the path so far
    for (const Pose2& motion : motions) {
      at = at * motion;
      path.length += motion.translation().norm();
      const double weight = edge_weight(situation_.robot.odometry.covariance(motion));
      path.size += 1;
      path.log_determinant += std::log(weight);
      resistance += 1.0 / weight;
      path.log_determinant += close(at, resistance);
    }
    path.loops = static_cast<int>(closures_.size());
    finish(path);
    return path;
  }

 private:
  /// A loop closure on a path, between a pose of the graph and one of the path.
  struct Closure {
    int pose = -1;
    double resistance = 0.0;  ///< of the path up to the other pose
    std::vector<double> row;  ///< of the factor of the closures' joint variance, to its diagonal
  };

  static std::vector<Pose2> poses_of(const Situation& situation) {
    std::vector<Pose2> poses;
    for (const Id id : situation.poses)
      poses.push_back(Pose2::from_state(situation.estimator.state(id)));
    return poses;
  }

  static void finish(PathOptimality& of) {
    of.log_optimality = (std::log(of.size) + of.log_determinant) / of.size;
  }

  /// Closes the loop of most gain, if there is one; the change of ln |L|.
  double close(const Pose2& at, double resistance) {
    Closure best;
    double most = 0.0;
    index_.for_each(at, [&](int pose) {
      const Pose2& older = poses_[static_cast<std::size_t>(pose)];
      if (!in_sight(situation_.map, older, at)) return;
      joined(pose, resistance);
      const double variance = row_.back() * row_.back();
      const double change = std::log(variance * match_weight_);  // ln(1 + w R)
      if (!(1.5 * change > loop_gain_) || !(change > most)) return;
      most = change;
      best = {pose, resistance, row_};
    });
    if (best.pose >= 0) closures_.push_back(std::move(best));
    return most;
  }

  /// The row of the Cholesky factor that a closure would add, behind those before.
  void joined(int pose, double resistance) {
    row_.clear();
    const double tt = laplacian_.inverse(newest_, newest_);
    const double t = laplacian_.inverse(pose, newest_);
    double squares = 0.0;
    for (const Closure& other : closures_) {
      double covariance = tt + std::min(resistance, other.resistance) - t -
                          laplacian_.inverse(other.pose, newest_) +
                          laplacian_.inverse(pose, other.pose);
      for (std::size_t k = 0; k < row_.size(); ++k) covariance -= other.row[k] * row_[k];
      row_.push_back(covariance / other.row.back());
      squares += row_.back() * row_.back();
    }
    const double own = tt + resistance - 2.0 * t + laplacian_.inverse(pose, pose);
    row_.push_back(std::sqrt(own + 1.0 / match_weight_ - squares));
  }

  const Situation& situation_;
  double loop_gain_, match_weight_;
  PoseLaplacian laplacian_;
  std::vector<Pose2> poses_;
  MatchIndex index_;
  int newest_;
  double since_ = 0.0;             ///< resistance from the last pose that is kept to the robot
  std::vector<Closure> closures_;  ///< of the path at hand
  std::vector<double> row_;
};

std::unique_ptr<PathOptimalities::Model> make_model(const Situation& situation,
                                                    const PathOptimalityOptions& options,
                                                    LinearSolver& solver) {
  if (situation.poses.empty())
    throw Error(ErrorCode::usage, "the optimality of paths needs a pose graph");
  if (!query<LogDeterminant>(solver)) {
    throw Error(ErrorCode::usage,
                "the optimality of paths: this linear solver lacks the ability 'log_determinant'; "
                "block_cholesky has it");
  }
  if (options.by == OptimalityForm::exact)
    return std::make_unique<ExactOptimalities>(situation, options, solver);
  return std::make_unique<LaplacianOptimalities>(situation, options, solver);
}

}  // namespace

PathOptimalities::PathOptimalities(const Situation& situation, const PathOptimalityOptions& options,
                                   LinearSolver& solver)
    : model_(make_model(situation, options, solver)) {}
PathOptimalities::PathOptimalities(PathOptimalities&&) noexcept = default;
PathOptimalities& PathOptimalities::operator=(PathOptimalities&&) noexcept = default;
PathOptimalities::~PathOptimalities() = default;

const PathOptimality& PathOptimalities::now() const { return model_->now(); }

PathOptimality PathOptimalities::along(std::span<const Pose2> motions) {
  return model_->along(motions);
}

}  // namespace cairn
