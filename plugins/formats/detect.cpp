// SPDX-License-Identifier: BSD-3-Clause
#include "detect.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <numeric>

#include "cairn/runtime/error.hpp"
#include "information.hpp"
#include "row_text.hpp"
#include "scanner.hpp"

namespace cairn::formats {
namespace {

constexpr int kLines = 600;      // that hold something: enough to see past a bad one
constexpr int kLongestRow = 18;  // fields: all rows that are longer than EuRoC's count as one kind
constexpr std::size_t kBytes = std::size_t{1} << 18;  // that so many rows of a trajectory fit in

struct Votes {
  int lines = 0;
  int g2o = 0, toro = 0, isam = 0, pyfg = 0;
  int toro_or_isam = 0;                     // by tag either, and the numbers don't tell
  int tagged = 0;                           // any other word
  std::array<int, kLongestRow + 1> rows{};  // of numbers, by their count
  int nanoseconds = 0;                      // of rows, those that begin with 19 digits
};

/// Counts the lines that are as the first line of a BAL file promises: cameras, points and
/// observations, then a line of four fields for each observation, and one number a line.
class BalVotes {
 public:
  /// `fields`: of this line, all.
  void vote(Scanner& scanner, int fields) {
    if (++line_ == 1) {
      is_header_ = fields == 3 && read_header(scanner);
    } else if (is_header_) {
      fitting_ += fields == (line_ - 1 <= observations_ ? 4 : 1);
    }
  }
  /// How many lines fit. A first line with others that do not proves nothing; alone it is a file
  /// that was cut.
  int lines() const { return fitting_ > 0 || (is_header_ && line_ == 1) ? 1 + fitting_ : 0; }

 private:
  bool read_header(Scanner& scanner) {
    scanner.expect_row({}, "");
    try {
      const std::int64_t cameras = scanner.read_count(), points = scanner.read_count();
      observations_ = scanner.read_count();
      return cameras > 0 && points > 0 && observations_ > 0;
    } catch (const Error&) {
      return false;
    }
  }

  std::int64_t observations_ = 0, line_ = 0;
  int fitting_ = 0;  // lines after the first
  bool is_header_ = false;
};

bool is_word(std::string_view field) {
  return std::isalpha(static_cast<unsigned char>(field.front())) != 0 || field.front() == '_';
}
bool is_number_like(std::string_view field) {
  return field.find_first_not_of("0123456789+-.eEinfaNIAF") == std::string_view::npos;
}

/// A time since 1970 of this age, 19 digits.
bool is_nanoseconds(std::string_view field) {
  return field.size() == 19 && field.find_first_not_of("0123456789") == std::string_view::npos;
}

/// An edge that is TORO's or iSAM's: two ids, `measured` numbers, and the information in TORO's
/// order or its root in iSAM's, which tell, or don't.
template <std::size_t Numbers>
void vote_on_edge(Scanner& scanner, int measured, Votes& votes) {
  scanner.expect({2, measured, static_cast<int>(Numbers)});
  std::array<double, Numbers> last;
  try {
    scanner.read_id();
    scanner.read_id();
    for (int k = 0; k < measured; ++k) scanner.read_number();
    scanner.read_numbers(last);
  } catch (const Error&) {  // a bad line, or without information: its reader will say so
    ++votes.toro_or_isam;
    return;
  }
  bool toro = false, isam = true;
  if constexpr (Numbers == 6) {
    toro = fits_toro(last);
    isam = fits_isam(last);
  } else {
    toro = is_positive_definite(6, last);
    for (int row = 0; row < 6; ++row) isam = isam && last[triangle_index(6, row, row)] > 0.0;
  }
  ++(toro == isam ? votes.toro_or_isam : toro ? votes.toro : votes.isam);
}

/// Whether one of the first fields after the tag is a name, which PyFactorGraph has for ids.
bool names_variable(const Scanner& scanner) {
  std::array<std::string_view, 3> first;  // the tag before them: nothing was expected yet
  scanner.first_fields(first);
  return std::any_of(first.begin() + 1, first.end(), [](std::string_view field) {
    return field.size() > 1 && std::isalpha(static_cast<unsigned char>(field[0])) != 0 &&
           std::isdigit(static_cast<unsigned char>(field[1])) != 0;
  });
}

void vote_on_landmark(Scanner& scanner, Votes& votes) {
  scanner.expect({});
  const int fields = scanner.count_fields();
  ++(fields == 7 ? votes.isam : fields == 11 ? votes.toro : votes.toro_or_isam);
}

/// `fields`: of a line that begins with no word.
void vote(Scanner& scanner, int fields, Votes& votes) {
  const std::string_view tag = scanner.tag();
  ++votes.lines;
  if (!is_word(tag)) {
    if (!is_number_like(tag)) return;
    ++votes.rows[std::min(fields, kLongestRow)];
    votes.nanoseconds += is_nanoseconds(tag);
  } else if (tag == "VERTEX2" || tag == "VERTEX" || tag == "VERTEX3" || tag == "EDGE" ||
             tag == "EQUIV" || tag == "BR") {
    ++votes.toro;
  } else if (tag == "EDGE2" || tag == "ODOMETRY") {
    vote_on_edge<6>(scanner, 3, votes);
  } else if (tag == "EDGE3") {
    vote_on_edge<21>(scanner, 6, votes);
  } else if (tag == "LANDMARK") {
    vote_on_landmark(scanner, votes);
  } else if (tag.starts_with("VERTEX_") || tag.starts_with("EDGE_") || tag.starts_with("PARAMS_")) {
    ++(names_variable(scanner) ? votes.pyfg : votes.g2o);
  } else {
    ++votes.tagged;  // FIX among them, which every format with tags takes
  }
}

/// Edges whose numbers don't tell go with those that do; if none does, iSAM's lack of vertices
/// decides.
void settle_undecided(Votes& votes) {
  const bool to_toro = votes.toro > votes.isam;
  (to_toro ? votes.toro : votes.isam) += votes.toro_or_isam;
}

}  // namespace

namespace {

/// Lines of trajectories with stamps, by the place of w in the quaternion.
struct Stamped {
  int tum = 0, euroc = 0;
};

Stamped stamped_rows(const Votes& votes, const RowText& rows) {
  const int longer = std::accumulate(votes.rows.begin() + 9, votes.rows.end(), 0);
  if (rows.column_of_w() == 4) return {0, votes.rows[8] + longer};
  const bool nanoseconds = votes.nanoseconds > 0;
  if (rows.column_of_w() || !nanoseconds || !rows.has_commas())
    return {votes.rows[8], nanoseconds ? votes.rows[17] : 0};
  // Positions alone, too, which the reader refuses by name.
  return {0, votes.rows[4] + votes.rows[8] + votes.rows[17]};
}

}  // namespace

Likelihood look_at(std::string_view text) {
  Votes votes;
  const RowText rows(text.substr(0, kBytes));
  Scanner scanner(rows.is_changed() ? rows.text() : text, "");
  BalVotes bal;
  while (votes.lines < kLines && scanner.next_line()) {
    const int fields = is_word(scanner.tag()) ? 0 : scanner.count_fields();
    bal.vote(scanner, fields);
    vote(scanner, fields, votes);
  }
  if (votes.lines == 0 || text.substr(0, 4096).find('\0') != std::string_view::npos) return {};
  settle_undecided(votes);

  // Certain only if every line agrees; a share of them, at least 2, otherwise.
  const auto score = [&votes](int lines) {
    return lines == 0 ? 0 : 2 + static_cast<int>(98LL * lines / votes.lines);
  };
  Likelihood likelihood;
  likelihood.g2o = score(votes.g2o);
  likelihood.toro = score(votes.toro);
  likelihood.isam = score(votes.isam);
  likelihood.bal = score(bal.lines());
  likelihood.pyfg = score(votes.pyfg);
  const Stamped stamped = stamped_rows(votes, rows);
  likelihood.tum = score(stamped.tum);
  likelihood.euroc = score(stamped.euroc);
  likelihood.kitti = rows.column_of_w() ? 0 : score(votes.rows[12]);
  // A single row of counts is no table: it may be the first line of anything.
  const bool counts_alone = votes.lines == 1 && text.find_first_of(".eE") == std::string_view::npos;
  likelihood.table =
      counts_alone || votes.nanoseconds > 0 ? 0 : score(std::max(votes.rows[3], votes.rows[4]));
  // Rows of so many numbers are hardly else, and TUM's reader says how many it expects.
  const int rows_of_tum = votes.rows[7] + votes.rows[9] + votes.rows[10] + votes.rows[11];
  if (rows_of_tum > 0 && likelihood.tum == 0 && likelihood.bal == 0) likelihood.tum = 1;
  // Words that no format knows may be tags of a third party's types, which g2o's reader asks the
  // registry for; failing that, it says which line it does not understand.
  if (votes.tagged > 0 && likelihood.g2o == 0) likelihood.g2o = 1;
  return likelihood;
}

}  // namespace cairn::formats
