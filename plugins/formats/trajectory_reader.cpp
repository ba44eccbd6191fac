// SPDX-License-Identifier: BSD-3-Clause
// Trajectories without factors: TUM (stamp x y z qx qy qz qw), KITTI (rows of [R t]) and plain
// planar tables (x y theta, or id x y theta). Where rows have no id, the id is the row number from
// 0.

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "draft.hpp"
#include "readers.hpp"
#include "scanner.hpp"

namespace cairn::formats {
namespace {

/// A stamp that can be an id: an integer from 0 that a double holds exactly.
bool is_whole(double stamp) {
  return stamp >= 0.0 && stamp <= 9007199254740992.0 && stamp == std::floor(stamp);
}

/// How far a 3×3 block may be from a rotation by rounding in a file with few digits.
constexpr double kRotationTolerance = 1e-3;

bool is_rotation(const Eigen::Matrix3d& R) {
  return (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <
             kRotationTolerance &&
         R.determinant() > 0.0;
}

/// Ids from stamps: the stamps themselves if all are integers, else row numbers. Either way
/// the ids rise with the stamps.
void set_ids_from_stamps(Draft& draft, const std::vector<double>& stamps) {
  bool whole = true;
  for (const double stamp : stamps) whole = whole && is_whole(stamp);
  std::vector<Draft::Variable>& rows = draft.variables();
  for (std::size_t row = 0; row < rows.size(); ++row) {
    if (!whole && row > 0 && !(stamps[row] > stamps[row - 1])) {
      draft.fail(rows[row].line, fmt::format("stamp {} after {}; expected rising stamps",
                                             stamps[row], stamps[row - 1]));
    }
    rows[row].id = whole ? static_cast<Id>(stamps[row]) : static_cast<Id>(row);
  }
  if (!whole) {
    draft.report().notes.push_back("the stamps are not integers: ids are the row numbers from 0");
  }
}

}  // namespace

Graph read_tum(std::string_view text, const std::string& name, Registry& types,
               const ReadOptions& options, ReadReport& report) {
  Scanner scanner(text, name);
  Draft draft(name, "tum", types, options, report);
  const std::int32_t pose = draft.variable_kind("VERTEX_SE3:QUAT");
  std::vector<double> stamps;
  while (scanner.next_line()) {
    scanner.expect_row({0, 8, 0}, "a TUM row");
    stamps.push_back(scanner.read_number());
    scanner.read_numbers(draft.add_variable(pose, 0, scanner.line()));
    scanner.end_line();
  }
  set_ids_from_stamps(draft, stamps);
  std::sort(stamps.begin(), stamps.end());
  report.stamps = std::move(stamps);
  return draft.build();
}

Graph read_kitti(std::string_view text, const std::string& name, Registry& types,
                 const ReadOptions& options, ReadReport& report) {
  Scanner scanner(text, name);
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
  return draft.build();
}

Graph read_table(std::string_view text, const std::string& name, Registry& types,
                 const ReadOptions& options, ReadReport& report) {
  Scanner scanner(text, name);
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
  return draft.build();
}

}  // namespace cairn::formats
