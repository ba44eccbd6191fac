// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/grid/grid.hpp"

#include <fmt/core.h>

#include "cairn/grid/floor_plan.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {

FloorPlan::~FloorPlan() = default;

void check_frame(const GridFrame& frame, std::string_view name) {
  constexpr std::int64_t kMostCells = 100'000'000;
  // Beyond these, cells have no area, or numbers of cells are no integers any more.
  constexpr double kFinest = 1e-6, kCoarsest = 1e6, kFarthest = 1e9;
  if (frame.width < 1 || frame.height < 1 || frame.size() > kMostCells) {
    throw Error(ErrorCode::input, fmt::format("{}: {} × {} cells, expected 1 to {}", name,
                                              frame.width, frame.height, kMostCells));
  }
  if (!(frame.resolution >= kFinest && frame.resolution <= kCoarsest)) {
    throw Error(
        ErrorCode::input,
        fmt::format("{}: a resolution of {}, expected metres per cell, above zero: {} to {}", name,
                    frame.resolution, kFinest, kCoarsest));
  }
  if (!(frame.origin.array().abs() <= kFarthest).all() || !(std::abs(frame.yaw) <= kFarthest)) {
    throw Error(ErrorCode::input,
                fmt::format("{}: the origin is ({}, {}, {}), expected x, y [m] and yaw [rad], each "
                            "within ±{}",
                            name, frame.origin.x(), frame.origin.y(), frame.yaw, kFarthest));
  }
}

}  // namespace cairn
