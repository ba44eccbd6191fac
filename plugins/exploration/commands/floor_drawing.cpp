// SPDX-License-Identifier: BSD-3-Clause
#include "floor_drawing.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <vector>

#include <fmt/format.h>

#include "cairn/grid/cell_traversal.hpp"
#include "cairn/program/table.hpp"

namespace cairn::app {
namespace {

using Eigen::Vector2d;

/// What a square shows; of several, the last of these.
enum class Square : std::uint8_t { unknown, free, wall, path, trajectory, robot };

/// Of the 256 colours of terminals.
int colour_of(Square square) {
  constexpr int kColours[] = {236, 254, 16, 75, 196, 21};
  return kColours[static_cast<std::size_t>(square)];
}

char letter_of(Square square) {
  constexpr char kLetters[] = {' ', '.', '#', '*', '+', '@'};
  return kLetters[static_cast<std::size_t>(square)];
}

/// Squares that hold some cells each, `tall` times as high as wide.
class Canvas {
 public:
  Canvas(const FloorMap& map, std::size_t width, std::size_t height, double tall) : map_(map) {
    find_known();
    const double columns = last_x_ - first_x_ + 1, rows = last_y_ - first_y_ + 1;
    side_ = std::max(
        {columns / static_cast<double>(width), rows / (tall * static_cast<double>(height)), 1.0});
    tall_ = side_ * tall;
    width_ = static_cast<int>(std::ceil(columns / side_));
    height_ = static_cast<int>(std::ceil(rows / tall_));
    squares_.assign(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_),
                    Square::unknown);
    for (int y = first_y_; y <= last_y_; ++y) {
      for (int x = first_x_; x <= last_x_; ++x) {
        const CellState state = map_.cells[map_.frame.index(x, y)];
        if (state != CellState::unknown)
          put(x, y, state == CellState::free ? Square::free : Square::wall);
      }
    }
  }

  void put(int x, int y, Square what) {
    const int u = static_cast<int>((x - first_x_) / side_);
    const int v = static_cast<int>((y - first_y_) / tall_);
    if (x < first_x_ || y < first_y_ || u >= width_ || v >= height_) return;
    Square& square = squares_[index(u, v)];
    square = std::max(square, what);
  }
  void put(const Vector2d& point, Square what) {
    const Vector2d cell = map_.frame.to_cells(point).array().floor();
    put(static_cast<int>(cell.x()), static_cast<int>(cell.y()), what);
  }
  void line(const Vector2d& from, const Vector2d& to, Square what) {
    traverse_cells(map_.frame.to_cells(from), map_.frame.to_cells(to), [&](int x, int y) {
      put(x, y, what);
      return true;
    });
  }

  int width() const { return width_; }
  int height() const { return height_; }
  /// Row 0 is the lowest; rows above the highest are unknown.
  Square at(int u, int v) const { return v < height_ ? squares_[index(u, v)] : Square::unknown; }

 private:
  std::size_t index(int u, int v) const {
    return static_cast<std::size_t>(v) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(u);
  }

  void find_known() {
    first_x_ = map_.frame.width;
    first_y_ = map_.frame.height;
    for (int y = 0; y < map_.frame.height; ++y) {
      for (int x = 0; x < map_.frame.width; ++x) {
        if (map_.cells[map_.frame.index(x, y)] == CellState::unknown) continue;
        first_x_ = std::min(first_x_, x);
        last_x_ = std::max(last_x_, x);
        first_y_ = std::min(first_y_, y);
        last_y_ = std::max(last_y_, y);
      }
    }
    if (last_x_ < 0) first_x_ = first_y_ = last_x_ = last_y_ = 0;
  }

  const FloorMap& map_;
  int first_x_ = 0, first_y_ = 0, last_x_ = -1, last_y_ = -1;
  double side_ = 1.0, tall_ = 1.0;  ///< of a square [cells]
  int width_ = 0, height_ = 0;
  std::vector<Square> squares_;
};

void draw(const FloorDrawing& drawing, Canvas& canvas) {
  for (std::size_t k = 1; k < drawing.path.size(); ++k)
    canvas.line(drawing.path[k - 1], drawing.path[k], Square::path);
  for (std::size_t k = 1; k < drawing.trajectory.size(); ++k)
    canvas.line(drawing.trajectory[k - 1], drawing.trajectory[k], Square::trajectory);
  if (drawing.robot) canvas.put(*drawing.robot, Square::robot);
}

std::string in_letters(const Canvas& canvas) {
  std::string text;
  for (int v = canvas.height() - 1; v >= 0; --v) {
    std::string line;
    for (int u = 0; u < canvas.width(); ++u) line += letter_of(canvas.at(u, v));
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + "\n";
  }
  return text;
}

std::string in_half_blocks(const Canvas& canvas) {
  std::string text;
  const int rows = canvas.height() + canvas.height() % 2;
  for (int v = rows - 1; v > 0; v -= 2) {
    int upper = -1, lower = -1;
    for (int u = 0; u < canvas.width(); ++u) {
      const int above = colour_of(canvas.at(u, v)), below = colour_of(canvas.at(u, v - 1));
      if (above != upper || below != lower)
        text += fmt::format("\x1b[38;5;{}m\x1b[48;5;{}m", above, below);
      upper = above;
      lower = below;
      text += "▀";
    }
    text += "\x1b[0m\n";
  }
  return text;
}

}  // namespace

std::string floor_text(const FloorDrawing& drawing, std::size_t width, std::size_t height,
                       bool colour) {
  Canvas canvas(drawing.map, std::max<std::size_t>(width, 1),
                std::max<std::size_t>(height, 1) * (colour ? 2 : 1), colour ? 1.0 : 2.0);
  draw(drawing, canvas);
  return colour ? in_half_blocks(canvas) : in_letters(canvas);
}

void print_floor(const FloorDrawing& drawing, const Session& session) {
  if (!is_terminal(stdout)) return;
  session.print(floor_text(drawing, output_width(), output_width() / 3, session.colour()));
}

}  // namespace cairn::app
