// SPDX-License-Identifier: BSD-3-Clause
// Trajectories without factors: TUM (stamp x y z qx qy qz qw), EuRoC (stamp x y z qw qx qy qz …),
// KITTI (rows of [R t]) and plain planar tables (x y theta, or id x y theta). Where rows have no
// id, the id is the row number from 0.

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "draft.hpp"
#include "readers.hpp"
#include "row_text.hpp"
#include "scanner.hpp"
#include "stamped_rows.hpp"

namespace cairn::formats {
namespace {

/// How far a 3×3 block may be from a rotation by rounding in a file with few digits.
constexpr double kRotationTolerance = 1e-3;

/// Where w of the quaternion is, counted from 0.
constexpr int kTumW = 7, kEurocW = 4;

/// Refuses a file whose names of columns have w of the quaternion where the format has it not.
void check_order(const RowText& rows, const Scanner& scanner, int expected) {
  const int column = rows.column_of_w().value_or(expected);
  if (column == expected) return;
  scanner.fail(fmt::format(
      "the names of the columns have w of the quaternion in column {}; expected column {} (format "
      "tum has it in column {}, euroc in column {})",
      column + 1, expected + 1, kTumW + 1, kEurocW + 1));
}

bool is_rotation(const Eigen::Matrix3d& R) {
  return (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <
             kRotationTolerance &&
         R.determinant() > 0.0;
}

}  // namespace

Graph read_tum(std::string_view text, const std::string& name, Registry& types,
               const ReadOptions& options, ReadReport& report) {
  const RowText rows(text);
  Scanner scanner(rows.text(), name);
  Draft draft(name, "tum", types, options, report);
  const std::int32_t pose = draft.variable_kind("VERTEX_SE3:QUAT");
  StampedRows stamps;
  while (scanner.next_line()) {
    scanner.expect_row({0, 8, 0}, "a TUM row");
    check_order(rows, scanner, kTumW);
    stamps.add(scanner.tag(), scanner.read_number());
    scanner.read_numbers(draft.add_variable(pose, 0, scanner.line()));
    scanner.end_line();
  }
  stamps.finish(draft, StampedRows::Whole::id, rows.stamp_unit());
  return draft.build();
}

Graph read_euroc(std::string_view text, const std::string& name, Registry& types,
                 const ReadOptions& options, ReadReport& report) {
  const RowText rows(text);
  Scanner scanner(rows.text(), name);
  Draft draft(name, "euroc", types, options, report);
  const std::int32_t kind = draft.variable_kind("VERTEX_SE3:QUAT");
  StampedRows stamps;
  int columns = 0;  // the first row decides
  std::vector<double> others;
  while (scanner.next_line()) {
    if (columns == 0) {
      scanner.expect_row({}, "");
      columns = std::max(scanner.count_fields(), 8);
      others.resize(static_cast<std::size_t>(columns - 8));
    }
    scanner.expect_row({0, columns, 0}, "an EuRoC row");
    check_order(rows, scanner, kEurocW);
    stamps.add(scanner.tag(), scanner.read_number());
    const std::span<double> pose = draft.add_variable(kind, 0, scanner.line());
    scanner.read_numbers(pose.first(3));
    pose[6] = scanner.read_number();
    scanner.read_numbers(pose.subspan(3, 3));
    scanner.read_numbers(others);
    scanner.end_line();
  }
  if (!rows.column_of_w())
    report.notes.push_back("the fifth column is taken for w of the quaternion, as EuRoC has it");
  if (!others.empty())
    report.notes.push_back(fmt::format(
        "the last {} columns, such as velocities and biases, are left out", others.size()));
  stamps.finish(draft, StampedRows::Whole::nanoseconds, rows.stamp_unit());
  return draft.build();
}

Graph read_kitti(std::string_view text, const std::string& name, Registry& types,
                 const ReadOptions& options, ReadReport& report) {
  const RowText rows(text);
  Scanner scanner(rows.text(), name);
  Draft draft(name, "kitti", types, options, report);
  const std::int32_t kind = draft.variable_kind("VERTEX_SE3:QUAT");
  const Placement* placement = draft.variable(kind).type->placement();
  Id row = 0;
  while (scanner.next_line()) {
    scanner.expect_row({0, 12, 0}, "a KITTI row");
    Eigen::Matrix<double, 3, 4, Eigen::RowMajor> numbers;
    scanner.read_numbers({numbers.data(), 12});
    scanner.end_line();
    const Eigen::Matrix3d R = numbers.leftCols<3>();
    const Eigen::Vector3d t = numbers.col(3);
    if (!is_rotation(R)) {
      scanner.fail(
          "the first three columns of the KITTI row are not a rotation; expected an orthonormal "
          "3x3 "
          "matrix of determinant 1");
    }
    // The quaternion is normalized when the graph takes it, which mends the rounding of the file.
    placement->join(R.data(), t.data(), draft.add_variable(kind, row++, scanner.line()).data());
  }
  report.row_ids = true;
  return draft.build();
}

Graph read_table(std::string_view text, const std::string& name, Registry& types,
                 const ReadOptions& options, ReadReport& report) {
  const RowText rows(text);
  Scanner scanner(rows.text(), name);
  Draft draft(name, "table", types, options, report);
  const std::int32_t pose = draft.variable_kind("VERTEX_SE2");
  int ids = -1;  // a row: 1 if the table has them, 0 if not; the first row decides
  Id row = 0;
  while (scanner.next_line()) {
    if (ids < 0) {
      scanner.expect_row({}, "");
      ids = scanner.count_fields() == 4 ? 1 : 0;
    }
    scanner.expect_row({ids, 3, 0}, ids == 1 ? "a row id x y theta" : "a row x y theta");
    const Id id = ids == 1 ? scanner.read_id() : row++;
    scanner.read_numbers(draft.add_variable(pose, id, scanner.line()));
    scanner.end_line();
  }
  report.row_ids = ids == 0;
  return draft.build();
}

}  // namespace cairn::formats
