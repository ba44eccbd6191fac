// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <random>

#include "cairn/grid/grid.hpp"
#include "cairn/plugin/option_fields.hpp"

namespace cairn::floors {

/// The cells [x0, x1) × [y0, y1).
struct Box {
  int x0, y0, x1, y1;
  int width() const { return x1 - x0; }
  int height() const { return y1 - y0; }
};

/// What all plans have.
struct PlanOptions {
  double width = 20.0, height = 15.0, resolution = 0.05;

  static auto fields() {
    using O = PlanOptions;
    return OptionFields<O>()
        .real("width", &O::width, 2.0, 1000.0, "of the building, walls included [m]")
        .real("height", &O::height, 2.0, 1000.0, "of the building, walls included [m]")
        .real("resolution", &O::resolution, 0.005, 1.0, "side of a cell [m]");
  }
};

/// Doors and walls.
struct WallOptions {
  double wall = 0.2, door = 0.9;

  static auto fields() {
    using O = WallOptions;
    return OptionFields<O>()
        .real("wall", &O::wall, 0.01, 5.0, "thickness of walls [m]")
        .real("door", &O::door, 0.1, 10.0, "width of doors [m]");
  }
};

/// A floor that is all wall at first, in whole cells: what is drawn does not depend on rounding.
class Drawing {
 public:
  /// Throws `Error` (usage) for more than 10⁸ cells.
  explicit Drawing(const PlanOptions& options);

  int width() const { return grid_.frame.width; }
  int height() const { return grid_.frame.height; }
  /// A length [m] in cells, at least one.
  int cells(double length) const;
  void set(int x, int y, bool free) { grid_.occupancy[grid_.frame.index(x, y)] = free ? 0 : 100; }
  bool free(int x, int y) const {
    return grid_.frame.contains(x, y) && grid_.occupancy[grid_.frame.index(x, y)] == 0;
  }
  /// What lies outside the floor is left out.
  void fill(const Box& box, bool free);
  /// Whether all cells are.
  bool free(const Box& box) const;
  OccupancyGrid take() { return std::move(grid_); }

 private:
  OccupancyGrid grid_;
};

/// Random numbers, the same on every machine (the distributions of the standard library are not).
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  /// 0 … count − 1.
  int below(int count) { return static_cast<int>(engine_() % static_cast<std::uint64_t>(count)); }
  bool chance(double probability) {
    return static_cast<double>(engine_() >> 11U) * 0x1p-53 < probability;
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace cairn::floors
