// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <concepts>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "cairn/graph/packed.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {
namespace detail {

/// The packed information of a dense n × n matrix (column-major), or of its inverse: a covariance.
/// Throws `Error` (input) where it is not finite, not symmetric or not positive (semi)definite.
CAIRN_API std::vector<double> checked_information(std::span<const double> dense, std::int64_t rows,
                                                  std::int64_t columns);
CAIRN_API std::vector<double> inverted_covariance(std::span<const double> dense, std::int64_t rows,
                                                  std::int64_t columns);
CAIRN_API std::vector<double> information_of_sigmas(std::span<const double> sigmas);
CAIRN_API void check_packed_information(std::span<const double> packed);

}  // namespace detail

/// How certain a measurement is: the information matrix Ω = Σ⁻¹ of its error (noise model), n × n
/// for a residual of n numbers, in the order and the units of the residual: of a pose in the plane
/// x, y [1/m²], theta [1/rad²]; of a pose in space translation, then rotation.
///
/// It is symmetric and positive semidefinite; directions that are not measured have no information.
/// Every function throws `Error` (input) that says what is wrong with the numbers. Implicitly a
/// span of the packed upper triangle (`packed.hpp`).
///
///     Information::sigmas(0.1, 0.1, 0.05)    // standard deviations [m, m, rad]
///     Information::isotropic(6, 0.02)        // the same in each of six
///     Information::covariance(Sigma)
class Information {
 public:
  /// Independent errors of these standard deviations > 0; infinity for what is not measured.
  template <std::convertible_to<double>... Sigma>
  requires(sizeof...(Sigma) > 0) static Information sigmas(Sigma... sigma) {
    const double all[] = {static_cast<double>(sigma)...};
    return Information(detail::information_of_sigmas(all));
  }
  static Information sigmas(std::span<const double> all) {
    return Information(detail::information_of_sigmas(all));
  }
  /// n independent errors of one standard deviation > 0.
  static Information isotropic(int n, double sigma) {
    return sigmas(std::vector<double>(n, sigma));
  }
  /// The identity: errors of standard deviation 1.
  static Information unit(int n) { return isotropic(n, 1.0); }
  /// The information matrix itself.
  static Information matrix(const Eigen::MatrixXd& Omega) {
    return Information(detail::checked_information(view(Omega), Omega.rows(), Omega.cols()));
  }
  /// The inverse of a covariance matrix, which must be positive definite.
  static Information covariance(const Eigen::MatrixXd& Sigma) {
    return Information(detail::inverted_covariance(view(Sigma), Sigma.rows(), Sigma.cols()));
  }
  /// An upper triangle row by row, as files have it.
  static Information packed(std::vector<double> upper) {
    detail::check_packed_information(upper);
    return Information(std::move(upper));
  }

  /// n: rows of the matrix.
  int size() const {
    int n = 0;
    while (packed_size(n) < upper_.size()) ++n;
    return n;
  }
  /// The matrix, n × n.
  Eigen::MatrixXd matrix() const { return unpack(upper_, size()); }
  /// The upper triangle row by row, n(n+1)/2 numbers.
  const std::vector<double>& packed() const { return upper_; }
  operator std::span<const double>() const {
    return upper_;
  }  // NOLINT(google-explicit-constructor)

 private:
  explicit Information(std::vector<double> upper) : upper_(std::move(upper)) {}
  static std::span<const double> view(const Eigen::MatrixXd& A) {
    return {A.data(), static_cast<std::size_t>(A.size())};
  }

  std::vector<double> upper_;
};

}  // namespace cairn
