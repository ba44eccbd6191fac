// SPDX-License-Identifier: BSD-3-Clause
// Maps by adding up evidence: the log odds of each scan's local map (thesis, 5.1 and 5.2).
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/grid/cell_traversal.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::exploration {
namespace {

using Eigen::Vector2d;

struct LogOddsOptions {
  double resolution = 0.1;
  double hit = 0.9, miss = 0.7, limit = 4.2;
  double free = 0.35, occupied = 0.65, tolerance = 0.25;
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
        .boolean("smooth", &O::smooth,
                 "unknown cells that a square of 3 × 3 does not fit into are free, if most known "
                 "ones around are (morphological opening)");
  }
};

float log_odds_of(double probability) {
  return static_cast<float>(std::log(probability / (1.0 - probability)));
}

/// In how many scans a cell was passed by a beam, and in how many one ended in it.
struct Evidence {
  std::int32_t misses = 0, hits = 0;
};

/// A grid that grows with what is added to it. Its cells stand on multiples of their side. Counts
/// are integers, so that taking out what was added leaves no trace.
class EvidenceGrid {
 public:
  explicit EvidenceGrid(double resolution) { frame_.resolution = resolution; }

  const GridFrame& frame() const { return frame_; }
  const std::vector<Evidence>& evidence() const { return evidence_; }
  void clear() { std::ranges::fill(evidence_, Evidence{}); }

  /// Makes sure that a box [m] is on it.
  void cover(const Vector2d& low, const Vector2d& high) {
    const double side = frame_.resolution;
    constexpr double kFar = 1e6;  // cells, of which 10⁸ are most
    if (!(low.cwiseAbs().maxCoeff() < kFar * side && high.cwiseAbs().maxCoeff() < kFar * side)) {
      throw Error(ErrorCode::input,
                  "mapper log_odds: a scan at a pose that is not finite, or too far away");
    }
    Eigen::Vector2i first = (low / side).array().floor().cast<int>();
    Eigen::Vector2i last = (high / side).array().floor().cast<int>();
    const Eigen::Vector2i size(frame_.width, frame_.height);
    if (frame_.width > 0) {
      if ((first.array() >= first_.array()).all() && (last.array() < (first_ + size).array()).all())
        return;
      first = first.cwiseMin(first_);
      last = last.cwiseMax(first_ + size - Eigen::Vector2i::Ones());
    }
    const Eigen::Vector2i margin = Eigen::Vector2i::Constant(kMargin);
    grow(first - margin, last + margin);
  }

  /// Adds (1) or takes out (−1) a scan: each cell counts once, and one in which a beam ends is not
  /// passed. Points are in cells of the world, so that they mean the same cells whatever the grid
  /// covers; beams end at these, and the flag is whether at an obstacle.
  void count(const Vector2d& from, const std::vector<std::pair<Vector2d, bool>>& ends, int change) {
    ++scan_;
    for (const auto& [end, is_hit] : ends) {
      if (!is_hit) continue;
      const Vector2d cell = end.array().floor();
      if (Evidence* cell_there = unmarked(static_cast<int>(cell.x()), static_cast<int>(cell.y())))
        cell_there->hits += change;
    }
    for (const auto& [end, is_hit] : ends) {
      traverse_cells(from, end, [&](int x, int y) {
        if (Evidence* cell = unmarked(x, y)) cell->misses += change;
        return true;
      });
    }
  }

 private:
  static constexpr int kMargin = 20;  // cells, so that it does not grow with every scan

  /// The cell, if this scan has not been there, and marks it.
  Evidence* unmarked(int world_x, int world_y) {
    const int x = world_x - first_.x(), y = world_y - first_.y();
    if (!frame_.contains(x, y)) return nullptr;
    const std::size_t index = frame_.index(x, y);
    if (std::exchange(marked_[index], scan_) == scan_) return nullptr;
    return &evidence_[index];
  }

  void grow(const Eigen::Vector2i& first, const Eigen::Vector2i& last) {
    GridFrame frame = frame_;
    const Eigen::Vector2i size = last - first + Eigen::Vector2i::Ones();
    frame.width = size.x();
    frame.height = size.y();
    frame.origin = first.cast<double>() * frame.resolution;
    check_frame(frame, "mapper log_odds");
    std::vector<Evidence> evidence(static_cast<std::size_t>(frame.size()));
    const Eigen::Vector2i shift = first_ - first;
    for (int y = 0; y < frame_.height; ++y) {
      std::copy_n(&evidence_[frame_.index(0, y)], frame_.width,
                  &evidence[frame.index(shift.x(), y + shift.y())]);
    }
    evidence_ = std::move(evidence);
    marked_.assign(evidence_.size(), 0);
    scan_ = 0;
    frame_ = frame;
    first_ = first;
  }

  GridFrame frame_;
  Eigen::Vector2i first_ = Eigen::Vector2i::Zero();  ///< cell (0, 0), counted from the world's
  std::vector<Evidence> evidence_;
  std::vector<std::uint32_t> marked_;  ///< the last scan that has marked the cell
  std::uint32_t scan_ = 0;
};

class LogOdds final : public Mapper {
 public:
  explicit LogOdds(const LogOddsOptions& options)
      : options_(options),
        free_below_(log_odds_of(options.free)),
        occupied_above_(log_odds_of(options.occupied)),
        grid_(options.resolution) {}

  void add(const Pose2& at, LaserScan scan) override {
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
    if (std::exchange(changed_, false)) classify();
    return map_;
  }

  void reset() override {
    grid_ = EvidenceGrid(options_.resolution);
    scans_.clear();
    map_ = {};
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

  /// Calls `visit(end, hit)` for each beam that has measured something: where it ends [m], and
  /// whether at an obstacle, in whose cell that is.
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
      visit(from + length * Vector2d(std::cos(angle), std::sin(angle)), hit);
    }
  }

  void draw(const Taken& taken, int change) {
    ends_.clear();
    const Vector2d from = taken.at.translation();
    Vector2d low = from, high = from;
    for_each_end(taken, [&](const Vector2d& end, bool hit) {
      low = low.cwiseMin(end);
      high = high.cwiseMax(end);
      ends_.emplace_back(end / options_.resolution, hit);
    });
    grid_.cover(low, high);
    grid_.count(from / options_.resolution, ends_, change);
  }

  void classify() {
    map_.frame = grid_.frame();
    const auto limit = static_cast<float>(options_.limit);
    map_.log_odds.resize(grid_.evidence().size());
    std::ranges::transform(grid_.evidence(), map_.log_odds.begin(), [&](const Evidence& cell) {
      const double sum = options_.hit * cell.hits - options_.miss * cell.misses;
      return std::clamp(static_cast<float>(sum), -limit, limit);
    });
    map_.cells.resize(map_.log_odds.size());
    std::ranges::transform(map_.log_odds, map_.cells.begin(), [&](float value) {
      if (value < free_below_) return CellState::free;
      return value > occupied_above_ ? CellState::occupied : CellState::unknown;
    });
    if (options_.smooth) fill_specks();
    find_clearance();
    find_frontiers();
  }

  cv::Mat mask(CellState state) const {
    cv::Mat result(map_.frame.height, map_.frame.width, CV_8U);
    std::ranges::transform(map_.cells, result.ptr<std::uint8_t>(),
                           [&](CellState cell) { return cell == state ? 255 : 0; });
    return result;
  }

  void fill_specks() {
    const cv::Mat unknown = mask(CellState::unknown);
    cv::Mat opened;
    // What lies outside the grid is unknown.
    cv::copyMakeBorder(unknown, opened, 2, 2, 2, 2, cv::BORDER_CONSTANT, cv::Scalar(255));
    cv::morphologyEx(opened, opened, cv::MORPH_OPEN, cv::Mat::ones(3, 3, CV_8U));
    const cv::Mat kept = opened(cv::Rect(2, 2, unknown.cols, unknown.rows));
    const std::vector<CellState> before = map_.cells;
    for (int y = 0; y < map_.frame.height; ++y) {
      for (int x = 0; x < map_.frame.width; ++x) {
        const bool speck = unknown.at<std::uint8_t>(y, x) != 0 && kept.at<std::uint8_t>(y, x) == 0;
        if (speck && mostly_free(before, x, y))
          map_.cells[map_.frame.index(x, y)] = CellState::free;
      }
    }
  }

  /// Of the known cells around one, the most are free.
  bool mostly_free(const std::vector<CellState>& cells, int x, int y) const {
    int free = 0, occupied = 0;
    for (int v = y - 1; v <= y + 1; ++v) {
      for (int u = x - 1; u <= x + 1; ++u) {
        if (!map_.frame.contains(u, v)) continue;
        const CellState state = cells[map_.frame.index(u, v)];
        free += state == CellState::free;
        occupied += state == CellState::occupied;
      }
    }
    return free > 2 * occupied;
  }

  void find_clearance() {
    cv::Mat free = mask(CellState::free);
    // What the robot sees right now stands in its way, whatever older scans have shown there.
    if (!scans_.empty()) {
      const Taken& newest = scans_.back();
      for_each_end(newest, [&](const Vector2d& end, bool hit) {
        const Vector2d cell = map_.frame.to_cells(end).array().floor();
        if (hit) free.at<std::uint8_t>(static_cast<int>(cell.y()), static_cast<int>(cell.x())) = 0;
      });
    }
    cv::Mat padded, distance;
    cv::copyMakeBorder(free, padded, 1, 1, 1, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
    cv::distanceTransform(padded, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE, CV_32F);
    map_.clearance.resize(map_.cells.size());
    const auto side = static_cast<float>(map_.frame.resolution);
    for (int y = 0; y < map_.frame.height; ++y) {
      const float* row = distance.ptr<float>(y + 1) + 1;
      std::transform(row, row + map_.frame.width, &map_.clearance[map_.frame.index(0, y)],
                     [&](float cells) { return cells * side; });
    }
  }

  bool beside_unknown(int x, int y) const {
    constexpr std::array<std::array<int, 2>, 4> kSides{{{-1, 0}, {1, 0}, {0, -1}, {0, 1}}};
    return std::ranges::any_of(kSides, [&](const std::array<int, 2>& side) {
      const int u = x + side[0], v = y + side[1];
      return !map_.frame.contains(u, v) || map_.cells[map_.frame.index(u, v)] == CellState::unknown;
    });
  }

  void find_frontiers() {
    cv::Mat border(map_.frame.height, map_.frame.width, CV_8U, cv::Scalar(0));
    for (int y = 0; y < map_.frame.height; ++y) {
      for (int x = 0; x < map_.frame.width; ++x) {
        if (map_.cells[map_.frame.index(x, y)] == CellState::free && beside_unknown(x, y))
          border.at<std::uint8_t>(y, x) = 255;
      }
    }
    cv::Mat label;
    const int count = cv::connectedComponents(border, label, 8, CV_32S) - 1;
    map_.frontiers.assign(static_cast<std::size_t>(count), {});
    for (int y = 0; y < map_.frame.height; ++y) {
      for (int x = 0; x < map_.frame.width; ++x) {
        if (const int part = label.at<int>(y, x); part > 0)
          map_.frontiers[static_cast<std::size_t>(part) - 1].cells.push_back(
              static_cast<std::int32_t>(map_.frame.index(x, y)));
      }
    }
    for (Frontier& frontier : map_.frontiers) measure(frontier);
    std::ranges::stable_sort(map_.frontiers, std::ranges::greater{}, &Frontier::length);
  }

  void measure(Frontier& frontier) const {
    const auto point = [&](std::int32_t index) {
      return map_.frame.centre(index % map_.frame.width, index / map_.frame.width);
    };
    Vector2d mean = Vector2d::Zero();
    for (const std::int32_t cell : frontier.cells) mean += point(cell);
    mean /= static_cast<double>(frontier.cells.size());
    const auto apart = [&](std::int32_t cell) { return (point(cell) - mean).squaredNorm(); };
    frontier.middle = point(*std::ranges::min_element(frontier.cells, {}, apart));
    frontier.length = static_cast<double>(frontier.cells.size()) * map_.frame.resolution;
  }

  LogOddsOptions options_;
  float free_below_, occupied_above_;
  EvidenceGrid grid_;
  std::vector<Taken> scans_;
  std::vector<std::pair<Vector2d, bool>> ends_;  ///< of a scan's beams, and whether they hit
  FloorMap map_;
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
