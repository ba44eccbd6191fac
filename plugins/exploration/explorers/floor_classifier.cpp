// SPDX-License-Identifier: BSD-3-Clause
#include "floor_classifier.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <new>
#include <utility>

#include <opencv2/imgproc.hpp>

#include "cairn/graph/disjoint_sets.hpp"

namespace cairn::exploration {
namespace {

using Eigen::Vector2d;
using Eigen::Vector2i;

/// Opening by a square of 3 × 3 cells depends on cells so far away.
constexpr int kOpeningReach = 2;
/// Cells of clearance around what may change, at first.
constexpr int kSlack = 2;

/// Cells of `from`, row by row, where they are on the grid `to`; others there are `value`.
template <class T>
std::vector<T> moved(const std::vector<T>& cells, const GridFrame& from, const GridFrame& to,
                     const Vector2i& shift, T value) {
  std::vector<T> result(static_cast<std::size_t>(to.size()), value);
  for (int y = 0; y < from.height; ++y) {
    std::copy_n(&cells[from.index(0, y)], from.width, &result[to.index(shift.x(), y + shift.y())]);
  }
  return result;
}

}  // namespace

void FloorClassifier::update(const EvidenceGrid& grid, const CellBox& changed,
                             std::vector<Vector2i> blocked) {
  move_to(grid);
  CellBox obstructed;
  for (const Vector2i& cell : blocked_) obstructed = obstructed.with(cell);
  for (const Vector2i& cell : blocked) obstructed = obstructed.with(cell);
  blocked_ = std::move(blocked);
  const CellBox weighed = changed.moved(-first_).within(whole());
  weigh(grid, weighed);
  const CellBox classes = model_.smooth ? weighed.grown(kOpeningReach).within(whole()) : weighed;
  try {
    classify(classes);
    find_borders(classes.grown(1).within(whole()));
    find_clearance(classes.with(obstructed.moved(-first_)).within(whole()));
  } catch (const cv::Exception& error) {
    if (error.code == cv::Error::StsNoMem) throw std::bad_alloc();
    throw;
  }
  find_frontiers();
}

/// Puts everything where it is on a grid that has grown. What is new there is unknown, as it was
/// outside.
void FloorClassifier::move_to(const EvidenceGrid& grid) {
  const GridFrame &from = map_.frame, &to = grid.frame();
  const Vector2i shift = first_ - grid.first();
  first_ = grid.first();
  if (from.width == to.width && from.height == to.height && shift.isZero()) return;
  map_.log_odds = moved(map_.log_odds, from, to, shift, 0.0F);
  map_.cells = moved(map_.cells, from, to, shift, CellState::unknown);
  map_.clearance = moved(map_.clearance, from, to, shift, 0.0F);
  seen_ = moved(seen_, from, to, shift, CellState::unknown);
  map_.caution = moved(map_.caution, from, to, shift, 0.0F);
  part_filled_ = moved(part_filled_, from, to, shift, std::uint8_t{0});
  border_ = moved(border_, from, to, shift, std::uint8_t{0});
  part_.assign(static_cast<std::size_t>(to.size()), -1);
  map_.frame = to;
}

void FloorClassifier::weigh(const EvidenceGrid& grid, const CellBox& box) {
  box.for_each([&](int x, int y) {
    const std::size_t k = map_.frame.index(x, y);
    const Evidence& cell = grid.evidence()[k];
    const double sum = model_.hit * cell.hits - model_.miss * cell.misses;
    const float value = std::clamp(static_cast<float>(sum), -model_.limit, model_.limit);
    map_.log_odds[k] = value;
    part_filled_[k] = cell.hits > 0 && cell.hits >= model_.part_filled * (cell.hits + cell.misses);
    seen_[k] = value < model_.free_below       ? CellState::free
               : value > model_.occupied_above ? CellState::occupied
                                               : CellState::unknown;
  });
}

/// What lies outside the grid is unknown.
CellState FloorClassifier::seen(int x, int y) const {
  return map_.frame.contains(x, y) ? seen_[map_.frame.index(x, y)] : CellState::unknown;
}

/// Of the known cells around one, the most are free.
bool FloorClassifier::mostly_free(int x, int y) const {
  int free = 0, occupied = 0;
  for (int v = y - 1; v <= y + 1; ++v) {
    for (int u = x - 1; u <= x + 1; ++u) {
      free += seen(u, v) == CellState::free;
      occupied += seen(u, v) == CellState::occupied;
    }
  }
  return free > 2 * occupied;
}

void FloorClassifier::classify(const CellBox& box) {
  if (box.empty()) return;
  const auto row_size = static_cast<std::size_t>(box.width());
  for (int y = box.low.y(); y < box.high.y(); ++y) {
    const std::size_t begin = map_.frame.index(box.low.x(), y);
    std::copy_n(&seen_[begin], row_size, &map_.cells[begin]);
  }
  if (!model_.smooth) return;
  // Morphological opening of what is unknown, with the cells around the box that it depends on.
  const CellBox around = box.grown(kOpeningReach);
  cv::Mat unknown(around.height(), around.width(), CV_8U), opened;
  around.for_each([&](int x, int y) {
    unknown.at<std::uint8_t>(y - around.low.y(), x - around.low.x()) =
        seen(x, y) == CellState::unknown ? 255 : 0;
  });
  cv::morphologyEx(unknown, opened, cv::MORPH_OPEN, cv::Mat::ones(3, 3, CV_8U));
  box.for_each([&](int x, int y) {
    const int row = y - around.low.y(), column = x - around.low.x();
    const bool speck =
        unknown.at<std::uint8_t>(row, column) != 0 && opened.at<std::uint8_t>(row, column) == 0;
    if (speck && mostly_free(x, y)) map_.cells[map_.frame.index(x, y)] = CellState::free;
  });
}

/// After cells of a box have changed. One that is farther from the box than its clearance was keeps
/// it: what was nearest to it has not changed, and nothing that has is nearer.
void FloorClassifier::find_clearance(const CellBox& box) {
  if (box.empty()) return;
  const auto reach =
      static_cast<int>(std::ceil(double{most_clearance_} / map_.frame.resolution)) + 1;
  const CellBox affected = box.grown(reach).within(whole());
  for (int margin = reach + kSlack; !measure_clearance(affected, margin);) margin *= 2;
}

/// Clearance and caution in a box, from the cells up to `margin` around it. False, with nothing
/// changed, if what is farther away could be nearer than all of these.
bool FloorClassifier::measure_clearance(const CellBox& box, int margin) {
  const GridFrame& frame = map_.frame;
  const CellBox around = box.grown(margin).within(whole());
  // What lies outside the grid is not free. What lies on it and outside of `around` is taken to be
  // so: a clearance up to there is not known to be right.
  cv::Mat free(around.height() + 2, around.width() + 2, CV_8U, cv::Scalar(0)), distance;
  around.for_each([&](int x, int y) {
    const bool is_free = map_.cells[frame.index(x, y)] == CellState::free;
    free.at<std::uint8_t>(y - around.low.y() + 1, x - around.low.x() + 1) = is_free ? 255 : 0;
  });
  for (const Vector2i& world : blocked_) {
    const Vector2i cell = world - first_ - around.low;
    if ((cell.array() >= 0).all() && cell.x() < around.width() && cell.y() < around.height())
      free.at<std::uint8_t>(cell.y() + 1, cell.x() + 1) = 0;
  }
  const cv::Rect inner(box.low.x() - around.low.x() + 1, box.low.y() - around.low.y() + 1,
                       box.width(), box.height());
  const auto side = static_cast<float>(frame.resolution);
  const auto keep = [&](std::vector<float>& result) {
    for (int y = box.low.y(); y < box.high.y(); ++y) {
      const float* row = distance.ptr<float>(y - around.low.y() + 1) + inner.x;
      std::transform(row, row + box.width(), &result[frame.index(box.low.x(), y)],
                     [&](float cells) { return cells * side; });
    }
  };
  cv::distanceTransform(free, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE, CV_32F);
  double most = 0.0;
  cv::minMaxLoc(distance(inner), nullptr, &most);
  const CellBox all = whole();
  if (most > margin && (around.low != all.low || around.high != all.high)) return false;
  keep(map_.clearance);
  most_clearance_ = std::max(most_clearance_, static_cast<float>(most) * side);
  // With more obstacles nothing is farther away than it was without.
  bool more = false;
  around.for_each([&](int x, int y) {
    std::uint8_t& there = free.at<std::uint8_t>(y - around.low.y() + 1, x - around.low.x() + 1);
    if (part_filled_[frame.index(x, y)] == 0 || there == 0) return;
    there = 0;
    more = true;
  });
  if (more) cv::distanceTransform(free, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE, CV_32F);
  keep(map_.caution);
  return true;
}

void FloorClassifier::find_borders(const CellBox& box) {
  const GridFrame& frame = map_.frame;
  const auto unknown = [&](int x, int y) {
    return !frame.contains(x, y) || map_.cells[frame.index(x, y)] == CellState::unknown;
  };
  box.for_each([&](int x, int y) {
    const std::size_t k = frame.index(x, y);
    border_[k] = map_.cells[k] == CellState::free &&
                 (unknown(x - 1, y) || unknown(x + 1, y) || unknown(x, y - 1) || unknown(x, y + 1));
  });
}

/// By index.
std::vector<std::int32_t> FloorClassifier::border_cells() const {
  std::vector<std::int32_t> cells;
  const std::uint8_t *const begin = border_.data(), *const end = begin + border_.size();
  for (const std::uint8_t* at = begin; at != end; ++at) {
    at = static_cast<const std::uint8_t*>(std::memchr(at, 1, static_cast<std::size_t>(end - at)));
    if (!at) break;
    cells.push_back(static_cast<std::int32_t>(at - begin));
  }
  return cells;
}

void FloorClassifier::find_frontiers() {
  const GridFrame& frame = map_.frame;
  const std::vector<std::int32_t> cells = border_cells();
  DisjointSets parts(static_cast<int>(cells.size()));
  for (std::size_t k = 0; k < cells.size(); ++k) {
    const int x = cells[k] % frame.width, y = cells[k] / frame.width, number = static_cast<int>(k);
    part_[static_cast<std::size_t>(cells[k])] = number;
    // The neighbours that come before it.
    for (const auto& [u, v] : {std::pair{x - 1, y}, {x - 1, y - 1}, {x, y - 1}, {x + 1, y - 1}}) {
      if (!frame.contains(u, v)) continue;
      if (const int other = part_[frame.index(u, v)]; other >= 0) parts.join(number, other);
    }
  }
  map_.frontiers.clear();
  std::vector<std::int32_t> frontier_of(cells.size(), -1);
  for (std::size_t k = 0; k < cells.size(); ++k) {
    part_[static_cast<std::size_t>(cells[k])] = -1;
    std::int32_t& frontier = frontier_of[static_cast<std::size_t>(parts.find(static_cast<int>(k)))];
    if (frontier < 0) {
      frontier = static_cast<std::int32_t>(map_.frontiers.size());
      map_.frontiers.emplace_back();
    }
    map_.frontiers[static_cast<std::size_t>(frontier)].cells.push_back(cells[k]);
  }
  for (Frontier& frontier : map_.frontiers) measure(frontier);
  std::ranges::stable_sort(map_.frontiers, std::ranges::greater{}, &Frontier::length);
}

void FloorClassifier::measure(Frontier& frontier) const {
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

}  // namespace cairn::exploration
