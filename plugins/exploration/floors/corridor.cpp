// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>

#include "cairn/runtime/error.hpp"
#include "plans.hpp"

namespace cairn::floors {

void draw_rooms(Drawing& drawing, const Box& box, const RowOptions& options, bool doors_below,
                Random& random) {
  const int wall = drawing.cells(options.walls.wall), door = drawing.cells(options.walls.door),
            room = drawing.cells(options.room);
  const int least = std::max(door, room * 3 / 4), spread = std::max(1, room / 2);
  for (int x = box.x0; x < box.x1;) {
    int end = x + least + random.below(spread);
    if (box.x1 - end < least + wall) end = box.x1;  // what would be too narrow belongs to the last
    end = std::min(end, box.x1);
    drawing.fill({x, box.y0, end, box.y1}, true);
    const int width = std::min(door, end - x), left = x + random.below(end - x - width + 1);
    drawing.fill(doors_below ? Box{left, box.y0 - wall, left + width, box.y0}
                             : Box{left, box.y1, left + width, box.y1 + wall},
                 true);
    x = end + wall;
  }
}

OccupancyGrid Corridor::generate(std::uint64_t seed) {
  Drawing drawing(options_.plan);
  Random random(seed);
  const int wall = drawing.cells(options_.rows.walls.wall),
            way = drawing.cells(options_.rows.corridor);
  const int depth = (drawing.height() - way) / 2 - 2 * wall;
  if (depth < drawing.cells(options_.rows.walls.door)) {
    throw Error(ErrorCode::usage,
                "corridor: no room is left beside the corridor: more height, or a narrower one");
  }
  const int low = 2 * wall + depth, right = drawing.width() - wall;
  drawing.fill({wall, low, right, low + way}, true);
  draw_rooms(drawing, {wall, wall, right, wall + depth}, options_.rows, false, random);
  draw_rooms(drawing, {wall, low + way + wall, right, low + way + wall + depth}, options_.rows,
             true, random);
  return drawing.take();
}

}  // namespace cairn::floors
