// SPDX-License-Identifier: BSD-3-Clause
#include "correlation.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace cairn::icp {
namespace {

using Eigen::Vector2d;

/// Of the grid, and step of positions [m]; step of orientations [rad].
constexpr double kCell = 0.1, kAngleStep = 0.026;
/// Standard deviation of the likelihood about a surface [m]: a little more than a cell.
constexpr double kBlur = 0.12;
/// Candidates have at least this part of the best one's score, and there are at most so many.
constexpr double kLeastScore = 0.7;
constexpr std::ptrdiff_t kMostCandidates = 10;
/// So many positions are added at a time, which compilers turn into vector instructions.
constexpr int kLane = 16;
/// A point adds up to this; so many points at most do not overflow 16 bits.
constexpr double kCertain = 255.0;
constexpr int kMostPoints = 256;
/// The likelihood is zero beyond so many standard deviations.
constexpr double kTail = 2.5;
/// Neighbouring points of the reference that are no further apart than this are joined, where they
/// are on one surface [m].
constexpr double kJoined = 0.6;
/// Two maxima that are nearer than this in all coordinates are one [steps].
constexpr int kApart = 3;

int steps(double length, double step) {
  return std::max(0, static_cast<int>(std::ceil(length / step - 1e-9)));
}

/// A scan's points, of many only as many as can be added up, evenly.
std::vector<Vector2d> thinned(std::span<const Vector2d> points) {
  const std::size_t stride = (points.size() + kMostPoints - 1) / kMostPoints;
  std::vector<Vector2d> kept;
  for (std::size_t k = 0; k < points.size(); k += stride) kept.push_back(points[k]);
  return kept;
}

/// All scores: by orientation, then y, then x.
struct Scores {
  int turns, rows, columns, row;
  std::vector<std::uint16_t> values;

  std::size_t index(int turn, int y, int x) const {
    return (static_cast<std::size_t>(turn) * static_cast<std::size_t>(rows) +
            static_cast<std::size_t>(y)) *
               static_cast<std::size_t>(row) +
           static_cast<std::size_t>(x);
  }
  /// Whether none of the neighbours is better; of equal ones the first counts.
  bool is_maximum(int turn, int y, int x) const {
    const std::size_t own = index(turn, y, x);
    for (int t = std::max(0, turn - 1); t <= std::min(turns - 1, turn + 1); ++t) {
      for (int v = std::max(0, y - 1); v <= std::min(rows - 1, y + 1); ++v) {
        for (int u = std::max(0, x - 1); u <= std::min(columns - 1, x + 1); ++u) {
          const std::size_t other = index(t, v, u);
          if (values[other] > values[own] || (values[other] == values[own] && other < own))
            return false;
        }
      }
    }
    return true;
  }
};

struct Peak {
  std::uint16_t score;
  int turn, y, x;
};

std::vector<Peak> peaks(const Scores& scores, double least) {
  const std::uint16_t best = *std::ranges::max_element(scores.values);
  const auto limit = static_cast<std::uint16_t>(std::max(1.0, least * best));
  std::vector<Peak> found;
  for (int turn = 0; turn < scores.turns; ++turn) {
    for (int y = 0; y < scores.rows; ++y) {
      for (int x = 0; x < scores.columns; ++x) {
        const std::uint16_t score = scores.values[scores.index(turn, y, x)];
        if (score >= limit && scores.is_maximum(turn, y, x)) found.push_back({score, turn, y, x});
      }
    }
  }
  std::ranges::stable_sort(found, std::greater{}, &Peak::score);
  return found;
}

bool apart(const Peak& a, const Peak& b) {
  return std::abs(a.turn - b.turn) >= kApart || std::abs(a.y - b.y) >= kApart ||
         std::abs(a.x - b.x) >= kApart;
}

}  // namespace

Correlation::Correlation(const SurfaceScan& reference, const SearchWindow& window)
    : window_(window),
      reach_x_(steps(window.x, kCell)),
      reach_y_(steps(window.y, kCell)),
      turns_(steps(window.angle, kAngleStep)),
      row_((2 * reach_x_ + kLane) / kLane * kLane) {
  rasterise(reference);
}

void Correlation::rasterise(const SurfaceScan& reference) {
  if (reference.size() == 0) return;
  Vector2d low = reference.point(0), high = low;
  for (const Vector2d& point : reference.points()) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  // A point whose window reaches beyond the table is left out: so it must reach far enough.
  const double tail = kTail * kBlur;
  const Vector2d margin =
      Vector2d(row_ + 1, 2 * reach_y_ + 1) * kCell + Vector2d::Constant(tail + kCell);
  origin_ = low - margin;
  const Vector2d cells = (high + margin - origin_) / kCell;
  width_ = static_cast<int>(cells.x()) + 1;
  height_ = static_cast<int>(cells.y()) + 1;
  table_.assign(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_), 0);

  // Likelihood by the square of the distance in steps of the tail's square.
  std::vector<double> likelihood(256);
  for (std::size_t k = 0; k < likelihood.size(); ++k) {
    const double square = kTail * kTail * (static_cast<double>(k) + 0.5) / 256.0;
    likelihood[k] = kCertain * std::exp(-0.5 * square);
  }
  for (int k = 0; k < reference.size(); ++k) {
    stamp(reference.point(k), likelihood);
    if (!reference.continues(k)) continue;
    const Vector2d gap = reference.point(k + 1) - reference.point(k);
    if (gap.norm() > kJoined) continue;
    const int pieces = static_cast<int>(gap.norm() / kCell) + 1;
    for (int piece = 1; piece < pieces; ++piece)
      stamp(reference.point(k) + gap * piece / pieces, likelihood);
  }
}

void Correlation::stamp(const Vector2d& at, const std::vector<double>& likelihood) {
  const Vector2d centre = (at - origin_) / kCell;
  const double tail = kTail * kBlur / kCell;
  const double scale = 256.0 / (tail * tail);
  for (int y = static_cast<int>(centre.y() - tail); y <= static_cast<int>(centre.y() + tail); ++y) {
    const std::size_t row = static_cast<std::size_t>(y) * static_cast<std::size_t>(width_);
    const double dy = y + 0.5 - centre.y();
    for (int x = static_cast<int>(centre.x() - tail); x <= static_cast<int>(centre.x() + tail);
         ++x) {
      const double dx = x + 0.5 - centre.x();
      const auto square = static_cast<std::size_t>(scale * (dx * dx + dy * dy));
      if (square >= likelihood.size()) continue;
      std::uint8_t& cell = table_[row + static_cast<std::size_t>(x)];
      cell = std::max(cell, static_cast<std::uint8_t>(likelihood[square]));
    }
  }
}

void Correlation::add_scores(std::span<const Vector2d> points, const Vector2d& position,
                             double angle, std::uint16_t* scores) const {
  const double c = std::cos(angle) / kCell, s = std::sin(angle) / kCell;
  const Vector2d from = (position - origin_) / kCell;
  const int rows = 2 * reach_y_ + 1;
  for (const Vector2d& point : points) {
    // The first of the window's cells, as numbers that need not fit into integers.
    const double first_x = std::floor(from.x() + c * point.x() - s * point.y()) - reach_x_;
    const double first_y = std::floor(from.y() + s * point.x() + c * point.y()) - reach_y_;
    if (!(first_x >= 0.0 && first_y >= 0.0 && first_x + row_ <= width_ &&
          first_y + rows <= height_)) {
      continue;
    }
    const auto x = static_cast<std::size_t>(first_x), y = static_cast<std::size_t>(first_y);
    const std::uint8_t* likelihood = table_.data() + y * static_cast<std::size_t>(width_) + x;
    std::uint16_t* sum = scores;
    for (int v = 0; v < rows; ++v, likelihood += width_, sum += row_) {
      for (int u = 0; u < row_; u += kLane) {
        for (int lane = 0; lane < kLane; ++lane)
          sum[u + lane] = static_cast<std::uint16_t>(sum[u + lane] + likelihood[u + lane]);
      }
    }
  }
}

std::vector<Candidate> Correlation::search(const SurfaceScan& moving, const Pose2& guess) const {
  const std::vector<Vector2d> points = thinned(moving.points());
  if (points.empty() || table_.empty()) return {};
  Scores scores{2 * turns_ + 1, 2 * reach_y_ + 1, 2 * reach_x_ + 1, row_, {}};
  scores.values.assign(scores.index(scores.turns, 0, 0), 0);
  // The outermost steps are at the window's border, the others between them at equal distances.
  const double turn_step = turns_ == 0 ? 0.0 : window_.angle / turns_;
  for (int turn = 0; turn < scores.turns; ++turn) {
    add_scores(points, guess.translation(), guess.theta() + (turn - turns_) * turn_step,
               scores.values.data() + scores.index(turn, 0, 0));
  }
  std::vector<Peak> chosen;
  std::vector<Candidate> candidates;
  for (const Peak& peak : peaks(scores, kLeastScore)) {
    if (std::ssize(candidates) >= kMostCandidates) break;
    if (!std::ranges::all_of(chosen, [&](const Peak& other) { return apart(peak, other); }))
      continue;
    chosen.push_back(peak);
    candidates.push_back(
        {Pose2(guess.x() + (peak.x - reach_x_) * kCell, guess.y() + (peak.y - reach_y_) * kCell,
               guess.theta() + (peak.turn - turns_) * turn_step),
         peak.score / (kCertain * static_cast<double>(points.size()))});
  }
  return candidates;
}

}  // namespace cairn::icp
