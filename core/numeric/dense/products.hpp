// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

// Eigen's kernels for matrices of a size known only at run time, compiled once (dense.cpp) instead
// of in each file that multiplies two matrices or decomposes one: seconds of compiling a file. The
// headers of this folder stand for those of Eigen, and change nothing of what is computed. Only
// what Eigen does not inline is declared here. Other versions of Eigen may have other kernels;
// with these every file compiles its own.
#if EIGEN_VERSION_AT_LEAST(3, 4, 0) && !EIGEN_VERSION_AT_LEAST(3, 4, 90)
#define CAIRN_DENSE_COMPILED_ONCE
#endif
#ifndef CAIRN_DENSE_EXTERN  // empty where they are compiled
#define CAIRN_DENSE_EXTERN extern
#endif

#if defined(CAIRN_DENSE_COMPILED_ONCE)
namespace Eigen::internal {

using CairnTraits = gebp_traits<double, double>;
using CairnByColumns = const_blas_data_mapper<double, Index, ColMajor>;
using CairnByRows = const_blas_data_mapper<double, Index, RowMajor>;

// Matrix by matrix
CAIRN_DENSE_EXTERN template struct gebp_kernel<double, double, Index,
                                               blas_data_mapper<double, Index, ColMajor>,
                                               CairnTraits::mr, CairnTraits::nr, false, false>;
CAIRN_DENSE_EXTERN template struct gemm_pack_lhs<double, Index, CairnByColumns, CairnTraits::mr,
                                                 CairnTraits::LhsProgress,
                                                 CairnTraits::LhsPacket4Packing, ColMajor>;
CAIRN_DENSE_EXTERN template struct gemm_pack_lhs<double, Index, CairnByRows, CairnTraits::mr,
                                                 CairnTraits::LhsProgress,
                                                 CairnTraits::LhsPacket4Packing, RowMajor>;
CAIRN_DENSE_EXTERN template struct gemm_pack_rhs<double, Index, CairnByColumns, CairnTraits::nr,
                                                 ColMajor>;
CAIRN_DENSE_EXTERN template struct gemm_pack_rhs<double, Index, CairnByRows, CairnTraits::nr,
                                                 RowMajor>;

// Matrix by vector
CAIRN_DENSE_EXTERN template struct general_matrix_vector_product<
    Index, double, CairnByColumns, ColMajor, false, double, CairnByRows, false>;
CAIRN_DENSE_EXTERN template struct general_matrix_vector_product<
    Index, double, CairnByRows, RowMajor, false, double, CairnByColumns, false>;

}  // namespace Eigen::internal
#endif

// Products that many files need, as Eigen computes the expressions: to the last bit where a matrix
// is made of them, or with noalias(). Assigned to a matrix that is there, A S Aᵀ is first computed
// by rows in a temporary matrix, and solve(Bᵀ) likewise, with other rounding.
namespace cairn::dense {

/// A matrix, or a block or map of one.
using View = Eigen::Ref<const Eigen::MatrixXd>;

/// A B
Eigen::MatrixXd product(const View& A, const View& B);
/// Aᵀ B
Eigen::MatrixXd product_of_transpose(const View& A, const View& B);
/// a Aᵀ B
Eigen::MatrixXd scaled_product_of_transpose(double a, const View& A, const View& B);
/// A Bᵀ
Eigen::MatrixXd product_with_transpose(const View& A, const View& B);
/// A S Aᵀ
Eigen::MatrixXd congruent(const View& A, const View& S);
/// Aᵀ S A
Eigen::MatrixXd congruent_of_transpose(const View& A, const View& S);

/// V diag(values) Vᵀ: the symmetric matrix of these eigenvectors and eigenvalues.
Eigen::MatrixXd from_eigenvalues(const View& V, const Eigen::VectorXd& values);

/// Gives C this size; its elements are undefined then. Where there is no memory for it, C is empty:
/// a matrix that Eigen 3.4 resizes itself keeps a pointer to what it has freed.
void fit(Eigen::MatrixXd& C, Eigen::Index rows, Eigen::Index columns);
/// C = A B, C = A Bᵀ; C is neither A nor B.
void set_product(const View& A, const View& B, Eigen::MatrixXd& C);
void set_product_with_transpose(const View& A, const View& B, Eigen::MatrixXd& C);
/// C += A B, C += Aᵀ B, C += A Bᵀ; C is neither A nor B.
void add_product(const View& A, const View& B, Eigen::Ref<Eigen::MatrixXd> C);
void add_product_of_transpose(const View& A, const View& B, Eigen::Ref<Eigen::MatrixXd> C);
void add_product_with_transpose(const View& A, const View& B, Eigen::Ref<Eigen::MatrixXd> C);
/// C −= A B, C −= Aᵀ B; C is neither A nor B.
void subtract_product(const View& A, const View& B, Eigen::Ref<Eigen::MatrixXd> C);
void subtract_product_of_transpose(const View& A, const View& B, Eigen::Ref<Eigen::MatrixXd> C);
/// C −= A S Aᵀ; C is neither A nor S.
void subtract_congruent(const View& A, const View& S, Eigen::Ref<Eigen::MatrixXd> C);

}  // namespace cairn::dense
