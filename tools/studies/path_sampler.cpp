// SPDX-License-Identifier: BSD-3-Clause
#include "path_sampler.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "cairn/grid/ray_caster.hpp"
#include "cairn/planning/path_motions.hpp"
#include "cairn/planning/seen_cells.hpp"
#include "cairn/planning/simulated_graph.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

/// Rays over known obstacles, with what is unknown, and all around the map, free.
RayCaster over_obstacles(const FloorMap& map, double range) {
  const int margin = static_cast<int>(std::ceil(range / map.frame.resolution)) + 1;
  OccupancyGrid grid{.frame = map.frame, .occupancy = {}};
  grid.frame.width += 2 * margin;
  grid.frame.height += 2 * margin;
  grid.frame.origin = map.frame.to_world(Eigen::Vector2d::Constant(-margin));
  grid.occupancy.assign(static_cast<std::size_t>(grid.frame.size()), 0);
  for (int y = 0; y < map.frame.height; ++y) {
    for (int x = 0; x < map.frame.width; ++x) {
      if (map.cells[map.frame.index(x, y)] == CellState::occupied)
        grid.occupancy[grid.frame.index(x + margin, y + margin)] = 100;
    }
  }
  return RayCaster(grid);
}

PoseGaussian gaussian_of(Estimator& estimator, std::span<const Id> poses) {
  PoseGaussian gaussian;
  for (const Id id : poses) gaussian.mean.push_back(Pose2::from_state(estimator.state(id)));
  const std::vector<double> covariance = joint_covariance(estimator, poses, 3);
  const auto size = static_cast<Eigen::Index>(3 * poses.size());
  gaussian.covariance = Eigen::Map<const Eigen::MatrixXd>(covariance.data(), size, size);
  return gaussian;
}

/// The mean of differences, and its standard error.
std::pair<double, double> paired(std::span<const double> before, std::span<const double> after) {
  const auto count = static_cast<double>(before.size());
  double sum = 0.0, squares = 0.0;
  for (std::size_t k = 0; k < before.size(); ++k) sum += after[k] - before[k];
  const double mean = sum / count;
  for (std::size_t k = 0; k < before.size(); ++k) {
    const double error = after[k] - before[k] - mean;
    squares += error * error;
  }
  return {mean, std::sqrt(squares / (count * (count - 1.0)))};
}

}  // namespace

class PathSampler::Model {
 public:
  Model(const Situation& situation, std::span<const LaserScan> scans, std::span<const Pose2> poses,
        Mapper& mapper, Registry& registry, const PathSamplerOptions& options, std::uint64_t seed)
      : situation_(situation),
        mapper_(mapper),
        registry_(registry),
        options_(options),
        seed_(seed),
        information_(situation, options.information),
        seen_(situation.map, situation.robot.lidar, options.range),
        rays_(over_obstacles(situation.map, options.range)),
        beams_(beam_directions(situation.robot.lidar)),
        hits_(beams_.size()) {
    if (scans.size() != poses.size())
      throw Error(ErrorCode::usage, "path sampler: there are not as many scans as poses");
    const PoseGaussian now = gaussian_of(situation.estimator, situation.poses);
    for (std::size_t k = 0; k < scans.size(); ++k) {
      const auto next = std::ranges::upper_bound(situation.poses, static_cast<Id>(k));
      const auto pose =
          static_cast<std::size_t>(std::max<std::ptrdiff_t>(next - situation.poses.begin() - 1, 0));
      scans_.push_back({pose, now.mean[pose].between(poses[k]), scans[k]});
    }
    before_ = sampled_map_entropy(now, scans_, mapper_, options_.samples, seed_).samples;
  }

  SampledPath sample(const PlannedPath& path) {
    const std::vector<Pose2> motions = motions_along(situation_.pose, path, situation_.robot);
    std::vector<PathInformation::State> states;
    PathInformation::State state = information_.start();
    SampledPath result;
    result.now = state.covariance();
    for (const Pose2& motion : motions) {
      state = information_.extended(state, motion);
      states.push_back(state);
    }
    result.length = state.length();
    result.loops = state.loops();
    result.trajectory = state.trajectory_change();
    result.end = state.covariance();
    result.map = seen_.entropy_change(cells_seen(states));
    std::tie(result.sampled_map, result.standard_error) = sampled_change(states);
    return result;
  }

 private:
  std::size_t cells_seen(std::span<const PathInformation::State> states) const {
    CellSet cells = seen_.none();
    for (const PathInformation::State& state : states) {
      const Pose2 pose = state.pose();
      cells.add(seen_.look({&pose, 1}));
    }
    return cells.count();
  }

  std::pair<double, double> sampled_change(std::span<const PathInformation::State> states) {
    SimulatedGraph graph = extended(states);
    std::vector<AttachedScan> scans = scans_;
    const std::size_t first = graph.poses().size() - states.size();
    for (std::size_t k = 0; k < states.size(); ++k)
      scans.push_back({first + k, Pose2(), expected_scan(states[k].pose())});
    const PoseGaussian poses = gaussian_of(graph.estimator(), graph.poses());
    return paired(before_,
                  sampled_map_entropy(poses, scans, mapper_, options_.samples, seed_).samples);
  }

  LaserScan expected_scan(const Pose2& at) {
    const LidarModel& lidar = situation_.robot.lidar;
    LaserScan scan{.first_angle = lidar.first_angle(),
                   .angle_step = lidar.step(),
                   .max_range = options_.range,
                   .ranges = {}};
    rays_.cast(at.translation(), at.theta(), beams_, options_.range, hits_);
    scan.ranges.reserve(hits_.size());
    for (const RayHit& hit : hits_)
      scan.ranges.push_back(static_cast<float>(hit.hit ? hit.range : options_.range));
    return scan;
  }

  /// The graph with the poses and loop closures of a path.
  SimulatedGraph extended(std::span<const PathInformation::State> states) const {
    SimulatedGraph graph(situation_, registry_);
    for (const PathInformation::State& state : states) {
      graph.add(state.pose());
      if (const std::optional<Id> other = state.closes_with()) graph.close(*other);
    }
    graph.update();
    return graph;
  }

  const Situation& situation_;
  Mapper& mapper_;
  Registry& registry_;
  PathSamplerOptions options_;
  std::uint64_t seed_;
  PathInformation information_;
  SeenCells seen_;
  RayCaster rays_;
  std::vector<Eigen::Vector2d> beams_;
  std::vector<RayHit> hits_;
  std::vector<AttachedScan> scans_;
  std::vector<double> before_;
};

PathSampler::PathSampler(const Situation& situation, std::span<const LaserScan> scans,
                         std::span<const Pose2> poses, Mapper& mapper, Registry& registry,
                         const PathSamplerOptions& options, std::uint64_t seed)
    : model_(std::make_unique<Model>(situation, scans, poses, mapper, registry, options, seed)) {}
PathSampler::~PathSampler() = default;

SampledPath PathSampler::sample(const PlannedPath& path) { return model_->sample(path); }

}  // namespace cairn
