// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/grid/grid.hpp"

#include <fmt/core.h>

#include "cairn/grid/floor_plan.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {

FloorPlan::~FloorPlan() = default;

void check_frame(const GridFrame& frame, std::string_view name) {
  constexpr std::int64_t kMostCells = 100'000'000;
  if (frame.width < 1 || frame.height < 1 || frame.size() > kMostCells) {
    throw Error(ErrorCode::input, fmt::format("{}: {} × {} cells, expected 1 to {}", name,
                                              frame.width, frame.height, kMostCells));
  }
  if (!(frame.resolution > 0.0) || !std::isfinite(frame.resolution)) {
    throw Error(ErrorCode::input,
                fmt::format("{}: a resolution of {}, expected metres per cell, above zero", name,
                            frame.resolution));
  }
  if (!frame.origin.allFinite() || !std::isfinite(frame.yaw)) {
    throw Error(ErrorCode::input,
                fmt::format("{}: the origin is ({}, {}, {}), expected finite numbers x, y [m] and "
                            "yaw [rad]",
                            name, frame.origin.x(), frame.origin.y(), frame.yaw));
  }
}

}  // namespace cairn
