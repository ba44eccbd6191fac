// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/grid/floor_plan.hpp"
#include "drawing.hpp"

namespace cairn::floors {

// Rooms -------------------------------------------------------------------------------------------

struct RoomsOptions {
  PlanOptions plan{};
  WallOptions walls{};
  double room = 3.0;
  double loops = 0.3;

  static auto fields() {
    using O = RoomsOptions;
    return OptionFields<O>()
        .part(&O::plan)
        .part(&O::walls)
        .real("room", &O::room, 0.5, 100.0, "least side of a room [m]")
        .real("loops", &O::loops, 0.0, 1.0, "part of the walls that have a second door");
  }
};

/// A rectangle that walls divide again and again, as long as rooms are large enough; each wall has
/// a door, so that every room can be reached.
class Rooms final : public FloorPlan {
 public:
  explicit Rooms(const RoomsOptions& options) : options_(options) {}
  OccupancyGrid generate(std::uint64_t seed) override;

 private:
  RoomsOptions options_;
};

// Corridors ---------------------------------------------------------------------------------------

/// A corridor with rows of rooms.
struct RowOptions {
  WallOptions walls{};
  double corridor = 2.0, room = 4.0;

  static auto fields() {
    using O = RowOptions;
    return OptionFields<O>()
        .part(&O::walls)
        .real("corridor", &O::corridor, 0.5, 100.0, "width of the corridor [m]")
        .real("room", &O::room, 1.0, 100.0, "width of a room, by up to a quarter more or less [m]");
  }
};

struct CorridorOptions {
  PlanOptions plan{.width = 40.0, .height = 12.0};
  RowOptions rows{};

  static auto fields() {
    using O = CorridorOptions;
    return OptionFields<O>().part(&O::plan).part(&O::rows);
  }
};

/// A corridor from end to end, with a row of rooms on either side.
class Corridor final : public FloorPlan {
 public:
  explicit Corridor(const CorridorOptions& options) : options_(options) {}
  OccupancyGrid generate(std::uint64_t seed) override;

 private:
  CorridorOptions options_;
};

struct LoopOptions {
  PlanOptions plan{.width = 30.0, .height = 20.0};
  RowOptions rows{};

  static auto fields() {
    using O = LoopOptions;
    return OptionFields<O>().part(&O::plan).part(&O::rows);
  }
};

/// A corridor along the outer walls, around a block of two rows of rooms.
class Loop final : public FloorPlan {
 public:
  explicit Loop(const LoopOptions& options) : options_(options) {}
  OccupancyGrid generate(std::uint64_t seed) override;

 private:
  LoopOptions options_;
};

/// A row of rooms in `box`, each with a door through its lower wall (`doors_below`) or its upper
/// one, which the row shares with what lies there.
void draw_rooms(Drawing& drawing, const Box& box, const RowOptions& options, bool doors_below,
                Random& random);

// Caves -------------------------------------------------------------------------------------------

struct CaveOptions {
  PlanOptions plan{.width = 20.0, .height = 20.0};
  double grain = 0.6, density = 0.45;
  int rounds = 5;

  static auto fields() {
    using O = CaveOptions;
    return OptionFields<O>()
        .part(&O::plan)
        .real("grain", &O::grain, 0.01, 100.0, "side of the squares it is made of [m]")
        .real("density", &O::density, 0.0, 0.7, "part of the squares that are rock at first")
        .integer("rounds", &O::rounds, 0, 100,
                 "of smoothing: a square becomes what most around are");
  }
};

/// A cellular automaton: squares are rock at random, and become rock where five of the nine around
/// them are. The largest part that hangs together stays, with rounded walls.
class Cave final : public FloorPlan {
 public:
  explicit Cave(const CaveOptions& options) : options_(options) {}
  OccupancyGrid generate(std::uint64_t seed) override;

 private:
  CaveOptions options_;
};

}  // namespace cairn::floors
