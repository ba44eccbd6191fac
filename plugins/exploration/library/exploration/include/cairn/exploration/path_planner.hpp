// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <optional>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/exploration/world.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/component.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

/// A path over known free floor.
struct PlannedPath {
  std::vector<Eigen::Vector2d> points;          ///< of a polyline, from where the robot is [m]
  double length = 0.0;                          ///< [m]
  std::optional<Eigen::Vector2d> look_at = {};  ///< towards which the robot turns at its end [m]
  /// Radius of the body for which it was planned [m]; 0: the robot's.
  double radius = 0.0;
  /// Of a robot that can't turn in place, ascending: the points where it changes its direction. It
  /// drives ahead as far as the first of them, backwards from there to the second, and so on.
  std::vector<std::size_t> cusps = {};
};

/// How near an obstacle, or an unknown cell, the centre of a round body may come: its radius and
/// half a cell [m], compared with `FloorMap::clearance`.
inline double needed_clearance(double radius, const GridFrame& frame) {
  return radius + 0.5 * frame.resolution;
}

/// Radius of a body that is a cell narrower on each side, at least half as wide [m]. On a map,
/// whose cells are occupied as a whole, a robot may seem not to fit through a door that is wide
/// enough.
inline double narrow_radius(double radius, const GridFrame& frame) {
  return std::max(radius - frame.resolution, 0.5 * radius);
}

/// Finds paths for a robot with a round body.
class CAIRN_API PathPlanner : public Component {
 public:
  static constexpr std::string_view kKind = "path_planner";
  ~PathPlanner() override;

  /// From here on paths begin at `from` [m]. The map must outlive the last `path_to`.
  virtual void start(const FloorMap& map, const Eigen::Vector2d& from, double radius) = 0;
  /// A path as near to `goal` as the body can come, with only free cells in between, at whose end
  /// the robot looks at it; none: there is no such place within `tolerance` [m]. Its cells have
  /// `needed_clearance`, but for those in which a robot that begins too near to an obstacle leaves
  /// it.
  virtual std::optional<PlannedPath> path_to(const Eigen::Vector2d& goal, double tolerance) = 0;
};

/// The next motion along a path, as far as `robot.step` and `robot.turn` allow in one:
/// `differential` turns first and then drives straight, `holonomic` drives at once and turns to
/// where it drives on the way, `dubins` takes the arc to a point ahead on the path, or behind it
/// where it backs, no narrower than its turning radius (pure pursuit): it follows the paths that
/// `drivable_path` returns.
/// `passed` counts the points of the path that are behind the robot, and is advanced. None: it is
/// there, and looks where it shall, which `dubins` does only if the path leads it so.
CAIRN_API std::optional<Pose2> next_motion(const Pose2& at, const PlannedPath& path,
                                           const RobotModel& robot, std::size_t& passed);

/// The path as the robot can drive it from `at`, with the same end: as it is for robots that turn
/// in place, and for `dubins` where following it comes near no obstacle; otherwise along arcs and
/// Dubins curves, searched on the map near the path (hybrid A*: Dolgov, Thrun, Montemerlo and
/// Diebel, 2010), with points a few centimetres apart, and at the end a heading with `look_at`
/// before the lidar. It backs where that is shorter by far, or where nothing else leads on (a car
/// of Reeds and Shepp). None: there is no such curve; or `interrupt`, if not null, has become true,
/// which ends the search at once.
CAIRN_API std::optional<PlannedPath> drivable_path(PlannedPath path, const Pose2& at,
                                                   const RobotModel& robot, const FloorMap& map,
                                                   const std::atomic<bool>* interrupt = nullptr);

}  // namespace cairn
