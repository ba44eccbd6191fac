// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "cairn/runtime/error.hpp"
#include "plans.hpp"

namespace cairn::floors {
namespace {

/// Squares, which are rock or not; all that lies outside is rock.
class Squares {
 public:
  Squares(int width, int height)
      : width_(width),
        height_(height),
        rock_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {}

  int width() const { return width_; }
  int height() const { return height_; }
  bool rock(int x, int y) const {
    return x < 0 || y < 0 || x >= width_ || y >= height_ || rock_[index(x, y)];
  }
  void set(int x, int y, bool rock) { rock_[index(x, y)] = rock; }

  void smooth() {
    Squares next = *this;
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) {
        int around = 0;
        for (int k = 0; k < 9; ++k) around += rock(x - 1 + k % 3, y - 1 + k / 3) ? 1 : 0;
        next.set(x, y, around >= 5);
      }
    }
    *this = std::move(next);
  }

  /// Fills all but the largest part that hangs together by sides. Returns its size.
  int keep_largest() {
    std::vector<bool> seen = rock_;
    std::vector<std::size_t> largest;
    for (std::size_t begin = 0; begin < seen.size(); ++begin) {
      if (seen[begin]) continue;
      std::vector<std::size_t> part = flood(begin, seen);
      if (part.size() > largest.size()) largest = std::move(part);
    }
    rock_.assign(rock_.size(), true);
    for (const std::size_t k : largest) rock_[k] = false;
    return static_cast<int>(largest.size());
  }

 private:
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }
  std::vector<std::size_t> flood(std::size_t begin, std::vector<bool>& seen) const {
    std::vector<std::size_t> part{begin};
    seen[begin] = true;
    for (std::size_t done = 0; done < part.size(); ++done) {
      const int x = static_cast<int>(part[done] % static_cast<std::size_t>(width_)),
                y = static_cast<int>(part[done] / static_cast<std::size_t>(width_));
      constexpr std::array<std::array<int, 2>, 4> kSides{{{1, 0}, {-1, 0}, {0, 1}, {0, -1}}};
      for (const auto& [dx, dy] : kSides) {
        if (rock(x + dx, y + dy) || seen[index(x + dx, y + dy)]) continue;
        seen[index(x + dx, y + dy)] = true;
        part.push_back(index(x + dx, y + dy));
      }
    }
    return part;
  }

  int width_, height_;
  std::vector<bool> rock_;
};

/// How much rock there is at a point, between 0 and 1: bilinear between the middles of squares.
double rock_at(const Squares& squares, double x, double y) {
  const double left = std::floor(x - 0.5), low = std::floor(y - 0.5);
  const double right = x - 0.5 - left, up = y - 0.5 - low;
  const int i = static_cast<int>(left), j = static_cast<int>(low);
  const auto value = [&](int a, int b) { return squares.rock(a, b) ? 1.0 : 0.0; };
  const double below = (1.0 - right) * value(i, j) + right * value(i + 1, j);
  const double above = (1.0 - right) * value(i, j + 1) + right * value(i + 1, j + 1);
  return (1.0 - up) * below + up * above;
}

}  // namespace

OccupancyGrid Cave::generate(std::uint64_t seed) {
  Drawing drawing(options_.plan);
  Random random(seed);
  const int grain = drawing.cells(options_.grain);
  Squares squares(drawing.width() / grain, drawing.height() / grain);
  for (int y = 0; y < squares.height(); ++y) {
    for (int x = 0; x < squares.width(); ++x) squares.set(x, y, random.chance(options_.density));
  }
  for (int round = 0; round < options_.rounds; ++round) squares.smooth();
  if (squares.keep_largest() == 0) {
    throw Error(ErrorCode::usage,
                "cave: it is all rock: less density, another seed, or a smaller grain");
  }
  for (int y = 1; y + 1 < drawing.height(); ++y) {
    for (int x = 1; x + 1 < drawing.width(); ++x)
      drawing.set(x, y, rock_at(squares, (x + 0.5) / grain, (y + 0.5) / grain) < 0.5);
  }
  return drawing.take();
}

}  // namespace cairn::floors
