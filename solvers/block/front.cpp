// SPDX-License-Identifier: BSD-3-Clause
#include "block/front.hpp"

#include <algorithm>

namespace cairn::block {
namespace {

int round_up(int rows) { return (rows + 7) / 8 * 8; }

}  // namespace

template <class Real>
int factor_front(const FrontKernels<Real>& kernels, Real* panel, std::int64_t stride, int columns,
                 int m) {
  const int rows = static_cast<int>(stride);
  if (!is_large(m)) return kernels.factor_panel(panel, stride, 0, 0, columns, rows);
  int failed = -1;
  for (int first = 0; first < columns; first += kStripColumns) {
    const int block = block_of(first);
    const int last = std::min(columns, first + kStripColumns);
    const int below = std::min(rows, round_up(last));
    if (first == block && block > 0) {
      const int block_end = std::min(columns, block + kBlockColumns);
      for (int row = block; row < rows; row += kTileRows)
        kernels.subtract(panel, stride, block, block_end, row, std::min(rows, row + kTileRows));
    }
    const int column = kernels.factor_panel(panel, stride, block, first, last, below);
    if (failed < 0) failed = column;
    kernels.factor_rows(panel, stride, block, first, last, below, rows);
  }
  return failed;
}
template int factor_front(const FrontKernels<double>&, double*, std::int64_t, int, int);
template int factor_front(const FrontKernels<float>&, float*, std::int64_t, int, int);

void append_rows(std::vector<Spread>& spreads, std::size_t begin, std::int32_t source,
                 std::int32_t target, std::int32_t size) {
  for (std::int32_t k = 0; k < size; ++k) {
    const std::int32_t row = target + k, first = row / 8 * 8;
    if (spreads.size() == begin || spreads.back().target != first)
      spreads.push_back({source + k, first, 0, 0});
    Spread& spread = spreads.back();
    spread.mask = static_cast<std::uint8_t>(spread.mask | 1u << (row - first));
    spread.packed = static_cast<std::uint8_t>(spread.packed << 1 | 1u);
  }
}

std::int64_t room_to_invert(int columns, int m) { return std::int64_t{round_up(columns)} * m; }

void invert_front(const Kernels& kernels, const double* panel, std::int64_t stride, int columns,
                  int m, const double* U, double* Z, double* room) {
  const int c8 = round_up(columns);
  double* V = room;
  double* T = V + std::int64_t{c8} * columns;
  std::fill(V, T, 0.0);
  kernels.invert_pivots(panel, stride, columns, V, 0, c8);
  if (m > columns) {
    kernels.transform_rows(panel, stride, columns, V, T, 0, m - columns);
    kernels.inverse_rows(U, stride, columns, m, T, Z, columns / 8 * 8, static_cast<int>(stride));
  }
  kernels.inverse_pivots(V, T, stride, columns, m, Z, 0, c8);
}

}  // namespace cairn::block
