// SPDX-License-Identifier: BSD-3-Clause
// Where a round body can go on a floor, by OpenCV's distances and components.
#include <algorithm>
#include <limits>
#include <memory>
#include <new>
#include <string>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "cairn/grid/floor_survey.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::floors {
namespace {

using Eigen::Vector2d;

/// Rounding of OpenCV's distances, which are single.
constexpr float kRounding = 1e-3F;

struct Cell {
  int x, y;
};

cv::Mat cells_in_state(const OccupancyGrid& grid, const CellThresholds& thresholds,
                       CellState state) {
  cv::Mat mask(grid.frame.height, grid.frame.width, CV_8U);
  std::transform(grid.occupancy.begin(), grid.occupancy.end(), mask.ptr<std::uint8_t>(),
                 [&](std::int8_t value) { return thresholds.state(value) == state ? 255 : 0; });
  return mask;
}

/// By cell the distance [cells] between its middle and that of the nearest cell that is not in the
/// mask.
cv::Mat distance_to_others(const cv::Mat& mask) {
  cv::Mat distance;
  cv::distanceTransform(mask, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE, CV_32F);
  return distance;
}

/// The same, where what lies outside the grid is not in the mask either.
cv::Mat distance_to_others_or_edge(const cv::Mat& mask) {
  cv::Mat padded;
  cv::copyMakeBorder(mask, padded, 1, 1, 1, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
  return distance_to_others(padded)(cv::Rect(1, 1, mask.cols, mask.rows)).clone();
}

/// The cells where a body's centre can be, by the part of them that it can go about in.
struct Parts {
  explicit Parts(const cv::Mat& fits) {
    cv::Mat centres;
    count = cv::connectedComponentsWithStats(fits, label, stats, centres, 4, CV_32S) - 1;
  }
  int cells(int part) const { return stats.at<int>(part, cv::CC_STAT_AREA); }
  int largest() const {
    int best = 1;
    for (int part = 2; part <= count; ++part) {
      if (cells(part) > cells(best)) best = part;
    }
    return best;
  }
  cv::Mat label, stats;
  int count;  ///< labels run from 1 to it
};

Cell farthest_cell(const cv::Mat& distance, const cv::Mat& among) {
  double value = 0.0;
  cv::Point at;
  cv::minMaxLoc(distance, nullptr, &value, nullptr, &at, among);
  return {at.x, at.y};
}

/// The cell of a mask, which has some, that is nearest to a point [cells], or where that is far
/// away to the place beside the mask that is nearest to it.
Cell nearest_cell(const cv::Mat& mask, const Vector2d& far_point) {
  const Vector2d size(mask.cols, mask.rows);
  const Vector2d point = far_point.cwiseMax(-size).cwiseMin(2.0 * size);
  Cell best{0, 0};
  double least = std::numeric_limits<double>::infinity();
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) {
      if (mask.at<std::uint8_t>(y, x) == 0) continue;
      const double apart = (Vector2d(x + 0.5, y + 0.5) - point).squaredNorm();
      if (apart < least) {
        least = apart;
        best = {x, y};
      }
    }
  }
  return best;
}

std::string state_text(const OccupancyGrid& grid, const CellThresholds& thresholds,
                       const Cell& cell) {
  const GridFrame& frame = grid.frame;
  if (!frame.contains(cell.x, cell.y)) return "outside the map";
  switch (thresholds.state(grid.occupancy[frame.index(cell.x, cell.y)])) {
    case CellState::occupied:
      return "in a wall";
    case CellState::unknown:
      return "on unknown ground";
    case CellState::free:
      break;
  }
  return "too close to a wall";
}

/// The cell where the body is to start. Throws if it does not fit there.
Cell start_cell(const OccupancyGrid& grid, const FloorSurveyOptions& options, const cv::Mat& fits,
                const Parts& parts, const cv::Mat& distance) {
  if (!options.start) return farthest_cell(distance, parts.label == parts.largest());
  if (!options.start->allFinite())
    throw Error(ErrorCode::usage, "the start must have finite coordinates");
  const Vector2d point = grid.frame.to_cells(*options.start);
  constexpr double kMost = 1e9;  // farther away no cell is
  const Vector2d corner = point.array().floor().max(-kMost).min(kMost);
  const Cell cell{static_cast<int>(corner.x()), static_cast<int>(corner.y())};
  if (grid.frame.contains(cell.x, cell.y) && fits.at<std::uint8_t>(cell.y, cell.x) != 0)
    return cell;
  const Cell other = nearest_cell(fits, point);
  const Vector2d there = grid.frame.centre(other.x, other.y);
  throw Error(
      ErrorCode::input,
      fmt::format("the start ({:g}, {:g}) is {} for a body with a radius of {:g} m; the nearest "
                  "place where it fits is ({:.3f}, {:.3f})",
                  options.start->x(), options.start->y(),
                  state_text(grid, options.thresholds, cell), options.radius, there.x(),
                  there.y()));
}

[[noreturn]] void fits_nowhere(const OccupancyGrid& grid, const FloorSurveyOptions& options,
                               const cv::Mat& distance) {
  double most = 0.0;
  cv::minMaxLoc(distance, nullptr, &most);
  if (most == 0.0) {
    throw Error(ErrorCode::input,
                "the map has no free cell: is it inverted (negate), or are its thresholds wrong?");
  }
  throw Error(
      ErrorCode::input,
      fmt::format("a body with a radius of {:g} m fits nowhere: the widest place has room "
                  "for one of {:.3g} m; is the resolution right? Else it takes a smaller body",
                  options.radius, (most - 0.5) * grid.frame.resolution));
}

/// Free cells of `floor` from which one step leads to an unknown cell or off the grid.
std::vector<FloorLeak> find_leaks(const GridFrame& frame, const cv::Mat& floor,
                                  const cv::Mat& unknown) {
  cv::Mat outside, beside;
  cv::copyMakeBorder(unknown, outside, 1, 1, 1, 1, cv::BORDER_CONSTANT, cv::Scalar(255));
  cv::dilate(outside, beside, cv::getStructuringElement(cv::MORPH_CROSS, {3, 3}), {-1, -1}, 1,
             cv::BORDER_CONSTANT, cv::Scalar(0));
  cv::Mat open = floor & beside(cv::Rect(1, 1, floor.cols, floor.rows)), label, stats, middle;
  const int count = cv::connectedComponentsWithStats(open, label, stats, middle, 8, CV_32S);
  std::vector<FloorLeak> leaks;
  for (int k = 1; k < count; ++k) {
    const int *const box = stats.ptr<int>(k), left = box[cv::CC_STAT_LEFT],
                     top = box[cv::CC_STAT_TOP];
    const bool at_edge = left == 0 || top == 0 || left + box[cv::CC_STAT_WIDTH] == frame.width ||
                         top + box[cv::CC_STAT_HEIGHT] == frame.height;
    const cv::Mat own = label({left, top, box[cv::CC_STAT_WIDTH], box[cv::CC_STAT_HEIGHT]}) == k;
    const Cell cell = nearest_cell(
        own, {middle.at<double>(k, 0) + 0.5 - left, middle.at<double>(k, 1) + 0.5 - top});
    leaks.push_back({frame.centre(left + cell.x, top + cell.y),
                     box[cv::CC_STAT_AREA] * frame.resolution, at_edge});
  }
  std::ranges::stable_sort(leaks, std::greater{}, &FloorLeak::length);
  return leaks;
}

FloorSurvey survey_floor(const OccupancyGrid& grid, const FloorSurveyOptions& options) {
  const GridFrame& frame = grid.frame;
  const double cell_area = frame.cell_area();
  const auto radius = static_cast<float>(options.radius / frame.resolution);
  const cv::Mat free = cells_in_state(grid, options.thresholds, CellState::free),
                unknown = cells_in_state(grid, options.thresholds, CellState::unknown),
                distance = distance_to_others_or_edge(free),
                fits = (distance > 0.0F) & (distance >= radius + 0.5F - kRounding);
  const Parts parts(fits);
  if (parts.count == 0) fits_nowhere(grid, options, distance);
  const Cell start = start_cell(grid, options, fits, parts, distance);
  const int part = parts.label.at<int>(start.y, start.x);
  const cv::Mat reached = parts.label == part,
                covered = free & ~(distance_to_others(~reached) > radius + 0.5F + kRounding);

  FloorSurvey survey;
  survey.free_area = cell_area * cv::countNonZero(free);
  survey.unknown_area = cell_area * cv::countNonZero(unknown);
  survey.occupied_area =
      cell_area * static_cast<double>(frame.size()) - survey.free_area - survey.unknown_area;
  survey.start = options.start.value_or(frame.centre(start.x, start.y));
  survey.start_clearance =
      (static_cast<double>(distance.at<float>(start.y, start.x)) - 0.5) * frame.resolution;
  survey.standing_area = cell_area * parts.cells(part);
  survey.covered_area = cell_area * cv::countNonZero(covered);
  for (int y = 0; y < covered.rows; ++y) {
    const auto* row = covered.ptr<std::uint8_t>(y);
    for (int x = 0; x < covered.cols; ++x) survey.covered.push_back(row[x] != 0 ? 1 : 0);
  }
  survey.unreachable_parts = parts.count - 1;
  survey.unreachable_area = cell_area * cv::countNonZero(fits) - survey.standing_area;
  if (const int largest = parts.largest(); parts.cells(largest) > parts.cells(part)) {
    const Cell cell = nearest_cell(parts.label == largest, frame.to_cells(survey.start));
    survey.larger_part = frame.centre(cell.x, cell.y);
    survey.larger_area = cell_area * parts.cells(largest);
  }
  survey.leaks = find_leaks(frame, covered, unknown);
  return survey;
}

class RoundBodySurveyor final : public FloorSurveyor {
 public:
  FloorSurvey survey(const OccupancyGrid& grid, const FloorSurveyOptions& options) override {
    try {
      return survey_floor(grid, options);
    } catch (const cv::Exception& error) {
      if (error.code == cv::Error::StsNoMem) throw std::bad_alloc();
      throw;
    }
  }
};

}  // namespace
}  // namespace cairn::floors

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  registrar.add<FloorSurveyor>("round_body", {}, [](const Options&, Registry&) {
    return std::make_unique<floors::RoundBodySurveyor>();
  });
}
