// SPDX-License-Identifier: BSD-3-Clause
#include "potential_grid.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <Eigen/Core>

namespace cairn {
namespace {

/// Coarser grids than this are not worth making.
constexpr std::size_t kFewest = 64;

/// Changes are relative to at least this.
constexpr double kLeast = std::numeric_limits<double>::min();

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
/// of one colour together, so that an update reads and writes neighbouring numbers. Where the
/// number of orientations is odd, the first and the last are beside each other and have the same
/// colour: they are by cell alone, one updated after the other.
class Relaxation {
 public:
  Relaxation(PotentialGrid& grid, double weight, double relaxation)
      : grid_(grid),
        turns_(at(grid.orientations)),
        half_(grid.orientations % 2 == 0 ? turns_ / 2 : 0),
        values_(grid.values.size()),
        fixed_(grid.values.size()),
        nothing_(turns_, 0.0),
        beside_(turns_ + 1),
        next_(turns_) {
    set_factor(weight, relaxation);
    for (std::size_t k = 0; k < turns_; ++k) {
      for (std::size_t n = 0; n < grid.layer(); ++n) {
        const std::size_t from = k * grid.layer() + n, to = index(n, k);
        values_[to] = grid.values[from];
        fixed_[to] = grid.fixed[from];
      }
    }
    if (half_ == 0) return;
    for (std::size_t row = 0; row < 2 * grid.layer(); ++row) {
      fixed_from_.push_back(fixed_in_row_.size());
      for (std::size_t j = 0; j < half_; ++j)
        if (fixed_[row * half_ + j] != 0) fixed_in_row_.push_back(j);
    }
    fixed_from_.push_back(fixed_in_row_.size());
  }

  /// The factor of over-relaxation.
  void set_factor(double weight, double relaxation) {
    keeps_ = 1.0 - relaxation;
    for (std::size_t k = 0; k < factor_.size(); ++k)
      factor_[k] = relaxation / (6.0 - static_cast<double>(k) / weight);
  }

  /// Returns the largest relative change.
  double sweep() {
    largest_ = 0.0;
    for (std::size_t colour = 0; colour < 2; ++colour) {
      for (std::size_t n = 0; n < grid_.layer(); ++n) {
        const std::size_t parity = (at(grid_.cells[n][0]) + at(grid_.cells[n][1]) + colour) % 2;
        if (half_ > 0)
          update_together(n, parity);
        else
          update_in_turn(n, parity);
      }
    }
    return largest_;
  }

  void write_back() const {
    for (std::size_t k = 0; k < turns_; ++k)
      for (std::size_t n = 0; n < grid_.layer(); ++n)
        grid_.values[k * grid_.layer() + n] = values_[index(n, k)];
  }

 private:
  /// What an update needs of a cell's four neighbours.
  struct Neighbours {
    std::array<const double*, 4> values;
    double factor;
  };

  std::size_t index(std::size_t cell, std::size_t turn) const {
    if (half_ == 0) return cell * turns_ + turn;
    return cell * turns_ + turn % 2 * half_ + turn / 2;
  }

  /// `first`: of the orientations, by place in a cell.
  Neighbours neighbours_of(std::size_t cell, std::size_t first) const {
    Neighbours result{};
    std::size_t missing = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const std::int32_t other = grid_.neighbours[cell][k];
      result.values[k] = other < 0 ? nothing_.data() : &values_[at(other) * turns_ + first];
      if (other < 0) ++missing;
    }
    result.factor = factor_[missing];
    return result;
  }

  /// Only where it is more than the largest so far is there something to divide.
  void note_change(double old, double value) {
    const double change = std::abs(value - old);
    const double own = std::max(std::abs(value), kLeast);
    if (change > largest_ * own) largest_ = change / own;
  }

  /// All orientations of one parity, none of which is beside another.
  void update_together(std::size_t cell, std::size_t parity) {
    double* const here = &values_[cell * turns_ + parity * half_];
    const double* const others = &values_[cell * turns_ + (1 - parity) * half_];
    const auto [beside, factor] = neighbours_of(cell, parity * half_);
    // Those before and after: others[j − 1] and others[j], or others[j] and others[j + 1].
    std::copy_n(others, half_, &beside_[1 - parity]);
    (parity == 0 ? beside_.front() : beside_[half_]) = parity == 0 ? others[half_ - 1] : others[0];
    const double keeps = keeps_;
    const double *const left = beside[0], *const right = beside[1], *const below = beside[2],
                        *const above = beside[3];
    for (std::size_t j = 0; j < half_; ++j) {
      const double sum = beside_[j] + beside_[j + 1] + left[j] + right[j] + below[j] + above[j];
      next_[j] = keeps * here[j] + factor * sum;
    }
    const std::size_t row = 2 * cell + parity;
    for (std::size_t k = fixed_from_[row]; k < fixed_from_[row + 1]; ++k)
      next_[fixed_in_row_[k]] = here[fixed_in_row_[k]];
    const Eigen::Map<const Eigen::ArrayXd> before(here, static_cast<Eigen::Index>(half_)),
        after(next_.data(), before.size());
    if (((after - before).abs() - largest_ * after.abs().max(kLeast)).maxCoeff() > 0.0)
      for (std::size_t j = 0; j < half_; ++j) note_change(here[j], next_[j]);
    std::copy_n(next_.data(), half_, here);
  }

  void update_in_turn(std::size_t cell, std::size_t parity) {
    double* const here = &values_[cell * turns_];
    const char* const fixed = &fixed_[cell * turns_];
    const auto [beside, factor] = neighbours_of(cell, 0);
    for (std::size_t k = parity; k < turns_; k += 2) {
      if (fixed[k] != 0) continue;
      double sum = here[(k + turns_ - 1) % turns_] + here[(k + 1) % turns_];
      for (const double* const values : beside) sum += values[k];
      const double value = keeps_ * here[k] + factor * sum;
      note_change(here[k], value);
      here[k] = value;
    }
  }

  PotentialGrid& grid_;
  std::size_t turns_, half_;
  double keeps_ = 0.0;
  std::array<double, 5> factor_{};  ///< by neighbours that are not there
  std::vector<double> values_;
  std::vector<char> fixed_;
  std::vector<std::size_t> fixed_from_,
      fixed_in_row_;  ///< of orientations of one parity: by cell and parity
  std::vector<double> nothing_, beside_, next_;
  double largest_ = 0.0;
};

}  // namespace

namespace {

/// Sweeps between two estimates of how fast changes become less.
constexpr int kBetweenFactors = 10;
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
  Relaxation relaxation(grid, weight, options.relaxation);
  SweepCount count;
  const double largest = std::max(largest_factor(grid), options.relaxation);
  double factor = options.relaxation, before = 0.0, rate_before = 0.0;
  do {
    count.change = relaxation.sweep();
    ++count.sweeps;
    if (count.sweeps % kBetweenFactors != 0) continue;
    // The first changes are not those of the slowest mode, which the rate of all later ones is.
    const double rate = std::pow(count.change / before, 1.0 / kBetweenFactors);
    if (rate < 1.0 && std::abs(rate - rate_before) < kSameRate * (1.0 - rate)) {
      factor = std::min(better_factor(factor, rate), largest);
      relaxation.set_factor(weight, factor);
    }
    rate_before = rate;
    before = count.change;
  } while (count.sweeps < options.most && count.change > options.tolerance && options.goes_on());
  relaxation.write_back();
  return count;
}

}  // namespace cairn
