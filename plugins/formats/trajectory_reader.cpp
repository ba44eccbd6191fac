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

/// Rows of a stamp, a position and a quaternion.
struct StampedFormat {
  std::string_view name, row;
  int w;  ///< column of the quaternion's w: the last of eight, or the fifth of eight and more
  StampedRows::Whole whole;
};

/// x y z and the quaternion, which ends with w in a state.
void read_pose(Scanner& scanner, bool w_last, std::span<double> pose) {
  if (w_last) return scanner.read_numbers(pose);
  scanner.read_numbers(pose.first(3));
  pose[6] = scanner.read_number();
  scanner.read_numbers(pose.subspan(3, 3));
}

Graph read_stamped(const StampedFormat& format, std::string_view text, const std::string& name,
                   Registry& types, const ReadOptions& options, ReadReport& report) {
  constexpr int kColumns = 8;
  const bool w_last = format.w == kColumns - 1;
  const RowText rows(text);
  Scanner scanner(rows.text(), name);
  Draft draft(name, std::string(format.name), types, options, report);
  const std::int32_t pose = draft.variable_kind("VERTEX_SE3:QUAT");
  StampedRows stamps;
  int columns = w_last ? kColumns : 0;  // 0: the first row decides
  std::vector<double> others;
  while (scanner.next_line()) {
    if (columns == 0) {
      scanner.expect_row({}, "");
      columns = std::max(scanner.count_fields(), kColumns);
      others.resize(static_cast<std::size_t>(columns - kColumns));
    }
    scanner.expect_row({0, columns, 0}, format.row);
    check_order(rows, scanner, format.w);
    stamps.add(scanner.tag(), scanner.read_number());
    read_pose(scanner, w_last, draft.add_variable(pose, 0, scanner.line()));
    scanner.read_numbers(others);
    scanner.end_line();
  }
  if (!w_last && !rows.column_of_w())
    report.notes.push_back("the fifth column is taken for w of the quaternion, as EuRoC has it");
  if (!others.empty())
    report.notes.push_back(fmt::format(
        "the last {} columns, such as velocities and biases, are left out", others.size()));
  stamps.finish(draft, format.whole, rows.stamp_unit());
  return draft.build();
}

}  // namespace

Graph read_tum(std::string_view text, const std::string& name, Registry& types,
               const ReadOptions& options, ReadReport& report) {
  return read_stamped({"tum", "a TUM row", kTumW, StampedRows::Whole::id}, text, name, types,
                      options, report);
}

Graph read_euroc(std::string_view text, const std::string& name, Registry& types,
                 const ReadOptions& options, ReadReport& report) {
  return read_stamped({"euroc", "an EuRoC row", kEurocW, StampedRows::Whole::nanoseconds}, text,
                      name, types, options, report);
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

constexpr const char* kTimes =
    "; expected rows x y theta or id x y theta, or with times those of TUM: time x y z qx qy qz qw";

/// Rows "time x y" have as many columns as x y theta.
void check_no_times(Draft& draft) {
  constexpr double kSince1970 = 1e9;          // [s], 2001; no robot is so many metres away
  constexpr double kTurns = 12.566370614359;  // two of them [rad]
  const std::vector<Draft::Variable>& rows = draft.variables();
  bool rising = rows.size() > 1, turned = false;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    rising =
        rising && (k == 0 || draft.number(rows[k].numbers) > draft.number(rows[k - 1].numbers));
    turned = turned || std::abs(draft.number(rows[k].numbers + 2)) > kTurns;
  }
  if (!rising) return;
  const double first = draft.number(rows.front().numbers);
  if (first >= kSince1970) {
    draft.fail(rows.front().line,
               fmt::format("the first of three columns rises from {} on, as times since 1970 do{}",
                           first, kTimes));
  }
  if (turned) {
    draft.report().notes.push_back(
        "rows are taken for x y theta, though the first column rises as times do, and the third "
        "goes beyond two turns");
  }
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
    if (ids == 1 && scanner.tag().find('.') != std::string_view::npos) {
      scanner.fail(fmt::format("a row of four numbers begins with {}, which is no id{}",
                               shown(scanner.tag()), kTimes));
    }
    scanner.expect_row({ids, 3, 0}, ids == 1 ? "a row id x y theta" : "a row x y theta");
    const Id id = ids == 1 ? scanner.read_id() : row++;
    scanner.read_numbers(draft.add_variable(pose, id, scanner.line()));
    scanner.end_line();
  }
  if (ids == 0) check_no_times(draft);
  report.row_ids = ids == 0;
  return draft.build();
}

}  // namespace cairn::formats
