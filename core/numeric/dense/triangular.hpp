// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dense/products.hpp"

#if defined(CAIRN_DENSE_COMPILED_ONCE)
namespace Eigen::internal {

// X = T⁻¹ B, T triangular: that of a factor (ColMajor) or of its transpose (RowMajor).
CAIRN_DENSE_EXTERN template struct triangular_solve_matrix<double, Index, OnTheLeft, Lower, false,
                                                           ColMajor, ColMajor, 1>;
CAIRN_DENSE_EXTERN template struct triangular_solve_matrix<double, Index, OnTheLeft, UnitLower,
                                                           false, ColMajor, ColMajor, 1>;
CAIRN_DENSE_EXTERN template struct triangular_solve_matrix<double, Index, OnTheLeft, Upper, false,
                                                           ColMajor, ColMajor, 1>;
CAIRN_DENSE_EXTERN template struct triangular_solve_matrix<double, Index, OnTheLeft, Upper, false,
                                                           RowMajor, ColMajor, 1>;
CAIRN_DENSE_EXTERN template struct triangular_solve_matrix<double, Index, OnTheLeft, UnitUpper,
                                                           false, RowMajor, ColMajor, 1>;

}  // namespace Eigen::internal
#endif
