// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

#include <fmt/core.h>

#include "arrays.hpp"
#include "cairn/graph/information.hpp"
#include "cairn/graph/rounding.hpp"
#include "cairn/runtime/error.hpp"
#include "measured.hpp"

namespace cairn::python {
namespace {

std::size_t size_of(int n) { return static_cast<std::size_t>(n); }

Error wrong_shape(const char* what, const py::array& array, const std::string& expected) {
  return {ErrorCode::usage,
          fmt::format("{}: the shape is {}, expected {}", what, shape_text(array), expected)};
}

/// n standard deviations, or one for all.
std::vector<double> information_of(std::span<const double> sigmas, int n) {
  if (sigmas.size() == 1) return Information::isotropic(n, sigmas[0]).packed();
  return Information::sigmas(sigmas).packed();
}

Eigen::Map<const Eigen::MatrixXd> matrix(const double* numbers, int n) {
  return {numbers, n, n};  // which is symmetric, so that its order does not matter
}

std::vector<double> information_of(const double* numbers, int n) {
  return Information::matrix(matrix(numbers, n)).packed();
}

/// Packs one of many matrices, whose symmetry is checked here; the rest is, when it is added.
void pack_symmetric(const double* A, int n, std::size_t number, double* out) {
  const bool floats = are_floats({A, size_of(n) * size_of(n)});
  const double allowed = floats ? 1e-5 : 1e-9;
  for (int row = 0; row < n; ++row) {
    for (int column = row; column < n; ++column) {
      const double upper = A[row * n + column], lower = A[column * n + row];
      if (std::abs(upper - lower) > allowed * std::max(std::abs(upper), std::abs(lower))) {
        throw Error(ErrorCode::input,
                    fmt::format("information[{}] is not symmetric: entries ({}, {}) and ({}, {}) "
                                "are {} and {}",
                                number, row, column, column, row, upper, lower));
      }
      *out++ = upper;
    }
  }
}

void append(std::vector<double>& all, std::span<const double> one) {
  all.insert(all.end(), one.begin(), one.end());
}

std::vector<double> many_of_sigmas(const Doubles& sigmas, int n, std::size_t count) {
  const bool fits = sigmas.ndim() == 2 && sigmas.shape(0) == static_cast<py::ssize_t>(count) &&
                    sigmas.shape(1) == n;
  if (!fits) throw wrong_shape("sigmas", sigmas, fmt::format("({},) or ({}, {})", n, count, n));
  std::vector<double> all;
  all.reserve(count * packed_size(n));
  for (std::size_t k = 0; k < count; ++k)
    append(all, detail::information_of_sigmas(span_of(sigmas).subspan(k * size_of(n), size_of(n))));
  return all;
}

std::vector<double> many_of_information(const Doubles& given, int n, std::size_t count) {
  const auto rows = static_cast<py::ssize_t>(count);
  const auto packed = static_cast<py::ssize_t>(packed_size(n));
  if (given.ndim() == 2 && given.shape(0) == rows && given.shape(1) == packed) {
    const std::span<const double> numbers = span_of(given);
    return {numbers.begin(), numbers.end()};
  }
  if (given.ndim() != 3 || given.shape(0) != rows || given.shape(1) != n || given.shape(2) != n) {
    throw wrong_shape("information", given,
                      fmt::format("({1}, {1}), ({0}, {1}, {1}) or, packed, ({0}, {2})", count, n,
                                  packed_size(n)));
  }
  std::vector<double> all(count * packed_size(n));
  for (std::size_t k = 0; k < count; ++k)
    pack_symmetric(given.data() + k * size_of(n * n), n, k, all.data() + k * packed_size(n));
  return all;
}

}  // namespace

void Noise::check_one_given() const {
  const int given =
      int{!sigmas.is_none()} + int{!information.is_none()} + int{!covariance.is_none()};
  if (given == 1) return;
  throw Error(ErrorCode::usage,
              given == 0 ? "how certain is the measurement? Give sigmas= (standard deviations), "
                           "information= or covariance= (a matrix)"
                         : "give one of sigmas=, information= and covariance=, not several");
}

std::vector<double> Noise::packed(int n) const {
  check_one_given();
  if (!sigmas.is_none()) {
    const Doubles numbers = doubles_of(sigmas, "sigmas");
    if (numbers.ndim() > 1 || (numbers.size() != 1 && numbers.size() != n))
      throw wrong_shape("sigmas", numbers, fmt::format("({},), or one number for all", n));
    return information_of(span_of(numbers), n);
  }
  const bool inverse = information.is_none();
  const char* what = inverse ? "covariance" : "information";
  const Doubles numbers = doubles_of(inverse ? covariance : information, what);
  if (numbers.ndim() != 2 || numbers.shape(0) != n || numbers.shape(1) != n)
    throw wrong_shape(what, numbers, fmt::format("({0}, {0})", n));
  return inverse ? Information::covariance(matrix(numbers.data(), n)).packed()
                 : information_of(numbers.data(), n);
}

std::vector<double> Noise::packed(int n, std::size_t count) const {
  check_one_given();
  if (!covariance.is_none()) {
    throw Error(ErrorCode::usage,
                "many measurements take sigmas= or information=; numpy.linalg.inv makes "
                "information of covariances");
  }
  const bool by_sigmas = !sigmas.is_none();
  const Doubles given =
      doubles_of(by_sigmas ? sigmas : information, by_sigmas ? "sigmas" : "information");
  const bool one_for_all = by_sigmas
                               ? given.ndim() <= 1
                               : given.ndim() == 2 && given.shape(0) == n && given.shape(1) == n;
  if (!one_for_all)
    return by_sigmas ? many_of_sigmas(given, n, count) : many_of_information(given, n, count);
  return packed(n);
}

}  // namespace cairn::python
