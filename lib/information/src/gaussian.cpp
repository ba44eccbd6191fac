// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/information/gaussian.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"
#include "dense/cholesky.hpp"
#include "dense/products.hpp"

namespace cairn {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

template <int N>
using Square = Eigen::Matrix<double, N, N>;

template <class... Parts>
[[noreturn]] void misfit(const char* function, fmt::format_string<Parts&...> text, Parts... parts) {
  throw Error(ErrorCode::usage, fmt::format("{}: {}", function, fmt::format(text, parts...)));
}

void need_square(const MatrixView& A, const char* function, const char* what) {
  if (A.rows() == A.cols()) return;
  misfit(function, "the {} is {} × {}, and must be square", what, A.rows(), A.cols());
}

[[noreturn]] void refuse(const char* function, const char* what) {
  throw Error(ErrorCode::numerical,
              fmt::format("{}: the {} is not positive definite", function, what));
}

/// A measure that came out of matrices with entries that are not numbers.
double checked(double nats, const char* function) {
  if (std::isnan(nats))
    throw Error(ErrorCode::numerical, fmt::format("{}: a matrix is not finite", function));
  return nats;
}

template <class Matrix>
Eigen::LLT<Matrix> factor(const Matrix& A, const char* function, const char* what) {
  Eigen::LLT<Matrix> llt(A);
  // Eigen takes what is not a number for a good pivot.
  if (llt.info() != Eigen::Success || !llt.matrixLLT().diagonal().allFinite())
    refuse(function, what);
  return llt;
}

template <class Matrix>
double log_determinant(const Eigen::LLT<Matrix>& llt) {
  return 2.0 * llt.matrixLLT().diagonal().array().log().sum();
}

/// L⁻¹ X in the place of X, which may be empty: Eigen takes the address of its first number.
template <class Matrix, class Block>
void solve_lower(const Eigen::LLT<Matrix>& llt, Block& X) {
  if (X.size() > 0) llt.matrixL().solveInPlace(X);
}

/// L⁻¹ A L⁻ᵀ of a symmetric A.
template <class Matrix>
Matrix whitened(const Eigen::LLT<Matrix>& llt, const Matrix& A) {
  Matrix X = A;
  solve_lower(llt, X);
  X.transposeInPlace();
  solve_lower(llt, X);
  return X;
}

/// x − ln(1 + x), to its last digits also where x is small.
double excess_over_log(double x) {
  if (std::abs(x) > 0.02) return x - std::log1p(x);
  double sum = 0.0, power = -x;  // Σ (−x)ᵏ/k from k = 2 on
  for (int k = 2; k < 12; ++k) {
    power *= -x;
    sum += power / k;
  }
  return sum;
}

/// Of I + D, with D symmetric. Its Cholesky factor L has L_kk² = 1 + e_k with e_k = D_kk − s_k and
/// s_k the squared norm of row k before the diagonal: neither loses digits where D is small, as
/// they would in 1 + D.
struct NearIdentity {
  double log_determinant = 0.0;  ///< Σ ln(1 + e_k)
  double excess = 0.0;       ///< tr D − ln |I + D| = Σ (s_k + e_k − ln(1 + e_k)), if asked for
  double least_pivot = 1.0;  ///< L_kk²
};

/// None if I + D is not positive definite.
template <class Matrix>
std::optional<NearIdentity> near_identity(const Matrix& D, bool with_excess = false) {
  Matrix A = D;
  A.diagonal().array() += 1.0;
  const Eigen::LLT<Matrix> llt(A);
  if (llt.info() != Eigen::Success) return std::nullopt;
  const Matrix& L = llt.matrixLLT();
  NearIdentity result;
  // Π (1 + e_k) − 1, by which one logarithm does for many factors.
  double product = 0.0;
  for (Eigen::Index k = 0; k < L.rows(); ++k) {
    const double s = L.row(k).head(k).squaredNorm(), e = D(k, k) - s;
    const double pivot = L(k, k) * L(k, k);
    result.least_pivot = std::min(result.least_pivot, pivot);
    if (with_excess) result.excess += s + excess_over_log(e);
    if (e < -0.5) {
      result.log_determinant += std::log(pivot);
    } else {
      product += e * (1.0 + product);
    }
    if (product < -0.5 || product > 1e100) {
      result.log_determinant += std::log1p(product);
      product = 0.0;
    }
  }
  result.log_determinant += std::log1p(product);
  return result;
}

template <class Matrix>
double information_gain_of(const Matrix& S, const Matrix& R) {
  const char* function = "information_gain";
  const Eigen::LLT<Matrix> noise = factor(R, function, "noise covariance");
  if constexpr (Matrix::RowsAtCompileTime != Eigen::Dynamic) {
    // |L| of both: a quotient of products, and one logarithm.
    const Eigen::LLT<Matrix> sum(S + R);
    const double ratio = sum.matrixLLT().diagonal().prod() / noise.matrixLLT().diagonal().prod();
    if (sum.info() == Eigen::Success && ratio > 1.01 && std::isfinite(ratio))
      return std::log(ratio);
  }
  const auto gain = near_identity<Matrix>(whitened<Matrix>(noise, S));
  if (!gain) refuse(function, "sum of noise and prior covariance");
  return std::max(0.0, 0.5 * checked(gain->log_determinant, function));
}

/// ½ (tr M − ln |M| − n) with M = A⁻¹ B, `a` being the Cholesky factor of A.
double divergence_of(const Eigen::LLT<MatrixXd>& a, const MatrixXd& A, const MatrixXd& B,
                     const char* function, const char* what) {
  const MatrixXd D = whitened<MatrixXd>(a, B - A);
  if (D.norm() < 0.5) {
    if (const auto near = near_identity(D, true)) return 0.5 * near->excess;
  }
  // Far apart, what is lost in 1 + D is of no account, and B may be small beside A.
  const Eigen::LLT<MatrixXd> b = factor(B, function, what);
  MatrixXd root = b.matrixL();
  solve_lower(a, root);
  const double log_ratio = log_determinant(b) - log_determinant(a);
  return std::max(0.0, 0.5 * (root.squaredNorm() - log_ratio - static_cast<double>(B.rows())));
}

void need_alike(const char* function, const MatrixView& A, const VectorXd& a, const MatrixView& B,
                const VectorXd& b) {
  need_square(A, function, "first matrix");
  need_square(B, function, "second matrix");
  if (A.rows() == B.rows() && a.size() == A.rows() && b.size() == A.rows()) return;
  misfit(function, "sizes differ: {} and {} coordinates, with means of {} and {}", A.rows(),
         B.rows(), a.size(), b.size());
}

/// L_b⁻¹ Σ_ba of a joint matrix, and the factor of Σ_b.
struct Conditioned {
  Eigen::LLT<MatrixXd> b;
  MatrixXd across;
};

Conditioned condition(const MatrixView& joint, int size_a, const char* function) {
  need_square(joint, function, "joint matrix");
  if (size_a < 0 || size_a > joint.rows())
    misfit(function, "the first block has {} of {} coordinates", size_a, joint.rows());
  const Eigen::Index size_b = joint.rows() - size_a;
  Conditioned result{factor<MatrixXd>(joint.bottomRightCorner(size_b, size_b), function,
                                      "marginal of the second block"),
                     joint.bottomLeftCorner(size_b, size_a)};
  solve_lower(result.b, result.across);
  return result;
}

}  // namespace

double entropy(const MatrixView& covariance) {
  need_square(covariance, "entropy", "covariance");
  return entropy_of_information(
      covariance.rows(), -log_determinant(factor<MatrixXd>(covariance, "entropy", "covariance")));
}

double entropy_of_information(std::int64_t size, double log_determinant) {
  static const double kLog2PiE = std::log(2.0 * std::numbers::pi) + 1.0;
  return 0.5 * (static_cast<double>(size) * kLog2PiE - log_determinant);
}

double conditional_entropy(const MatrixView& joint, int size_a) {
  const char* function = "conditional_entropy";
  const MatrixXd across = condition(joint, size_a, function).across;
  const MatrixXd left =
      joint.topLeftCorner(size_a, size_a) - dense::product_of_transpose(across, across);
  return entropy_of_information(size_a,
                                -log_determinant(factor(left, function,
                                                        "covariance of the first block, given the "
                                                        "second,")));
}

double mutual_information(const MatrixView& joint, int size_a) {
  const char* function = "mutual_information";
  const Conditioned given = condition(joint, size_a, function);
  const MatrixXd first = joint.topLeftCorner(size_a, size_a);
  MatrixXd W = given.across.transpose();  // Σ_ab L_b⁻ᵀ
  solve_lower(factor(first, function, "marginal of the first block"), W);
  const bool wide = W.cols() > W.rows();
  const MatrixXd D =
      wide ? MatrixXd(-dense::product_with_transpose(W, W)) : -dense::product_of_transpose(W, W);
  const auto near = near_identity(D);
  const double rounding =
      static_cast<double>(joint.rows()) * std::numeric_limits<double>::epsilon();
  if (!near || near->least_pivot <= rounding) return std::numeric_limits<double>::infinity();
  return std::max(0.0, -0.5 * checked(near->log_determinant, function));
}

double information_gain(const MatrixView& S, const MatrixView& R) {
  need_square(S, "information_gain", "prior covariance");
  need_square(R, "information_gain", "noise covariance");
  if (S.rows() != R.rows())
    misfit("information_gain", "the prior has {} coordinates and the noise {}", S.rows(), R.rows());
  switch (S.rows()) {
    case 1:
      return information_gain_of<Square<1>>(S, R);
    case 2:
      return information_gain_of<Square<2>>(S, R);
    case 3:
      return information_gain_of<Square<3>>(S, R);
    case 4:
      return information_gain_of<Square<4>>(S, R);
    case 5:
      return information_gain_of<Square<5>>(S, R);
    case 6:
      return information_gain_of<Square<6>>(S, R);
    default:
      return information_gain_of<MatrixXd>(S, R);
  }
}

double information_gain(const MatrixView& J, const MatrixView& covariance, const MatrixView& R) {
  if (J.rows() != R.rows() || J.cols() != covariance.rows() ||
      covariance.rows() != covariance.cols()) {
    misfit("information_gain",
           "a Jacobian of {} × {} does not fit a covariance of {} × {} and noise of {} × {}",
           J.rows(), J.cols(), covariance.rows(), covariance.cols(), R.rows(), R.cols());
  }
  return information_gain(dense::congruent(J, covariance), R);
}

Divergence kullback_leibler(const Gaussian& p, const Gaussian& q) {
  const char* function = "kullback_leibler";
  need_alike(function, p.covariance, p.mean, q.covariance, q.mean);
  const Eigen::LLT<MatrixXd> of_q = factor(q.covariance, function, "second covariance");
  Divergence result;
  result.covariance = checked(
      divergence_of(of_q, q.covariance, p.covariance, function, "first covariance"), function);
  VectorXd shift = q.mean - p.mean;
  solve_lower(of_q, shift);
  result.mean = checked(0.5 * shift.squaredNorm(), function);
  return result;
}

Divergence kullback_leibler(const InformationForm& p, const InformationForm& q) {
  const char* function = "kullback_leibler";
  need_alike(function, p.matrix, p.vector, q.matrix, q.vector);
  const Eigen::LLT<MatrixXd> of_p = factor(p.matrix, function, "first information matrix"),
                             of_q = factor(q.matrix, function, "second information matrix");
  Divergence result;
  result.covariance = checked(
      divergence_of(of_p, p.matrix, q.matrix, function, "second information matrix"), function);
  const VectorXd shift = VectorXd(of_q.solve(q.vector)) - VectorXd(of_p.solve(p.vector));
  result.mean = checked(0.5 * (of_q.matrixU() * shift).squaredNorm(), function);
  return result;
}

Divergence jeffreys(const Gaussian& p, const Gaussian& q) {
  const Divergence forth = kullback_leibler(p, q), back = kullback_leibler(q, p);
  return {forth.covariance + back.covariance, forth.mean + back.mean};
}

double cross_entropy(const Gaussian& p, const Gaussian& q) {
  return entropy(p.covariance) + kullback_leibler(p, q).total();
}

}  // namespace cairn
