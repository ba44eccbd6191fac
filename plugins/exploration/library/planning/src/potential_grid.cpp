// SPDX-License-Identifier: BSD-3-Clause
#include "potential_grid.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <memory>
#include <numbers>
#include <utility>

namespace cairn {
namespace {

/// Coarser grids than this are not worth making.
constexpr std::size_t kFewest = 64;

/// Changes are relative to at least this, so far above the least normal number that this times a
/// relative change is none below it: processors take a hundred times as long for such numbers.
constexpr double kLeast = 1e-290;

/// Factor of over-relaxation at the beginning.
constexpr double kFirstFactor = 1.8;

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

namespace {

/// The values of a grid while they are swept: by cell, and of each cell those of the orientations
/// of one colour together (`PotentialRows`), so that an update reads and writes neighbouring
/// numbers. Where the number of orientations is odd, the first and the last are beside each other
/// and have the same colour: they are by cell alone, one updated after the other.
class Relaxation {
 public:
  Relaxation(PotentialGrid& grid, double weight, const SweepOptions& options)
      : grid_(grid),
        turns_(at(grid.orientations)),
        half_(grid.orientations % 2 == 0 ? turns_ / 2 : 0),
        stride_(half_ > 0 ? stride_of(half_) : turns_),
        relax_row_(options.relax_row),
        storage_((half_ > 0 ? 2 : 1) * grid.layer() * stride_ + kAligned / sizeof(double)),
        rows_(aligned(storage_)),
        nothing_(stride_, 0.0) {
    set_factor(weight, kFirstFactor);
    for (std::size_t n = 0; n < grid.layer(); ++n) {
      if (n == 0 || grid.cells[n][1] != grid.cells[n - 1][1]) line_begins_.push_back(n);
      for (std::size_t k = 0; k < turns_; ++k)
        rows_[index(n, k)] = grid.values[k * grid.layer() + n];
      if (half_ == 0) continue;
      rows_[2 * n * stride_ + half_] = rows_[index(n, 0)];
      rows_[(2 * n + 1) * stride_ - 1] = rows_[index(n, turns_ - 1)];
      for (std::size_t parity = 0; parity < 2; ++parity) note_fixed(n, parity);
    }
    line_begins_.push_back(grid.layer());
    sweep_.half = half_;
    sweep_.stride = stride_;
    sweep_.values = rows_;
    sweep_.nothing = nothing_.data();
    sweep_.neighbours = grid.neighbours.data()->data();
    sweep_.free_row = free_row_.data();
    sweep_.free = free_.data();
    sweep_.least = kLeast;
  }

  /// The factor of over-relaxation.
  void set_factor(double weight, double relaxation) {
    sweep_.keeps = 1.0 - relaxation;
    for (std::size_t k = 0; k < std::size(sweep_.factor); ++k)
      sweep_.factor[k] = relaxation / (6.0 - static_cast<double>(k) / weight);
  }

  /// So many sweeps; returns the largest relative change in the last one. Each colour of each sweep
  /// follows the one before it a line of cells behind, while what it reads is in the caches. What
  /// it reads of the lines beside is as if sweeps were made one after another.
  double sweep(int count) {
    double largest = 0.0;
    const std::ptrdiff_t lines = std::ssize(line_begins_) - 1, stages = 2 * count;
    for (std::ptrdiff_t front = 0; front < lines + stages - 1; ++front) {
      for (std::ptrdiff_t stage = 0; stage < stages; ++stage) {
        const std::ptrdiff_t line = front - stage;
        if (line < 0 || line >= lines) continue;
        update_line(static_cast<std::size_t>(line), static_cast<std::size_t>(stage % 2),
                    stage >= stages - 2 ? &largest : nullptr);
      }
    }
    return largest;
  }

  void write_back() const {
    for (std::size_t k = 0; k < turns_; ++k)
      for (std::size_t n = 0; n < grid_.layer(); ++n)
        grid_.values[k * grid_.layer() + n] = rows_[index(n, k)];
  }

 private:
  /// Of a few orientations, whole vectors do not reach the last number of a row, which is written
  /// by itself: what is read across it has to wait.
  static std::size_t stride_of(std::size_t half) { return (half + (half > 16 ? 9 : 15)) / 8 * 8; }

  static constexpr std::size_t kAligned = 64;  ///< bytes: lines of a cache
  static double* aligned(std::vector<double>& storage) {
    void* begin = storage.data();
    std::size_t space = storage.size() * sizeof(double);
    return static_cast<double*>(std::align(kAligned, sizeof(double), begin, space));
  }

  std::size_t index(std::size_t cell, std::size_t turn) const {
    if (half_ == 0) return cell * turns_ + turn;
    return (2 * cell + turn % 2) * stride_ + turn / 2;
  }

  void note_fixed(std::size_t cell, std::size_t parity) {
    const auto fixed = [&](std::size_t j) {
      return grid_.fixed[(2 * j + parity) * grid_.layer() + cell] != 0;
    };
    bool any = false;
    for (std::size_t j = 0; j < half_; ++j) any = any || fixed(j);
    free_row_.push_back(any ? static_cast<std::int32_t>(free_.size() / stride_) : -1);
    if (!any) return;
    for (std::size_t j = 0; j < stride_; ++j) free_.push_back(j < half_ && !fixed(j) ? -1 : 0);
  }

  /// Of the cells of a line, those orientations that have this colour. `largest` may be null.
  void update_line(std::size_t line, std::size_t colour, double* largest) {
    for (std::size_t n = line_begins_[line]; n < line_begins_[line + 1]; ++n) {
      const std::size_t parity = (at(grid_.cells[n][0]) + at(grid_.cells[n][1]) + colour) % 2;
      if (half_ > 0)
        relax_row_(sweep_, n, parity, largest);
      else
        update_in_turn(n, parity, largest);
    }
  }

  void update_in_turn(std::size_t cell, std::size_t parity, double* largest) {
    double* const here = &rows_[cell * turns_];
    std::array<const double*, 4> beside{};
    std::size_t missing = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const std::int32_t other = grid_.neighbours[cell][k];
      beside[k] = other < 0 ? nothing_.data() : &rows_[at(other) * turns_];
      if (other < 0) ++missing;
    }
    for (std::size_t k = parity; k < turns_; k += 2) {
      if (grid_.fixed[k * grid_.layer() + cell] != 0) continue;
      double sum = here[(k + turns_ - 1) % turns_] + here[(k + 1) % turns_];
      for (const double* const values : beside) sum += values[k];
      const double value = sweep_.keeps * here[k] + sweep_.factor[missing] * sum;
      const double change = std::abs(value - here[k]), own = std::max(std::abs(value), kLeast);
      if (largest && change > *largest * own) *largest = change / own;
      here[k] = value;
    }
  }

  PotentialGrid& grid_;
  std::size_t turns_, half_, stride_;
  RelaxRow relax_row_;
  std::vector<double> storage_;
  double* rows_;  ///< the values
  std::vector<double> nothing_;
  std::vector<std::int32_t> free_row_;
  std::vector<std::int64_t> free_;
  std::vector<std::size_t> line_begins_;  ///< of the cells of one y
  PotentialRows sweep_{};
};

/// Sweeps between two estimates of how fast changes become less, and how many are made together:
/// the lines of cells that these are in at a time should fit in the second cache.
constexpr int kBetweenFactors = 10, kTogether = 5;
/// Over-relaxation overshoots where values still change by more than this part of themselves after
/// some sweeps, as in narrow corridors, along which they fall by a large factor per cell.
constexpr double kOvershoots = 1.0;
/// Two estimates of the rate agree if they differ by less.
constexpr double kSameRate = 0.1;

/// The best factor on a grid without obstacles whose border is fixed; none is best that is larger.
double largest_factor(const PotentialGrid& grid) {
  int longest = grid.orientations / 2;
  for (const auto& [x, y] : grid.cells) longest = std::max({longest, x + 1, y + 1});
  return 2.0 / (1.0 + std::sin(std::numbers::pi / (longest + 1)));
}

/// The factor of over-relaxation that is best if changes become less by `rate` in a sweep with
/// `factor`; no smaller one. With two colours the rate λ and the spectral radius ρ of Jacobi's
/// iteration are related by (λ + ω − 1)² = λ ω² ρ², and 2 / (1 + √(1 − ρ²)) is the best ω (Young
/// 1971).
double better_factor(double factor, double rate) {
  if (!(rate > factor - 1.0)) return factor;  // as fast as it can be with this factor
  const double radius = std::pow(rate + factor - 1.0, 2) / (rate * factor * factor);
  return radius < 1.0 ? std::max(factor, 2.0 / (1.0 + std::sqrt(1.0 - radius))) : factor;
}

}  // namespace

SweepCount solve(PotentialGrid& grid, double weight, const SweepOptions& options) {
  if (grid.layer() == 0) return {};
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
  Relaxation relaxation(grid, weight, options);
  SweepCount count;
  const double largest = std::max(largest_factor(grid), kFirstFactor);
  double factor = kFirstFactor, before = 0.0, rate_before = 0.0;
  do {
    // The first one alone, if that is all that there is time for.
    const int left = count.sweeps == 0 ? 1 : kTogether - count.sweeps % kTogether;
    const int together = std::min(left, std::max(options.most - count.sweeps, 1));
    count.change = relaxation.sweep(together);
    count.sweeps += together;
    if (count.sweeps % kBetweenFactors != 0) continue;
    // The first changes are not those of the slowest mode, which the rate of all later ones is.
    const double rate = std::pow(count.change / before, 1.0 / kBetweenFactors);
    if (rate < 1.0 && std::abs(rate - rate_before) < kSameRate * (1.0 - rate)) {
      factor = std::min(better_factor(factor, rate), largest);
      relaxation.set_factor(weight, factor);
    } else if (count.change > kOvershoots && std::isfinite(rate_before) && rate_before > 0.0) {
      factor = 1.0 + 0.5 * (factor - 1.0);
      relaxation.set_factor(weight, factor);
    }
    rate_before = rate;
    before = count.change;
  } while (count.sweeps < options.most && count.change > options.tolerance && options.goes_on());
  relaxation.write_back();
  return count;
}

}  // namespace cairn
