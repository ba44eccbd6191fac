// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/entropy_field.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

FrontierView view_of(const Situation& situation, const ConfigurationSpace& space,
                     const EntropyFieldOptions& options, std::span<const BeamCell> cells) {
  if (!cells.empty()) return {space, cells, situation.robot.lidar, options.directions};
  return {space, beam_cells(situation.map), situation.robot.lidar, options.directions};
}

}  // namespace

EntropyField::EntropyField(const Situation& situation, const EntropyFieldOptions& options,
                           const Parts& parts)
    : space_(situation.map, situation.robot.radius, options.orientations),
      view_(view_of(situation, space_, options, parts.cells)),
      trajectory_(space_.size()) {
  const GridFrame& frame = situation.map.frame;
  cell_change_ = -frame.cell_area() * (std::numbers::ln2 - options.left);
  const JointObjective objective(options.objective, frame.resolution, situation.robot.lidar.range);
  const std::optional<Eigen::Matrix3d> now = newest_covariance(situation);
  if (!now) {
    throw Error(ErrorCode::numerical,
                "the newest pose has no covariance, since the graph determines it in part only: "
                "what a configuration is worth cannot be weighed");
  }
  alpha_ = objective.change(0.0, 0.0, *now, *now).alpha;
  if (!parts.loop_closures) return;
  loops_ = loop_closure_values(situation, options.objective.entropy);
  write_match_areas(situation.match);
}

/// Into all configurations in the match area of a pose goes its value, if none is better.
void EntropyField::write_match_areas(const MatchModel& match) {
  const GridFrame& frame = space_.frame();
  const double reach = std::numbers::sqrt2 * match.range / frame.resolution;
  const double turn = 2.0 * std::numbers::pi / space_.orientations();
  for (const LoopClosureValue& loop : loops_) {
    const auto change = static_cast<float>(loop.change);
    const Eigen::Vector2d middle = frame.to_cells(loop.pose.translation());
    const int first_x = static_cast<int>(std::floor(middle.x() - reach));
    const int first_y = static_cast<int>(std::floor(middle.y() - reach));
    const int last_x = static_cast<int>(std::floor(middle.x() + reach));
    const int last_y = static_cast<int>(std::floor(middle.y() + reach));
    const int first = static_cast<int>(std::ceil((loop.pose.theta() - match.angle) / turn));
    const int last =
        std::min(static_cast<int>(std::floor((loop.pose.theta() + match.angle) / turn)),
                 first + space_.orientations() - 1);
    for (int y = first_y; y <= last_y; ++y) {
      for (int x = first_x; x <= last_x; ++x) {
        const std::int32_t number = space_.number(x, y);
        if (number < 0) continue;
        const Eigen::Vector2d apart = loop.pose.transform_to(frame.centre(x, y));
        if (apart.cwiseAbs().maxCoeff() > match.range) continue;
        for (int k = first; k <= last; ++k) {
          float& value = trajectory_[space_.index(number, k)];
          value = std::min(value, change);
        }
      }
    }
  }
}

std::optional<std::size_t> EntropyField::best(std::span<const char> cells) const {
  const std::size_t layer = space_.cells().size();
  std::optional<std::size_t> found;
  double least = 0.0;
  for (std::size_t k = 0, configuration = 0; configuration < space_.size(); ++configuration) {
    if (cells[k] != 0 && value(configuration) < least) {
      least = value(configuration);
      found = configuration;
    }
    if (++k == layer) k = 0;
  }
  return found;
}

}  // namespace cairn
