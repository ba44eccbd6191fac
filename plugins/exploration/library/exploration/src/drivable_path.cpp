// SPDX-License-Identifier: BSD-3-Clause
// Paths for a robot that can't turn in place.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <queue>
#include <utility>
#include <vector>

#include "arc_length.hpp"
#include "cairn/exploration/dubins_curve.hpp"
#include "cairn/exploration/path_planner.hpp"
#include "path_costs.hpp"

namespace cairn {
namespace {

using Eigen::Vector2d;
using std::numbers::pi;

/// Curves are planned with a turning radius that is so much larger, so that the robot can steer
/// back onto them.
constexpr double kSpareRadius = 1.1;
/// Headings that the search tells apart, and the poses that it looks at before it gives up.
constexpr int kHeadings = 32;
constexpr std::size_t kMostPoses = 60000;
/// Curves to the goal are tried less often the more were not free: half as often after so many, a
/// third after twice as many.
constexpr std::size_t kTries = 64;
/// Arcs of the search cross a cell: this long at least [cells].
constexpr double kArcCells = 1.5;
/// A metre on an arc costs so much more than a straight one.
constexpr double kTurnCost = 0.05;
/// A metre backwards, where the lidar does not look, costs so many metres ahead, and each change of
/// direction so many [m].
constexpr double kBackCost = 2.0, kCuspCost = 1.0;
/// Headings at the end of a path: this far apart [rad], so much of the lidar's aperture to either
/// side of what it shall see, and no more than the most.
constexpr double kHeadingStep = pi / 12.0, kSeenPart = 0.4, kMostAside = pi / 3.0;
/// Nearer than this there is no direction to look in [m]. A path that is followed ends as near.
constexpr double kThere = 0.15;
/// A path is followed on a way that is longer by this factor at most.
constexpr double kDetour = 1.1;

/// Where a body may be: in cells with some clearance; and a robot that is too near to an obstacle
/// may leave it, coming no nearer.
class Room {
 public:
  Room(const FloorMap& map, double needed) : map_(&map), needed_(needed) {}

  double needed() const { return needed_; }
  double stride() const { return 0.5 * map_->frame.resolution; }
  /// −1 outside.
  double clearance(const Vector2d& point) const {
    const Vector2d cell = map_->frame.to_cells(point).array().floor();
    const GridFrame& frame = map_->frame;
    if (!(cell.x() >= 0.0 && cell.y() >= 0.0 && cell.x() < frame.width && cell.y() < frame.height))
      return -1.0;
    return map_->clearance[frame.index(static_cast<int>(cell.x()), static_cast<int>(cell.y()))];
  }
  /// Whether the body can go on from where the clearance was `before`, which is advanced.
  bool admits(const Vector2d& point, double& before) const {
    const double here = clearance(point);
    if (here < needed_ && (here <= 0.0 || here < before)) return false;
    before = here;
    return true;
  }
  /// Whether a way may lead there as far as the clearance at its ends says, which becomes no less
  /// than at its start, unless it is enough.
  bool may_lead(const Vector2d& from, const Vector2d& to) const {
    return clearance(to) >= std::min(clearance(from), needed_);
  }

 private:
  const FloorMap* map_;
  double needed_;
};

/// What a path needs: what the body does, or less where the path leads through a gap that seems
/// too narrow on the map.
double needed_along(const PlannedPath& path, const Vector2d& from, const RobotModel& robot,
                    const FloorMap& map) {
  const double most = needed_clearance(robot.radius, map.frame);
  const Room room(map, most);
  double least = most;
  bool leaving = true;
  Vector2d at = from;
  for (const Vector2d& point : path.points) {
    const int strides = 1 + static_cast<int>((point - at).norm() / room.stride());
    for (int k = 1; k <= strides; ++k) {
      const double here = room.clearance(at + (point - at) * (double(k) / strides));
      leaving = leaving && here < most;
      if (!leaving) least = std::min(least, here);
    }
    at = point;
  }
  return std::clamp(least, most - map.frame.resolution, most);
}

/// Whether a robot that follows the path as it is comes near no obstacle, and to its end without a
/// detour.
bool is_followed(const PlannedPath& path, const Pose2& from, const RobotModel& robot,
                 const Room& room) {
  std::size_t passed = 0;
  Pose2 at = from;
  double before = room.clearance(from.translation()), driven = 0.0;
  const double most = kDetour * path.length + kThere;
  while (const std::optional<Pose2> motion = next_motion(at, path, robot, passed)) {
    const double length = arc_length(*motion);
    driven += std::abs(length);
    if (!(std::abs(length) > 1e-6) || driven > most) return false;
    const int strides = 1 + static_cast<int>(std::abs(length) / room.stride());
    for (int k = 1; k <= strides; ++k) {
      const double part = double(k) / strides;
      const Pose2 on = at * along_arc(motion->theta() / length, part * length);
      if (!room.admits(on.translation(), before)) return false;
    }
    at = at * *motion;
  }
  if (!path.points.empty() && (path.points.back() - at.translation()).norm() > kThere) return false;
  if (!path.look_at || (*path.look_at - at.translation()).norm() < kThere) return true;
  const Vector2d seen = at.transform_to(*path.look_at);
  return std::abs(std::atan2(seen.y(), seen.x())) <=
         std::max(0.5 * robot.lidar.aperture, kHeadingStep);
}

/// Hybrid A* from a pose to the end of a path: arcs and straight lines of one length from pose to
/// pose, ahead and backwards, of which one for each cell and heading is kept, and from some of them
/// Dubins curves that end at the goal exactly.
class CurveSearch {
 public:
  /// `interrupt`: once it is true there is no curve; may be null.
  CurveSearch(const PlannedPath& path, const RobotModel& robot, const FloorMap& map, double needed,
              const std::atomic<bool>* interrupt)
      : path_(path),
        map_(map),
        interrupt_(interrupt),
        room_(map, needed),
        radius_(kSpareRadius * robot.turning_radius),
        arc_(std::max(kArcCells * map.frame.resolution, radius_ * 2.0 * pi / kHeadings)),
        goals_(goals(path, robot)),
        costs_(path, map, needed, interrupt) {
    const int strides = 1 + static_cast<int>(arc_ / room_.stride());
    for (const double way : {1.0, -1.0}) {
      for (const int turn : {0, 1, -1}) {
        const double curvature = turn / radius_;
        Arc arc{.turn = turn, .way = way, .on = {}, .end = along_arc(curvature, way * arc_)};
        for (int k = 1; k <= strides; ++k) {
          arc.on.push_back(
              along_arc(curvature, way * (arc_ * (double(k) / strides))).translation());
        }
        arcs_.push_back(std::move(arc));
      }
    }
  }

  /// The points of a curve; none: there is none.
  std::optional<PlannedPath> from(const Pose2& start) {
    const double clearance = room_.clearance(start.translation());
    if (clearance >= room_.needed() && !std::isfinite(left(start))) return std::nullopt;
    seen_.assign(map_.frame.size() * kHeadings, false);
    nodes_.push_back({.at = start, .clearance = clearance});
    open_.push({left(start), 0});
    std::size_t expanded = 0;
    while (!open_.empty() && expanded < kMostPoses && !interrupted()) {
      const std::size_t index = open_.top().second;
      open_.pop();
      const Node node = nodes_[index];
      const std::optional<std::size_t> key = key_of(node.at);
      if (!key || seen_[*key]) continue;
      seen_[*key] = true;
      if (tries_goal(node, expanded++)) {
        if (const auto curve = curve_to_goal(node)) return joined(index, *curve);
        ++tries_;
      }
      const Eigen::Matrix2d R = node.at.rotation().matrix();
      for (const Arc& arc : arcs_) expand(index, arc, R);
    }
    return std::nullopt;
  }

 private:
  struct Node {
    Pose2 at;
    double cost = 0.0, clearance = 0.0;
    std::size_t parent = 0;
    int turn = 0;      ///< of the arc that leads here
    double way = 1.0;  ///< ahead; −1: backwards
  };
  /// From a pose at the origin, what the search goes on by.
  struct Arc {
    int turn = 0;
    double way = 1.0;
    std::vector<Vector2d> on;  ///< the positions that are looked at, the end among them
    Pose2 end;
  };
  struct Goal {
    Pose2 at;
    double aside = 0.0;  ///< how far off the heading that is best [rad]
  };
  using Open = std::pair<double, std::size_t>;

  bool interrupted() const { return interrupt_ && interrupt_->load(std::memory_order_relaxed); }

  static std::vector<Goal> goals(const PlannedPath& path, const RobotModel& robot) {
    const Vector2d end = path.points.back();
    Vector2d ahead = path.look_at ? Vector2d(*path.look_at - end) : Vector2d::Zero();
    double most = std::clamp(kSeenPart * robot.lidar.aperture, kHeadingStep, kMostAside);
    if (ahead.norm() < kThere) {
      most = pi;
      const std::size_t points = path.points.size();
      ahead = points > 1 ? Vector2d(end - path.points[points - 2]) : Vector2d(1.0, 0.0);
    }
    const double theta = std::atan2(ahead.y(), ahead.x());
    std::vector<Goal> all{{Pose2(end.x(), end.y(), theta), 0.0}};
    for (double aside = kHeadingStep; aside <= most; aside += kHeadingStep) {
      for (const double side : {1.0, -1.0})
        all.push_back({Pose2(end.x(), end.y(), theta + side * aside), aside});
    }
    return all;
  }

  std::optional<std::size_t> cell_of(const Vector2d& point) const {
    if (room_.clearance(point) < 0.0) return std::nullopt;
    const Vector2d cell = map_.frame.to_cells(point).array().floor();
    return map_.frame.index(static_cast<int>(cell.x()), static_cast<int>(cell.y()));
  }

  std::optional<std::size_t> key_of(const Pose2& at) const {
    const std::optional<std::size_t> cell = cell_of(at.translation());
    if (!cell) return std::nullopt;
    const double part = (at.theta() + pi) / (2.0 * pi);
    const int heading = std::clamp(static_cast<int>(part * kHeadings), 0, kHeadings - 1);
    return *cell * kHeadings + static_cast<std::size_t>(heading);
  }

  /// What the way to the goal costs, about.
  double left(const Pose2& at) const {
    const Vector2d apart = goals_.front().at.translation() - at.translation();
    const std::optional<std::size_t> cell = cell_of(at.translation());
    const bool fits = cell && map_.clearance[*cell] >= room_.needed();
    return fits ? std::max(costs_.to_end(*cell), apart.norm()) : apart.norm();
  }

  /// Whether the body can go along a curve from a node.
  bool is_free(const DubinsCurve& curve, const Node& from) const {
    double clearance = from.clearance;
    Pose2 piece = from.at;  // where it begins
    for (std::size_t k = 0; k < curve.lengths.size(); ++k) {
      const double length = curve.lengths[k], curvature = curve.turns[k] / curve.radius;
      const Eigen::Matrix2d R = piece.rotation().matrix();
      const int strides = 1 + static_cast<int>(length / room_.stride());
      for (int stride = 1; stride <= strides; ++stride) {
        const Vector2d on = along_arc(curvature, length * (double(stride) / strides)).translation();
        if (!room_.admits(piece.translation() + R * on, clearance)) return false;
      }
      piece = piece * along_arc(curvature, length);
    }
    return true;
  }

  /// `R`: of the heading of that node.
  void expand(std::size_t index, const Arc& arc, const Eigen::Matrix2d& R) {
    const Node from = nodes_[index];
    const auto [turn, way] = std::pair(arc.turn, arc.way);
    Node next{.at = from.at * arc.end,
              .clearance = from.clearance,
              .parent = index,
              .turn = turn,
              .way = way};
    const std::optional<std::size_t> key = key_of(next.at);
    if (!key || seen_[*key]) return;
    const double ahead = left(next.at);
    if (!std::isfinite(ahead)) return;
    for (const Vector2d& on : arc.on) {
      if (!room_.admits(from.at.translation() + R * on, next.clearance)) return;
    }
    const double per_metre = costs_.per_metre(*key / kHeadings) + (turn != 0 ? kTurnCost : 0.0);
    next.cost = from.cost + arc_ * per_metre * (way < 0.0 ? kBackCost : 1.0) +
                (way != from.way ? kCuspCost : 0.0);
    open_.push({next.cost + ahead, nodes_.size()});
    nodes_.push_back(next);
  }

  /// Rarely while the goal is far, and the more rarely the more curves were not free.
  bool tries_goal(const Node& node, std::size_t count) const {
    const auto every = 1 + static_cast<std::size_t>(left(node.at) / (4.0 * arc_));
    return count % (every * (1 + tries_ / kTries)) == 0;
  }

  /// The curve that costs least to any of the headings at the goal.
  std::optional<DubinsCurve> curve_to_goal(const Node& node) const {
    std::optional<DubinsCurve> best;
    double least = std::numeric_limits<double>::infinity();
    for (const Goal& goal : goals_) {
      const double cost = radius_ * goal.aside;
      const auto curve = free_curve(node, goal.at, least - cost);
      if (!curve) continue;
      least = curve->length() + cost;
      best = curve;
    }
    return best;
  }

  /// The shortest Dubins curve of those shorter than `most` along which the body can go.
  std::optional<DubinsCurve> free_curve(const Node& node, const Pose2& to, double most) const {
    for (const DubinsCurve& curve : dubins_curves(node.at.between(to), radius_)) {
      if (curve.length() >= most) break;
      if (is_free(curve, node)) return curve;
    }
    return std::nullopt;
  }

  /// From the start to a node, and from there to the goal. Dubins curves take the place of what the
  /// search has pieced together where they are shorter.
  PlannedPath joined(std::size_t last, const DubinsCurve& to_goal) const {
    std::vector<std::size_t> chain{last};
    while (chain.back() != 0) chain.push_back(nodes_[chain.back()].parent);
    std::ranges::reverse(chain);
    PlannedPath result{.points = {}, .look_at = path_.look_at, .radius = path_.radius};
    result.points.push_back(nodes_.front().at.translation());
    double way = 1.0;
    const auto drive = [&](double next) {
      if (std::exchange(way, next) != next) result.cusps.push_back(result.points.size() - 1);
    };
    for (std::size_t k = 0; k + 1 < chain.size();) {
      drive(nodes_[chain[k + 1]].way);
      k = append_shortcut(chain, k, result);
    }
    drive(1.0);
    append(nodes_[last].at, to_goal, result);
    return result;
  }

  /// A curve from a node to the farthest one behind it, in the same direction, to which there is a
  /// shorter one than the arcs; returns where it leads.
  std::size_t append_shortcut(const std::vector<std::size_t>& chain, std::size_t from,
                              PlannedPath& result) const {
    const Node& node = nodes_[chain[from]];
    const Node& next = nodes_[chain[from + 1]];
    constexpr double kRounding = 1e-6;
    std::size_t farthest = from;
    while (farthest + 1 < chain.size() && nodes_[chain[farthest + 1]].way > 0.0) ++farthest;
    for (std::size_t to = farthest; to > from + 1; --to) {
      const double arcs = arc_ * static_cast<double>(to - from);
      const auto curve = free_curve(node, nodes_[chain[to]].at, arcs + kRounding);
      if (!curve) continue;
      append(node.at, *curve, result);
      return to;
    }
    append(
        arc_, [&](double s) { return node.at * along_arc(next.turn / radius_, next.way * s); },
        result);
    return from + 1;
  }

  void append(const Pose2& from, const DubinsCurve& curve, PlannedPath& result) const {
    append(
        curve.length(), [&](double distance) { return from * curve.at(distance); }, result);
  }

  template <class Along>
  void append(double length, Along&& at, PlannedPath& result) const {
    const int strides = 1 + static_cast<int>(length / room_.stride());
    for (int k = 1; k <= strides; ++k)
      result.points.push_back(at(length * (double(k) / strides)).translation());
    result.length += length;
  }

  const PlannedPath& path_;
  const FloorMap& map_;
  const std::atomic<bool>* interrupt_;
  Room room_;
  double radius_, arc_;
  std::vector<Goal> goals_;
  PathCosts costs_;
  std::vector<Arc> arcs_;
  std::vector<bool> seen_;  ///< cells and headings that the search has gone on from
  std::vector<Node> nodes_;
  std::priority_queue<Open, std::vector<Open>, std::greater<>> open_;
  std::size_t tries_ = 0;  ///< of curves to the goal
};

}  // namespace

std::optional<PlannedPath> drivable_path(PlannedPath path, const Pose2& at, const RobotModel& robot,
                                         const FloorMap& map, const std::atomic<bool>* interrupt) {
  if (robot.motion != MotionModel::dubins) return path;
  if (path.points.empty()) path.points.emplace_back(at.translation());
  const double needed = needed_along(path, at.translation(), robot, map);
  const auto keeps = [&](const PlannedPath& curve, double clearance) {
    return is_followed(curve, at, robot, Room(map, clearance));
  };
  if (keeps(path, needed)) return path;
  const auto curve_with = [&](double clearance) -> std::optional<PlannedPath> {
    if (!Room(map, clearance).may_lead(at.translation(), path.points.back())) return std::nullopt;
    return CurveSearch(path, robot, map, clearance, interrupt).from(at);
  };
  std::optional<PlannedPath> curve = curve_with(needed);
  if (!curve || keeps(*curve, needed)) return curve;
  // Steering strays from curves: one with room for that is better.
  const double spare = 0.5 * map.frame.resolution;
  std::optional<PlannedPath> wider = curve_with(needed + spare);
  if (wider && keeps(*wider, needed)) return wider;
  if (!keeps(*curve, needed - spare)) return std::nullopt;
  return curve;
}

}  // namespace cairn
