// SPDX-License-Identifier: BSD-3-Clause
#include "potential_grid.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace cairn {
namespace {

/// Coarser grids than this are not worth making.
constexpr std::size_t kFewest = 64;

std::size_t at(std::int32_t cell) { return static_cast<std::size_t>(cell); }

}  // namespace

void PotentialGrid::connect() {
  int width = 0, height = 0;
  for (const auto& [x, y] : cells) {
    width = std::max(width, x + 1);
    height = std::max(height, y + 1);
  }
  std::vector<std::int32_t> numbers(at(width) * at(height), -1);
  const auto number = [&](int x, int y) -> std::int32_t {
    if (x < 0 || x >= width || y < 0 || y >= height) return -1;
    return numbers[at(y) * at(width) + at(x)];
  };
  for (std::size_t k = 0; k < cells.size(); ++k)
    numbers[at(cells[k][1]) * at(width) + at(cells[k][0])] = static_cast<std::int32_t>(k);
  neighbours.clear();
  for (const auto& [x, y] : cells)
    neighbours.push_back({number(x - 1, y), number(x + 1, y), number(x, y - 1), number(x, y + 1)});
  for (std::size_t k = 0; k < cells.size(); ++k)
    colours[at((cells[k][0] + cells[k][1]) % 2)].push_back(static_cast<std::int32_t>(k));
}

void PotentialGrid::keep_unconnected() {
  std::vector<char> connected(layer(), 0);
  std::vector<std::int32_t> open;
  for (std::size_t k = 0; k < fixed.size(); ++k) {
    const std::size_t n = k % layer();
    if (fixed[k] == 0 || connected[n] != 0) continue;
    connected[n] = 1;
    open.push_back(static_cast<std::int32_t>(n));
  }
  while (!open.empty()) {
    const std::int32_t cell = open.back();
    open.pop_back();
    for (const std::int32_t other : neighbours[at(cell)]) {
      if (other < 0 || std::exchange(connected[at(other)], 1) != 0) continue;
      open.push_back(other);
    }
  }
  for (std::size_t k = 0; k < fixed.size(); ++k)
    if (connected[k % layer()] == 0) fixed[k] = 1;
}

PotentialGrid PotentialGrid::coarser(std::vector<std::int32_t>& parents) const {
  PotentialGrid half;
  const int turns = orientations % 2 == 0 ? 2 : 1;
  half.orientations = orientations / turns;
  for (const auto& [x, y] : cells) half.cells.push_back({x / 2, y / 2});
  const auto by_rows = [](const auto& a, const auto& b) {
    return std::pair(a[1], a[0]) < std::pair(b[1], b[0]);
  };
  std::ranges::sort(half.cells, by_rows);
  half.cells.erase(std::unique(half.cells.begin(), half.cells.end()), half.cells.end());
  half.connect();
  parents.clear();
  for (const auto& [x, y] : cells) {
    const std::array<std::int32_t, 2> parent{x / 2, y / 2};
    const auto found = std::ranges::lower_bound(half.cells, parent, by_rows);
    parents.push_back(static_cast<std::int32_t>(found - half.cells.begin()));
  }
  half.fixed.assign(at(half.orientations) * half.layer(), 0);
  half.values.assign(half.fixed.size(), 0.0);
  for (int k = 0; k < orientations; ++k) {
    for (std::size_t n = 0; n < layer(); ++n) {
      const std::size_t mine = at(k) * layer() + n;
      if (fixed[mine] == 0) continue;
      const std::size_t to = at(k / turns) * half.layer() + at(parents[n]);
      half.fixed[to] = 1;
      half.values[to] = std::max(half.values[to], values[mine]);
    }
  }
  return half;
}

double PotentialGrid::sweep(double weight, double relaxation) {
  std::array<double, 5> factor{};  // by neighbours that are not there
  for (std::size_t k = 0; k < factor.size(); ++k)
    factor[k] = relaxation / (6.0 - static_cast<double>(k) / weight);
  double largest = 0.0;
  const std::size_t size = layer();
  for (int colour = 0; colour < 2; ++colour) {
    for (int k = 0; k < orientations; ++k) {
      double* const here = &values[at(k) * size];
      const double* const before = &values[at((k + orientations - 1) % orientations) * size];
      const double* const after = &values[at((k + 1) % orientations) * size];
      const char* const keeps = &fixed[at(k) * size];
      for (const std::int32_t cell : colours[at((k + colour) % 2)]) {
        const std::size_t n = at(cell);
        if (keeps[n] != 0) continue;
        double sum = before[n] + after[n];
        std::size_t missing = 0;
        for (const std::int32_t other : neighbours[n]) {
          if (other >= 0)
            sum += here[at(other)];
          else
            ++missing;
        }
        const double old = here[n];
        const double value = (1.0 - relaxation) * old + factor[missing] * sum;
        // Only where it is more than the largest so far is there something to divide.
        const double change = std::abs(value - old);
        const double own = std::max(std::abs(value), std::numeric_limits<double>::min());
        if (change > largest * own) largest = change / own;
        here[n] = value;
      }
    }
  }
  return largest;
}

SweepCount solve(PotentialGrid& grid, double weight, const SweepOptions& options) {
  if (grid.layer() > kFewest) {
    std::vector<std::int32_t> parents;
    PotentialGrid half = grid.coarser(parents);
    solve(half, weight, options);
    const int turns = grid.orientations / half.orientations;
    for (int k = 0; k < grid.orientations; ++k) {
      for (std::size_t n = 0; n < grid.layer(); ++n) {
        const std::size_t mine = at(k) * grid.layer() + n;
        if (grid.fixed[mine] == 0)
          grid.values[mine] = half.values[at(k / turns) * half.layer() + at(parents[n])];
      }
    }
  }
  SweepCount count;
  do {
    count.change = grid.sweep(weight, options.relaxation);
    ++count.sweeps;
  } while (count.sweeps < options.most && count.change > options.tolerance && options.goes_on());
  return count;
}

}  // namespace cairn
