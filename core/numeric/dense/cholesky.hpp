// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Cholesky>

#include "dense/triangular.hpp"

// Of a matrix, not of an expression: LLT<MatrixXd>(MatrixXd(A - B)).

#if defined(CAIRN_DENSE_COMPILED_ONCE)
namespace Eigen {

CAIRN_DENSE_EXTERN template LLT<MatrixXd>& LLT<MatrixXd>::compute(const EigenBase<MatrixXd>&);
CAIRN_DENSE_EXTERN template void LLT<MatrixXd>::_solve_impl(const MatrixXd&, MatrixXd&) const;
CAIRN_DENSE_EXTERN template void LLT<MatrixXd>::_solve_impl(const MatrixXd::IdentityReturnType&,
                                                            MatrixXd&) const;
CAIRN_DENSE_EXTERN template void LLT<MatrixXd>::_solve_impl(const VectorXd&, VectorXd&) const;

CAIRN_DENSE_EXTERN template LDLT<MatrixXd>& LDLT<MatrixXd>::compute(const EigenBase<MatrixXd>&);
CAIRN_DENSE_EXTERN template void LDLT<MatrixXd>::_solve_impl(const MatrixXd&, MatrixXd&) const;
CAIRN_DENSE_EXTERN template void LDLT<MatrixXd>::_solve_impl(const VectorXd&, VectorXd&) const;

}  // namespace Eigen
#endif
