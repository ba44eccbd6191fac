// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/runtime/error.hpp"
#include "plans.hpp"

namespace cairn::floors {

OccupancyGrid Loop::generate(std::uint64_t seed) {
  Drawing drawing(options_.plan);
  Random random(seed);
  const int wall = drawing.cells(options_.rows.walls.wall),
            way = drawing.cells(options_.rows.corridor);
  const Box block{wall + way, wall + way, drawing.width() - wall - way,
                  drawing.height() - wall - way};
  const int depth = (block.height() - 3 * wall) / 2, door = drawing.cells(options_.rows.walls.door);
  if (depth < door || block.width() < 2 * wall + door) {
    throw Error(ErrorCode::usage,
                "loop: no room is left inside the corridor: a larger building, or a narrower one");
  }
  drawing.fill({wall, wall, drawing.width() - wall, drawing.height() - wall}, true);
  drawing.fill(block, false);
  const int left = block.x0 + wall, right = block.x1 - wall;
  draw_rooms(drawing, {left, block.y0 + wall, right, block.y0 + wall + depth}, options_.rows, true,
             random);
  draw_rooms(drawing, {left, block.y1 - wall - depth, right, block.y1 - wall}, options_.rows, false,
             random);
  return drawing.take();
}

}  // namespace cairn::floors
