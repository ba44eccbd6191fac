// SPDX-License-Identifier: BSD-3-Clause
// Compiles what the headers of this folder declare.
#define CAIRN_DENSE_EXTERN
#include "dense/cholesky.hpp"
#include "dense/eigenvalues.hpp"
#include "dense/lu.hpp"
#include "dense/products.hpp"
#include "dense/triangular.hpp"

namespace cairn::dense {

using Eigen::MatrixXd;

MatrixXd product(const View& A, const View& B) { return A * B; }
MatrixXd product_of_transpose(const View& A, const View& B) { return A.transpose() * B; }
MatrixXd scaled_product_of_transpose(double a, const View& A, const View& B) {
  return a * A.transpose() * B;
}
MatrixXd product_with_transpose(const View& A, const View& B) { return A * B.transpose(); }
MatrixXd congruent(const View& A, const View& S) { return A * S * A.transpose(); }
MatrixXd congruent_of_transpose(const View& A, const View& S) { return A.transpose() * S * A; }
MatrixXd from_eigenvalues(const View& V, const Eigen::VectorXd& values) {
  return V * values.asDiagonal() * V.transpose();
}

void fit(MatrixXd& C, Eigen::Index rows, Eigen::Index columns) {
  if (C.rows() == rows && C.cols() == columns) return;
  C.resize(0, 0);
  C.resize(rows, columns);
}
void set_product(const View& A, const View& B, MatrixXd& C) {
  fit(C, A.rows(), B.cols());
  C.noalias() = A * B;
}
void set_product_with_transpose(const View& A, const View& B, MatrixXd& C) {
  fit(C, A.rows(), B.rows());
  C.noalias() = A * B.transpose();
}
void add_product(const View& A, const View& B, Eigen::Ref<MatrixXd> C) { C.noalias() += A * B; }
void add_product_of_transpose(const View& A, const View& B, Eigen::Ref<MatrixXd> C) {
  C.noalias() += A.transpose() * B;
}
void add_product_with_transpose(const View& A, const View& B, Eigen::Ref<MatrixXd> C) {
  C.noalias() += A * B.transpose();
}
void subtract_product(const View& A, const View& B, Eigen::Ref<MatrixXd> C) {
  C.noalias() -= A * B;
}
void subtract_product_of_transpose(const View& A, const View& B, Eigen::Ref<MatrixXd> C) {
  C.noalias() -= A.transpose() * B;
}
void subtract_congruent(const View& A, const View& S, Eigen::Ref<MatrixXd> C) {
  C.noalias() -= A * S * A.transpose();
}

}  // namespace cairn::dense
