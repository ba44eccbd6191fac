// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "potential_kernels.hpp"

namespace cairn {

/// The cells of a potential over x, y and θ, and which are beside each other. Values are by
/// orientation first.
struct PotentialGrid {
  int orientations = 1;
  std::vector<std::array<std::int32_t, 2>> cells;  ///< x, y
  std::vector<std::array<std::int32_t, 4>>
      neighbours;           ///< −x, +x, −y, +y; −1: the body does not fit
  std::vector<char> fixed;  ///< by orientation and cell: keeps its value
  std::vector<double> values;

  /// Finds the neighbours of `cells`, which are in the order of rising y and x.
  void connect();
  std::size_t layer() const { return cells.size(); }
  /// Cells from which no value that is fixed can be reached stay at zero: relative to what they
  /// are they would never stand.
  void keep_unconnected();

  /// Half as many cells each way and, where their number is even, orientations. Each takes the
  /// largest of its fixed values. `parents`: by cell of this one, that of the coarser one.
  PotentialGrid coarser(std::vector<std::int32_t>& parents) const;
};

struct SweepCount {
  int sweeps = 0;
  double change = 0.0;
};

struct SweepOptions {
  double tolerance;
  int most;  ///< on each grid
  RelaxRow relax_row;
  std::function<bool()> goes_on;  ///< asked after the first sweep, and after some more each time
};

/// Sweeps of successive over-relaxation over (5.9), in two colours like those of a chessboard,
/// until nothing changes by more than the tolerance, from the solution of coarser grids. After the
/// first one five sweeps are made at a time, while what they read is in the caches.
/// `weight`: of a neighbour that is not there, as a divisor.
SweepCount solve(PotentialGrid& grid, double weight, const SweepOptions& options);

}  // namespace cairn
