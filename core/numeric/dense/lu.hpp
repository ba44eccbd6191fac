// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/LU>

#include "dense/triangular.hpp"

#if defined(CAIRN_DENSE_COMPILED_ONCE)
namespace Eigen {

CAIRN_DENSE_EXTERN template void PartialPivLU<MatrixXd>::compute();

}  // namespace Eigen
#endif
