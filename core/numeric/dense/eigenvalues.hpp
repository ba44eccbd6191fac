// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Eigenvalues>

#include "dense/cholesky.hpp"

// Of a matrix, not of an expression: SelfAdjointEigenSolver<MatrixXd>(MatrixXd(A + B)).

#if defined(CAIRN_DENSE_COMPILED_ONCE)
namespace Eigen {

CAIRN_DENSE_EXTERN template SelfAdjointEigenSolver<MatrixXd>&
SelfAdjointEigenSolver<MatrixXd>::compute(const EigenBase<MatrixXd>&, int);

}  // namespace Eigen
#endif
