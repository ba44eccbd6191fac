// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace cairn::formats {

// Information matrices as they stand in files, and as cairn keeps them: the upper triangle row by
// row, n(n+1)/2 numbers, which is g2o's order.

/// Where entry (row, column), row ≤ column, of an n × n matrix stands in its upper triangle.
constexpr int triangle_index(int n, int row, int column) {
  return row * n - row * (row - 1) / 2 + (column - row);
}

/// How the numbers at the end of a factor's line become its information.
struct Arrangement {
  /// From the numbers of the line to rows of the upper triangle.
  void (*to_rows)(std::span<const double> as_in_file, std::span<double> rows);
  /// They are a square root of it, so that the result is semidefinite whatever was rounded.
  bool is_root = false;
};
/// As they stand.
extern const Arrangement kRows;
/// TORO's order of a planar pose: I11 I12 I22 I33 I13 I23.
extern const Arrangement kToroOrder;
/// iSAM's upper-triangular square root U, row by row: the information is UᵀU.
extern const Arrangement kRoot;

/// From rows of the upper triangle to TORO's order of a planar pose.
void to_toro_order(std::span<double, 6> information);

/// Upper-triangular square root U (n × n, row by row) to information UᵀU, in place.
void square_from_root(int n, std::span<double> triangle);

/// The row at which the Cholesky factorisation of an information matrix stops because its pivot is
/// not positive, and that pivot; nothing if the matrix is positive definite.
struct FailedPivot {
  int row;
  double pivot;
};
std::optional<FailedPivot> first_failed_pivot(int n, std::span<const double> information);
inline bool is_positive_definite(int n, std::span<const double> information) {
  return !first_failed_pivot(n, information);
}

/// Why a matrix is not positive semidefinite: a negative entry of its diagonal, one of zero beside
/// others in its row, else the pivot of its Cholesky factor that is negative.
std::string what_is_indefinite(int n, std::span<const double> information);

/// Repairs a known mistake in the information of a spatial relative pose (21 numbers, rows x y z rx
/// ry rz): the (z, rx) and (z, ry) entries contain the values of (x, rz) and (y, rz), as in the
/// published `cubicle`. Changes nothing, and returns false, unless the matrix is not positive
/// definite, the places that the entries would move to are zero, and the result is positive
/// definite.
bool repair_misplaced_entries(std::span<double, 21> information);

/// What else the six numbers of a planar pose's information may be that are not positive definite
/// as they were read; empty if nothing. A format is named only where it reads lines of these tags
/// too: TORO's text, unless it `has_vertices`, is read as iSAM's, and the reverse.
std::string other_order_hint(std::span<const double, 6> as_in_file, std::string_view read_as,
                             bool has_vertices);

/// Whether six numbers make sense as TORO's information, or as iSAM's square root (positive
/// diagonal).
bool fits_toro(std::span<const double, 6> as_in_file);
bool fits_isam(std::span<const double, 6> as_in_file);
bool fits_g2o(std::span<const double, 6> as_in_file);

}  // namespace cairn::formats
