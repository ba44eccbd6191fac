// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace cairn::iterative {

/// Calls body<rows>() with the row count as a constant where it is a common one, else body<0>().
template <class Body>
inline auto with_rows(int rows, Body body) {
  switch (rows) {
    case 1:
      return body.template operator()<1>();
    case 2:
      return body.template operator()<2>();
    case 3:
      return body.template operator()<3>();
    case 6:
      return body.template operator()<6>();
    default:
      return body.template operator()<0>();
  }
}

/// y += A x, or y -= A x, for a column-major block with `kRows` rows; kRows = 0: `rows`, known at
/// run time only.
template <int kRows, bool kSubtract = false>
inline void add_block_product(const double* A, int rows, int columns, const double* x, double* y) {
  const int n = kRows > 0 ? kRows : rows;
  for (int c = 0; c < columns; ++c) {
    const double factor = kSubtract ? -x[c] : x[c];
    for (int r = 0; r < n; ++r) y[r] += A[r] * factor;
    A += n;
  }
}

/// x -= Aᵀ y for a column-major block with `kRows` rows, as above.
template <int kRows>
inline void subtract_transposed_product(const double* A, int rows, int columns, const double* y,
                                        double* x) {
  const int n = kRows > 0 ? kRows : rows;
  for (int c = 0; c < columns; ++c) {
    double sum = 0.0;
    for (int r = 0; r < n; ++r) sum += A[r] * y[r];
    x[c] -= sum;
    A += n;
  }
}

/// y += A x with the row count chosen at run time.
inline void add_product(const double* A, int rows, int columns, const double* x, double* y) {
  with_rows(rows, [&]<int kRows>() { add_block_product<kRows>(A, rows, columns, x, y); });
}

}  // namespace cairn::iterative
