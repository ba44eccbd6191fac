// SPDX-License-Identifier: BSD-3-Clause
#include "information.hpp"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/graph/packed.hpp"

namespace cairn::formats {
namespace {

std::array<double, 6> copy_of(std::span<const double, 6> numbers) {
  std::array<double, 6> copy;
  std::copy(numbers.begin(), numbers.end(), copy.begin());
  return copy;
}

}  // namespace

const Arrangement kRows{[](std::span<const double> as_in_file, std::span<double> rows) {
  std::ranges::copy(as_in_file, rows.begin());
}};

const Arrangement kToroOrder{[](std::span<const double> toro, std::span<double> rows) {
  constexpr std::array<std::size_t, 6> kPlaces{0, 1, 4, 2, 5, 3};
  for (std::size_t k = 0; k < kPlaces.size(); ++k) rows[k] = toro[kPlaces[k]];
}};

const Arrangement kRoot{[](std::span<const double> root, std::span<double> rows) {
                          std::ranges::copy(root, rows.begin());
                          int n = 1;
                          while (packed_size(n) < rows.size()) ++n;
                          square_from_root(n, rows);
                        },
                        true};

void to_toro_order(std::span<double, 6> information) {
  const auto [i11, i12, i13, i22, i23, i33] = copy_of(information);
  const std::array<double, 6> toro{i11, i12, i22, i33, i13, i23};
  std::copy(toro.begin(), toro.end(), information.begin());
}

void square_from_root(int n, std::span<double> triangle) {
  // (UᵀU)(i, j) = Σ_{k ≤ i} U(k, i) U(k, j): entries further down need only rows that are further
  // up, so working from the last row to the first never reads what was already replaced.
  for (int i = n - 1; i >= 0; --i) {
    for (int j = n - 1; j >= i; --j) {
      double sum = 0.0;
      for (int k = 0; k <= i; ++k) {
        sum += triangle[triangle_index(n, k, i)] * triangle[triangle_index(n, k, j)];
      }
      triangle[triangle_index(n, i, j)] = sum;
    }
  }
}

std::optional<FailedPivot> first_failed_pivot(int n, std::span<const double> information) {
  constexpr int kSmall = 21;  // up to 6 × 6, which nearly all are, without allocating
  std::array<double, kSmall> small;
  std::vector<double> large;
  double* u = small.data();
  if (information.size() > kSmall) {
    large.resize(information.size());
    u = large.data();
  }
  std::copy(information.begin(), information.end(), u);
  // Row by row: what is left after eliminating row k is A(i, j) − A(k, i) A(k, j) / A(k, k).
  for (int k = 0; k < n; ++k) {
    const double* row = u + triangle_index(n, k, k);
    const double pivot = row[0];
    if (!(pivot > 0.0)) return FailedPivot{k, pivot};
    for (int i = k + 1; i < n; ++i) {
      const double factor = row[i - k] / pivot;
      double* target = u + triangle_index(n, i, i);
      for (int j = i; j < n; ++j) target[j - i] -= factor * row[j - k];
    }
  }
  return std::nullopt;
}

std::string what_is_indefinite(int n, std::span<const double> information) {
  std::vector<double> rest(information.begin(), information.end());
  for (int row = 0; row < n; ++row) {
    const auto diagonal = static_cast<std::size_t>(triangle_index(n, row, row));
    if (information[diagonal] < 0.0)
      return fmt::format("entry ({0}, {0}) is {1:.6g}", row + 1, information[diagonal]);
    if (information[diagonal] == 0.0) rest[diagonal] = 1.0;  // of a row that measures nothing
  }
  for (int row = 0; row < n; ++row) {
    for (int column = 0; column < n; ++column) {
      const auto [i, j] = std::minmax(row, column);
      const double entry = information[static_cast<std::size_t>(triangle_index(n, i, j))];
      if (information[static_cast<std::size_t>(triangle_index(n, row, row))] == 0.0 && entry != 0.0)
        return fmt::format("entry ({0}, {0}) is 0, and ({0}, {1}) is {2:.6g}", row + 1, column + 1,
                           entry);
    }
  }
  const auto failed = first_failed_pivot(n, rest);
  return failed ? fmt::format("pivot {} of its Cholesky factor is {:.6g}", failed->row + 1,
                              failed->pivot)
                : "by more than rounding";
}

bool repair_misplaced_entries(std::span<double, 21> information) {
  constexpr int kZRoll = triangle_index(6, 2, 3), kZPitch = triangle_index(6, 2, 4);
  constexpr int kXYaw = triangle_index(6, 0, 5), kYYaw = triangle_index(6, 1, 5);
  if (information[kXYaw] != 0.0 || information[kYYaw] != 0.0) return false;
  if (is_positive_definite(6, information)) return false;
  std::array<double, 21> mended;
  std::copy(information.begin(), information.end(), mended.begin());
  std::swap(mended[kZRoll], mended[kXYaw]);
  std::swap(mended[kZPitch], mended[kYYaw]);
  if (!is_positive_definite(6, mended)) return false;
  std::copy(mended.begin(), mended.end(), information.begin());
  return true;
}

bool fits_g2o(std::span<const double, 6> as_in_file) { return is_positive_definite(3, as_in_file); }

bool fits_toro(std::span<const double, 6> as_in_file) {
  std::array<double, 6> information;
  kToroOrder.to_rows(as_in_file, information);
  return is_positive_definite(3, information);
}

bool fits_isam(std::span<const double, 6> as_in_file) {
  return as_in_file[0] > 0.0 && as_in_file[3] > 0.0 && as_in_file[5] > 0.0;
}

std::string other_order_hint(std::span<const double, 6> as_in_file, std::string_view read_as,
                             bool has_vertices) {
  if (read_as == "g2o" && fits_toro(as_in_file)) {
    return "; the numbers would fit TORO's order of information, I11 I12 I22 I33 I13 I23, whose "
           "tag is EDGE2";
  }
  if (read_as == "isam" && fits_toro(as_in_file)) {
    return "; the numbers would fit TORO's order of information (format toro)";
  }
  if (read_as == "toro" && !has_vertices && fits_isam(as_in_file)) {
    return "; the numbers would fit iSAM's square root of the information (format isam)";
  }
  if (read_as == "toro" && fits_g2o(as_in_file)) {
    return "; the numbers would fit g2o's order of information, I11 I12 I13 I22 I23 I33, whose tag "
           "is EDGE_SE2";
  }
  return {};
}

}  // namespace cairn::formats
