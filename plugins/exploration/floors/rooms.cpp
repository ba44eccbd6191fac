// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>

#include "plans.hpp"

namespace cairn::floors {
namespace {

class RoomsDrawing {
 public:
  RoomsDrawing(const RoomsOptions& options, std::uint64_t seed)
      : drawing_(options.plan),
        random_(seed),
        wall_(drawing_.cells(options.walls.wall)),
        door_(drawing_.cells(options.walls.door)),
        // With two doors' width there is room for a door in each wall, wherever others meet it.
        room_(std::max(drawing_.cells(options.room), 2 * (door_ + wall_))) {
    const Box inside{wall_, wall_, drawing_.width() - wall_, drawing_.height() - wall_};
    drawing_.fill(inside, true);
    divide(inside);
    for (const Box& wall : walls_) {
      add_door(wall);
      if (random_.chance(options.loops)) add_door(wall);
    }
  }

  OccupancyGrid take() { return drawing_.take(); }

 private:
  void divide(const Box& room) {
    const bool upright = room.width() >= room.height();
    const int length = upright ? room.width() : room.height();
    const int choices = length - 2 * room_ - wall_ + 1;
    if (choices < 1) return;
    const int at = room_ + random_.below(choices);
    Box wall = room, before = room, behind = room;
    (upright ? before.x1 : before.y1) = (upright ? wall.x0 : wall.y0) =
        (upright ? room.x0 : room.y0) + at;
    (upright ? behind.x0 : behind.y0) = (upright ? wall.x1 : wall.y1) =
        (upright ? before.x1 : before.y1) + wall_;
    drawing_.fill(wall, false);
    walls_.push_back(wall);
    divide(before);
    divide(behind);
  }

  /// At a random place where both sides are free; none, if there is no such place.
  void add_door(const Box& wall) {
    const bool upright = wall.width() == wall_ && wall.height() != wall_;
    const int choices = (upright ? wall.height() : wall.width()) - door_ + 1;
    const int first = random_.below(std::max(1, choices));
    for (int k = 0; k < choices; ++k) {
      const int at = (first + k) % choices;
      Box door = wall, low = wall, high = wall;
      if (upright) {
        door.y0 = low.y0 = high.y0 = wall.y0 + at;
        door.y1 = low.y1 = high.y1 = wall.y0 + at + door_;
        low = {wall.x0 - door_, low.y0, wall.x0, low.y1};
        high = {wall.x1, high.y0, wall.x1 + door_, high.y1};
      } else {
        door.x0 = wall.x0 + at;
        door.x1 = door.x0 + door_;
        low = {door.x0, wall.y0 - door_, door.x1, wall.y0};
        high = {door.x0, wall.y1, door.x1, wall.y1 + door_};
      }
      if (!drawing_.free(low) || !drawing_.free(high)) continue;
      if (drawing_.free(door)) continue;  // the first door
      return drawing_.fill(door, true);
    }
  }

  Drawing drawing_;
  Random random_;
  int wall_, door_, room_;
  std::vector<Box> walls_;
};

}  // namespace

OccupancyGrid Rooms::generate(std::uint64_t seed) { return RoomsDrawing(options_, seed).take(); }

}  // namespace cairn::floors
