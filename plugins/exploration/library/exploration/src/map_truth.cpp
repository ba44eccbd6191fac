// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/map_truth.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

struct Cell {
  int x, y;
};

Cell cell_at(const GridFrame& frame, const Eigen::Vector2d& point) {
  const Eigen::Vector2d cells = frame.to_cells(point).array().floor();
  if (!(cells.cwiseAbs().maxCoeff() < 1e9)) return {-1, -1};
  return {static_cast<int>(cells.x()), static_cast<int>(cells.y())};
}

CellState state_of(const OccupancyGrid& floor, const Cell& cell) {
  if (!floor.frame.contains(cell.x, cell.y)) return CellState::unknown;
  return CellThresholds{}.state(floor.occupancy[floor.frame.index(cell.x, cell.y)]);
}

/// Free cells that hang together with the one at the start, over sides.
std::vector<std::uint8_t> connected_free(const OccupancyGrid& floor, const Cell& start) {
  std::vector<std::uint8_t> connected(floor.occupancy.size());
  std::vector<Cell> open;
  const auto reach = [&](const Cell& cell) {
    if (state_of(floor, cell) != CellState::free) return;
    std::uint8_t& seen = connected[floor.frame.index(cell.x, cell.y)];
    if (seen == 0) open.push_back(cell);
    seen = 1;
  };
  reach(start);
  while (!open.empty()) {
    const Cell cell = open.back();
    open.pop_back();
    reach({cell.x - 1, cell.y});
    reach({cell.x + 1, cell.y});
    reach({cell.x, cell.y - 1});
    reach({cell.x, cell.y + 1});
  }
  return connected;
}

/// Whether a cell within `distance` of the point is not free.
bool near_obstacle(const OccupancyGrid& floor, const Eigen::Vector2d& point, double distance) {
  const Cell middle = cell_at(floor.frame, point);
  const int reach = static_cast<int>(std::ceil(distance / floor.frame.resolution));
  for (int y = middle.y - reach; y <= middle.y + reach; ++y) {
    for (int x = middle.x - reach; x <= middle.x + reach; ++x) {
      if (state_of(floor, {x, y}) == CellState::free) continue;
      if ((floor.frame.centre(x, y) - point).norm() <= distance) return true;
    }
  }
  return false;
}

}  // namespace

MapTruth compare_with_floor(const FloorMap& map, const OccupancyGrid& floor, const Pose2& alignment,
                            const Eigen::Vector2d& start, std::span<const std::uint8_t> reachable) {
  if (!reachable.empty() && reachable.size() != floor.occupancy.size())
    throw Error(ErrorCode::usage, "what a robot can reach is not by the cells of its floor");
  MapTruth result;
  const std::vector<std::uint8_t> connected = connected_free(floor, cell_at(floor.frame, start));
  // Of the floor, by its own cells: what of it the map knows.
  std::size_t all = 0, seen = 0, all_reachable = 0, reachable_seen = 0;
  for (int y = 0; y < floor.frame.height; ++y) {
    for (int x = 0; x < floor.frame.width; ++x) {
      const std::size_t index = floor.frame.index(x, y);
      const bool is_reachable = !reachable.empty() && reachable[index] != 0;
      if (connected[index] == 0 && !is_reachable) continue;
      const Cell cell = cell_at(map.frame, alignment.transform_to(floor.frame.centre(x, y)));
      const bool known = map.frame.contains(cell.x, cell.y) &&
                         map.cells[map.frame.index(cell.x, cell.y)] != CellState::unknown;
      all += connected[index];
      seen += connected[index] != 0 && known;
      all_reachable += is_reachable;
      reachable_seen += is_reachable && known;
    }
  }
  if (all_reachable > 0)
    result.reachable_seen =
        static_cast<double>(reachable_seen) / static_cast<double>(all_reachable);
  result.floor = static_cast<double>(all) * floor.frame.cell_area();
  result.seen = static_cast<double>(seen) * floor.frame.cell_area();
  // Of the map, by its cells: what is otherwise on the floor.
  std::size_t free_wrong = 0, occupied_wrong = 0;
  for (int y = 0; y < map.frame.height; ++y) {
    for (int x = 0; x < map.frame.width; ++x) {
      const CellState state = map.cells[map.frame.index(x, y)];
      if (state == CellState::unknown) continue;
      const Eigen::Vector2d point = alignment * Point2(map.frame.centre(x, y));
      const bool free = state_of(floor, cell_at(floor.frame, point)) == CellState::free;
      if (state == CellState::free && !free) ++free_wrong;
      if (state == CellState::occupied && free &&
          !near_obstacle(floor, point, map.frame.resolution))
        ++occupied_wrong;
    }
  }
  result.free_wrong = static_cast<double>(free_wrong) * map.frame.cell_area();
  result.occupied_wrong = static_cast<double>(occupied_wrong) * map.frame.cell_area();
  return result;
}

namespace {

/// Unit vectors along the beams of scans, in the robot's frame; kept as long as the scans are of
/// one lidar.
class BeamDirections {
 public:
  const std::vector<Eigen::Vector2d>& of(const LaserScan& scan) {
    if (scan.first_angle != first_angle_ || scan.angle_step != angle_step_) directions_.clear();
    first_angle_ = scan.first_angle;
    angle_step_ = scan.angle_step;
    for (std::size_t beam = directions_.size(); beam < scan.ranges.size(); ++beam)
      directions_.emplace_back(std::cos(scan.angle(beam)), std::sin(scan.angle(beam)));
    return directions_;
  }

 private:
  double first_angle_ = 0.0, angle_step_ = 0.0;
  std::vector<Eigen::Vector2d> directions_;
};

/// Calls `visit` with each cell of the map in which a beam of a scan ends.
template <class Visit>
void for_each_end(const FloorMap& map, const LaserScan& scan, const Pose2& pose,
                  BeamDirections& directions, Visit&& visit) {
  const std::vector<Eigen::Vector2d>& beams = directions.of(scan);
  const Eigen::Matrix2d R = pose.rotation().matrix();
  for (std::size_t beam = 0; beam < scan.ranges.size(); ++beam) {
    double range = scan.ranges[beam];
    if (!(range > 0.0) || range >= scan.max_range) continue;
    range += kSurfaceInset * map.frame.resolution;
    const Cell cell = cell_at(map.frame, R * (range * beams[beam]) + pose.translation());
    if (map.frame.contains(cell.x, cell.y)) visit(cell);
  }
}

bool beside_occupied(const FloorMap& map, const Cell& cell) {
  for (int y = cell.y - 1; y <= cell.y + 1; ++y) {
    for (int x = cell.x - 1; x <= cell.x + 1; ++x) {
      if (map.frame.contains(x, y) && map.cells[map.frame.index(x, y)] == CellState::occupied)
        return true;
    }
  }
  return false;
}

}  // namespace

double contradicted_area(const FloorMap& map, std::span<const LaserScan> scans,
                         std::span<const Pose2> poses) {
  std::vector<std::uint8_t> hit(map.cells.size());
  std::size_t count = 0;
  BeamDirections directions;
  for (std::size_t k = 0; k < scans.size(); ++k) {
    for_each_end(map, scans[k], poses[k], directions, [&](const Cell& cell) {
      const std::size_t index = map.frame.index(cell.x, cell.y);
      count += map.cells[index] == CellState::free && hit[index] == 0;
      hit[index] = 1;
    });
  }
  return static_cast<double>(count) * map.frame.cell_area();
}

std::vector<double> scan_agreement(const FloorMap& map, std::span<const LaserScan> scans,
                                   std::span<const Pose2> poses) {
  std::vector<double> parts;
  parts.reserve(scans.size());
  BeamDirections directions;
  for (std::size_t k = 0; k < scans.size(); ++k) {
    int ends = 0, agreeing = 0;
    for_each_end(map, scans[k], poses[k], directions, [&](const Cell& cell) {
      ++ends;
      agreeing += beside_occupied(map, cell);
    });
    parts.push_back(ends > 0 ? static_cast<double>(agreeing) / ends
                             : std::numeric_limits<double>::quiet_NaN());
  }
  return parts;
}

MapAgreement map_agreement(std::span<const double> scans) {
  MapAgreement result;
  std::vector<std::size_t> measured;
  for (std::size_t k = 0; k < scans.size(); ++k)
    if (!std::isnan(scans[k])) measured.push_back(k);
  if (measured.empty()) return result;
  const std::size_t row = std::min(kAgreementScans, measured.size());
  double sum = 0.0, all = 0.0;
  for (std::size_t k = 0; k < measured.size(); ++k) {
    all += scans[measured[k]];
    sum += scans[measured[k]];
    if (k >= row) sum -= scans[measured[k - row]];
    const double mean = sum / static_cast<double>(row);
    if (k + 1 < row || mean >= result.least) continue;
    result.least = mean;
    result.first = measured[k + 1 - row];
  }
  result.mean = all / static_cast<double>(measured.size());
  return result;
}

}  // namespace cairn
