// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace cairn::incremental {

/// out += J δ; J rows × size, column-major. The number of rows known when compiling is what makes
/// this fast.
template <int Rows>
void add_product(const double* J, int size, const double* delta, double* out) {
  for (int k = 0; k < size; ++k) {
    for (int r = 0; r < Rows; ++r) out[r] += J[r] * delta[k];
    J += Rows;
  }
}
inline void add_product(int rows, const double* J, int size, const double* delta, double* out) {
  switch (rows) {
    case 2:
      return add_product<2>(J, size, delta, out);
    case 3:
      return add_product<3>(J, size, delta, out);
    case 6:
      return add_product<6>(J, size, delta, out);
    default:
      for (int k = 0; k < size; ++k) {
        for (int r = 0; r < rows; ++r) out[r] += J[r] * delta[k];
        J += rows;
      }
  }
}

}  // namespace cairn::incremental
