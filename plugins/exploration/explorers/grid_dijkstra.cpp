// SPDX-License-Identifier: BSD-3-Clause
// Paths over the cells of a map by Dijkstra's algorithm: once from where the robot is, for any
// number of goals.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <queue>
#include <utility>
#include <vector>

#include "cairn/exploration/path_planner.hpp"
#include "cairn/grid/cell_traversal.hpp"
#include "cairn/planning/free_space.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/registry.hpp"

namespace cairn::exploration {
namespace {

using Eigen::Vector2d;

struct GridDijkstraOptions {
  double margin = 0.2, weight = 2.0;

  static auto fields() {
    using O = GridDijkstraOptions;
    return OptionFields<O>()
        .real("margin", &O::margin, 0.0, 100.0,
              "paths keep so much farther from obstacles where that is no great detour [m]")
        .real("weight", &O::weight, 0.0, 1000.0,
              "of a metre with none of that margin, in metres (5 where a wall may fill a cell in "
              "part); "
              "0: the shortest paths");
  }
};

class GridDijkstra final : public PathPlanner {
 public:
  explicit GridDijkstra(const GridDijkstraOptions& options) : options_(options) {}

  void start(const FloorMap& map, const Vector2d& from, double radius) override {
    map_ = &map;
    from_ = from;
    needed_ = needed_clearance(radius, map.frame);
    cost_.assign(map.cells.size(), kFar);
    before_.assign(map.cells.size(), -1);
    const Vector2d cell = map.frame.to_cells(from).array().floor();
    const int x = static_cast<int>(cell.x()), y = static_cast<int>(cell.y());
    if (map.frame.contains(x, y)) spread(static_cast<std::int32_t>(map.frame.index(x, y)));
  }

  std::optional<PlannedPath> path_to(const Vector2d& goal, double tolerance) override {
    const std::int32_t last = nearest_cell(goal, tolerance);
    if (last < 0) return std::nullopt;
    std::vector<std::int32_t> cells;
    for (std::int32_t cell = last; cell >= 0; cell = before_[at(cell)]) cells.push_back(cell);
    std::ranges::reverse(cells);
    PlannedPath path{.points = straightened(cells), .length = 0.0, .look_at = goal};
    for (std::size_t k = 1; k < path.points.size(); ++k)
      path.length += (path.points[k] - path.points[k - 1]).norm();
    return path;
  }

 private:
  static constexpr float kFar = std::numeric_limits<float>::infinity();
  /// The cost of a metre where the body does not fit, which it leaves soon; and where it does, but
  /// may touch a wall that fills a cell in part.
  static constexpr double kTooNear = 10.0, kMayTouch = 5.0;
  static constexpr double kFartherView = 0.5;  ///< of a goal, where nothing can be touched [m]

  static std::size_t at(std::int32_t cell) { return static_cast<std::size_t>(cell); }
  int x_of(std::int32_t cell) const { return cell % map_->frame.width; }
  int y_of(std::int32_t cell) const { return cell / map_->frame.width; }
  Vector2d middle(std::int32_t cell) const { return map_->frame.centre(x_of(cell), y_of(cell)); }
  bool stands(std::int32_t cell) const { return map_->clearance[at(cell)] >= needed_; }
  float caution(std::int32_t cell) const {
    return map_->has_caution() ? map_->caution[at(cell)] : map_->clearance[at(cell)];
  }

  /// Whether the body may go from one cell to the next: where it fits; and out of where it does
  /// not, no nearer to anything than it is at the start.
  bool passable(std::int32_t from, std::int32_t to) const {
    if (stands(to)) return true;
    return !stands(from) && map_->clearance[at(to)] > 0.0F && map_->clearance[at(to)] >= least_;
  }

  /// The same for a neighbour, between whose corners the body goes only where it may be on both
  /// sides.
  bool passable(std::int32_t from, int dx, int dy) const {
    const GridFrame& frame = map_->frame;
    if (!frame.contains(x_of(from) + dx, y_of(from) + dy)) return false;
    const std::int32_t up = dy * frame.width;
    return passable(from, from + dx + up) &&
           (dx == 0 || dy == 0 || (passable(from, from + dx) && passable(from, from + up)));
  }

  /// The cost of a metre at a cell.
  double cost_at(std::int32_t cell) const {
    if (!stands(cell)) return kTooNear;
    if (options_.margin == 0.0 || options_.weight == 0.0) return 1.0;
    const double lacking = needed_ + options_.margin - caution(cell);
    if (caution(cell) < needed_) return std::max(1.0 + options_.weight, kMayTouch);
    return 1.0 + options_.weight * std::clamp(lacking / options_.margin, 0.0, 1.0);
  }

  void spread(std::int32_t start) {
    least_ = map_->clearance[at(start)];
    using Entry = std::pair<float, std::int32_t>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
    cost_[at(start)] = 0.0F;
    open.emplace(0.0F, start);
    while (!open.empty()) {
      const auto [cost, cell] = open.top();
      open.pop();
      if (cost > cost_[at(cell)]) continue;
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          if ((dx == 0 && dy == 0) || !passable(cell, dx, dy)) continue;
          const std::int32_t next = cell + dy * map_->frame.width + dx;
          if (lowers(cell, next, dx != 0 && dy != 0)) open.emplace(cost_[at(next)], next);
        }
      }
    }
  }

  bool lowers(std::int32_t cell, std::int32_t next, bool diagonal) {
    const double length = map_->frame.resolution * (diagonal ? std::sqrt(2.0) : 1.0);
    const auto cost = static_cast<float>(cost_[at(cell)] + length * cost_at(next));
    if (cost >= cost_[at(next)]) return false;
    cost_[at(next)] = cost;
    before_[at(next)] = cell;
    return true;
  }

  /// The nearest view of a goal; one a little farther away if the body can't touch anything there,
  /// as long as lengths are not all that counts.
  std::int32_t nearest_cell(const Vector2d& goal, double tolerance) const {
    const auto reached = [&](std::int32_t cell) { return cost_[at(cell)] < kFar && stands(cell); };
    const std::int32_t nearest = nearest_view(*map_, goal, tolerance, reached);
    if (nearest < 0 || caution(nearest) >= needed_ || options_.margin == 0.0 ||
        options_.weight == 0.0)
      return nearest;
    const double most = std::min(tolerance, (middle(nearest) - goal).norm() + kFartherView);
    const std::int32_t safe = nearest_view(*map_, goal, most, [&](std::int32_t cell) {
      return reached(cell) && caution(cell) >= needed_ && before_[at(cell)] >= 0;
    });
    return safe >= 0 ? safe : nearest;
  }

  /// The least clearance and caution of a path [m].
  struct Room {
    float clearance = kFar, caution = kFar;
  };

  void add(std::int32_t cell, Room& room) const {
    room.clearance = std::min(room.clearance, map_->clearance[at(cell)]);
    room.caution = std::min(room.caution, caution(cell));
  }

  /// The corners of a polyline that comes no nearer to obstacles than the cells do, up to the
  /// margin.
  std::vector<Vector2d> straightened(const std::vector<std::int32_t>& cells) const {
    std::vector<Vector2d> points{from_};
    const auto enough = static_cast<float>(needed_ + options_.margin);
    Room least;  // since the last corner
    for (std::size_t k = 1; k < cells.size(); ++k) {
      add(cells[k], least);
      const Room room{std::min(least.clearance, enough), std::min(least.caution, enough)};
      if (k == 1 || clear(points.back(), middle(cells[k]), room)) continue;
      points.push_back(middle(cells[k - 1]));
      least = {};
      add(cells[k - 1], least);
      add(cells[k], least);
    }
    if (cells.size() > 1) points.push_back(middle(cells.back()));
    return points;
  }

  bool clear(const Vector2d& from, const Vector2d& to, const Room& room) const {
    const GridFrame& frame = map_->frame;
    return traverse_cells(frame.to_cells(from), frame.to_cells(to), [&](int x, int y) {
      if (!frame.contains(x, y)) return false;
      const auto cell = static_cast<std::int32_t>(frame.index(x, y));
      return map_->clearance[at(cell)] >= room.clearance && caution(cell) >= room.caution;
    });
  }

  GridDijkstraOptions options_;
  const FloorMap* map_ = nullptr;
  Vector2d from_ = Vector2d::Zero();
  double needed_ = 0.0;
  float least_ = 0.0F;                ///< clearance at the start [m]
  std::vector<float> cost_;           ///< by cell, from the start [m, weighted]
  std::vector<std::int32_t> before_;  ///< by cell, the one before it on the path; -1: none
};

}  // namespace
}  // namespace cairn::exploration

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  using namespace cairn::exploration;
  registrar.add<PathPlanner, GridDijkstraOptions>(
      "grid_dijkstra",
      [](const GridDijkstraOptions& options) { return std::make_unique<GridDijkstra>(options); });
}
