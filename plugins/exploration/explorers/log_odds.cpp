// SPDX-License-Identifier: BSD-3-Clause
// Maps by adding up evidence: the log odds of each scan's local map (thesis, 5.1 and 5.2).
#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "evidence_grid.hpp"
#include "floor_classifier.hpp"

namespace cairn::exploration {
namespace {

using Eigen::Vector2d;
using Eigen::Vector2i;

struct LogOddsOptions {
  double resolution = 0.1;
  double hit = 1.2, miss = 0.7, limit = 4.2;
  double free = 0.35, occupied = 0.65, tolerance = 0.25;
  double part_filled = 0.1, newest = 1.5;
  bool smooth = true;

  static auto fields() {
    using O = LogOddsOptions;
    return OptionFields<O>()
        .real("resolution", &O::resolution, 0.005, 10.0, "side of a cell [m]")
        .real("hit", &O::hit, 0.01, 10.0, "evidence of a scan that ends in a cell [log odds]")
        .real("miss", &O::miss, 0.01, 10.0, "evidence of a scan that passes a cell [log odds]")
        .real("limit", &O::limit, 0.1, 50.0, "most log odds of a cell, either way")
        .real("free", &O::free, 0.0, 0.5, "free below this probability of being occupied")
        .real("occupied", &O::occupied, 0.5, 1.0, "occupied above this probability")
        .real(
            "tolerance", &O::tolerance, 0.0, 10.0,
            "a scan is drawn again when what it shows has moved by more than this part of a cell, "
            "on average")
        .real(
            "part_filled", &O::part_filled, 0.0, 1.0,
            "paths that have room avoid a free cell in which at least this part of the scans that "
            "reach it end: a wall fills it in part")
        .real("newest", &O::newest, 0.0, 1000.0,
              "where the newest scan ends within this distance of the robot, an obstacle is in the "
              "way, whatever older scans have shown there [m]")
        .boolean("smooth", &O::smooth,
                 "unknown cells that a square of 3 × 3 does not fit into are free, if most known "
                 "ones around are (morphological opening)");
  }
};

float log_odds_of(double probability) {
  return static_cast<float>(std::log(probability / (1.0 - probability)));
}

class LogOdds final : public Mapper {
 public:
  explicit LogOdds(const LogOddsOptions& options)
      : options_(options),
        model_{.hit = options.hit,
               .miss = options.miss,
               .limit = static_cast<float>(options.limit),
               .free_below = log_odds_of(options.free),
               .occupied_above = log_odds_of(options.occupied),
               .smooth = options.smooth,
               .part_filled = options.part_filled},
        grid_(options.resolution),
        classifier_(model_) {}

  void add(const Pose2& at, LaserScan scan) override {
    check_scan(scan, fmt::format("mapper log_odds: scan {}", scans_.size()));
    Taken taken{at, 0.0, std::move(scan)};
    taken.reach = mean_range(taken.scan);
    draw(taken, 1);
    scans_.push_back(std::move(taken));
    changed_ = true;
  }

  bool move(std::span<const Pose2> poses) override {
    const std::size_t count = std::min(poses.size(), scans_.size());
    std::vector<std::size_t> moved;
    for (std::size_t k = 0; k < count; ++k) {
      if (matters(scans_[k], poses[k])) moved.push_back(k);
    }
    if (moved.empty()) return false;
    changed_ = true;
    if (2 * moved.size() > count) {
      grid_.clear();
      for (std::size_t k = 0; k < count; ++k) scans_[k].at = poses[k];
      for (const Taken& taken : scans_) draw(taken, 1);
      return true;
    }
    for (const std::size_t k : moved) {
      draw(scans_[k], -1);
      scans_[k].at = poses[k];
      draw(scans_[k], 1);
    }
    return true;
  }

  const FloorMap& map() override {
    if (std::exchange(changed_, false))
      classifier_.update(grid_, grid_.take_changed(), obstructed());
    return classifier_.map();
  }

  void reset() override {
    grid_ = EvidenceGrid(options_.resolution);
    classifier_ = FloorClassifier(model_);
    scans_.clear();
    changed_ = false;
  }

 private:
  struct Taken {
    Pose2 at;
    double reach = 0.0;  ///< mean range [m]
    LaserScan scan;
  };

  static double mean_range(const LaserScan& scan) {
    double sum = 0.0;
    int count = 0;
    for (const float range : scan.ranges) {
      if (!(range > 0.0F)) continue;
      sum += std::min<double>(range, scan.max_range);
      ++count;
    }
    return count == 0 ? 0.0 : sum / count;
  }

  bool matters(const Taken& taken, const Pose2& to) const {
    const Pose2 motion = taken.at.between(to);
    const double moved = motion.translation().norm() + std::abs(motion.theta()) * taken.reach;
    return moved > options_.tolerance * options_.resolution;
  }

  /// Calls `visit(end, point)` for each beam that has measured something: where it ends in cells,
  /// and that point [m].
  template <class Visit>
  void for_each_end(const Taken& taken, const Visit& visit) const {
    const double inset = kSurfaceInset * options_.resolution;
    const Vector2d from = taken.at.translation();
    for (std::size_t beam = 0; beam < taken.scan.ranges.size(); ++beam) {
      const double range = taken.scan.ranges[beam];
      if (!(range > 0.0)) continue;
      const bool hit = range < taken.scan.max_range;
      const double length = hit ? range + inset : taken.scan.max_range;
      const double angle = taken.at.theta() + taken.scan.angle(beam);
      const Vector2d point = from + length * Vector2d(std::cos(angle), std::sin(angle));
      visit(BeamEnd{point / options_.resolution, hit}, point);
    }
  }

  void draw(const Taken& taken, int change) {
    ends_.clear();
    const Vector2d from = taken.at.translation();
    Vector2d low = from, high = from;
    for_each_end(taken, [&](const BeamEnd& end, const Vector2d& point) {
      low = low.cwiseMin(point);
      high = high.cwiseMax(point);
      ends_.push_back(end);
    });
    cover(taken, low, high);
    grid_.count(from / options_.resolution, ends_, change);
  }

  void cover(const Taken& taken, const Vector2d& low, const Vector2d& high) {
    try {
      if (!std::isfinite(taken.at.theta()))
        throw Error(ErrorCode::input, "its heading is not finite");
      grid_.cover(low, high);
    } catch (const Error& error) {
      throw Error(error.code(), fmt::format("mapper log_odds: a scan at ({:g}, {:g}): {}",
                                            taken.at.x(), taken.at.y(), error.what()));
    }
  }

  /// The cells near the robot in which beams of the newest scan end stand in its way, whatever
  /// older scans have shown there. Farther away noise of a single scan would close doors that are
  /// open.
  std::vector<Vector2i> obstructed() const {
    std::vector<Vector2i> cells;
    if (scans_.empty()) return cells;
    const Vector2d from = scans_.back().at.translation();
    const double within = options_.newest + kSurfaceInset * options_.resolution;
    for_each_end(scans_.back(), [&](const BeamEnd& end, const Vector2d& point) {
      if (end.hit && (point - from).norm() <= within) cells.push_back(end.cell());
    });
    return cells;
  }

  LogOddsOptions options_;
  CellModel model_;
  EvidenceGrid grid_;
  FloorClassifier classifier_;
  std::vector<Taken> scans_;
  std::vector<BeamEnd> ends_;  ///< of the beams of the scan that is drawn
  bool changed_ = false;
};

}  // namespace
}  // namespace cairn::exploration

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  using namespace cairn::exploration;
  registrar.add<Mapper, LogOddsOptions>(
      "log_odds", [](const LogOddsOptions& options) { return std::make_unique<LogOdds>(options); });
}
