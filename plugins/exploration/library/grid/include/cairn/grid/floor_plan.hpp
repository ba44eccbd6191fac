// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string_view>

#include "cairn/grid/grid.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/component.hpp"

namespace cairn {

/// Makes the floor of a building: cells are free or occupied, and a wall encloses all of them. The
/// same options and seed give the same floor, bit by bit, on every machine.
class CAIRN_API FloorPlan : public Component {
 public:
  static constexpr std::string_view kKind = "floor_plan";
  ~FloorPlan() override;

  virtual OccupancyGrid generate(std::uint64_t seed) = 0;
};

}  // namespace cairn
