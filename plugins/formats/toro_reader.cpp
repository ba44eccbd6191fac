// SPDX-License-Identifier: BSD-3-Clause
// TORO text, planar: information in the order I11 I12 I22 I33 I13 I23. With it the flavour of the
// SLAM++ MATLAB toolbox: ODOMETRY lines are edges like any other, and
//     LANDMARK landmark pose range bearing 0  I11 I12 I22 …
// sees a landmark whose vertex is a VERTEX2 too; its third row is a dummy.

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "information.hpp"
#include "readers.hpp"
#include "tag_lines.hpp"

namespace cairn::formats {
namespace {

class ToroReader {
 public:
  ToroReader(std::string_view text, const std::string& name, Registry& types,
             const ReadOptions& options, ReadReport& report)
      : options_(options), scanner_(text, name), draft_(name, "toro", types, options, report) {
    for (const char* tag : {"VERTEX2", "VERTEX"}) {
      tags_.add(tag, [kind = -1](Scanner& scanner, Draft& draft) mutable {
        if (kind < 0) kind = draft.variable_kind("VERTEX_SE2");
        read_variable(scanner, draft, kind);
      });
    }
    for (const char* tag : {"EDGE2", "EDGE", "ODOMETRY"}) {
      tags_.add(tag, [kind = -1](Scanner& scanner, Draft& draft) mutable {
        if (kind < 0) kind = draft.factor_kind("EDGE_SE2", scanner.tag());
        read_edge(scanner, draft, kind);
      });
    }
    tags_.add("LANDMARK", [this](Scanner&, Draft&) { read_landmark(); });
    tags_.add("FIX", read_fix);
  }

  Graph read() {
    while (scanner_.next_line()) {
      if (const LineReader* reader = tags_.find(scanner_.tag())) {
        (*reader)(scanner_, draft_);
      } else {
        unknown_tag(scanner_, draft_, options_, tags_.tags());
      }
    }
    if (!landmarks_.empty()) sort_out_landmarks();
    return draft_.build();
  }

 private:
  struct Landmark {
    Id id;
    std::int64_t line;
  };

  static void read_edge(Scanner& scanner, Draft& draft, std::int32_t kind) {
    const Draft::FactorSlots slots = read_factor(scanner, draft, kind);
    std::array<double, 6> as_in_file;
    std::copy(slots.information.begin(), slots.information.end(), as_in_file.begin());
    from_toro_order(slots.information.first<6>());
    draft.finish_factor(as_in_file);
  }

  void read_landmark() {
    if (landmark_kind_ < 0) {
      landmark_kind_ = draft_.factor_kind("EDGE_BEARING_RANGE_SE2_XY", scanner_.tag());
    }
    scanner_.expect({2, 3, 6});
    const Draft::FactorSlots slots = draft_.add_factor(landmark_kind_, scanner_.line());
    slots.ids[1] = scanner_.read_id();
    slots.ids[0] = scanner_.read_id();
    std::array<double, 3> seen;
    scanner_.read_numbers(seen);
    std::array<double, 6> information;
    scanner_.read_numbers(information);
    scanner_.end_line();
    check_dummy_row(seen[2], information);
    const double range = seen[0], bearing = seen[1];
    if (range < 0.0) {
      scanner_.fail(fmt::format("LANDMARK with range {}; expected a distance of 0 or more", range));
    }
    slots.measurement[0] = bearing;
    slots.measurement[1] = range;
    // The file's rows are range and bearing.
    slots.information[0] = information[2];
    slots.information[1] = information[1];
    slots.information[2] = information[0];
    draft_.finish_factor();
    landmarks_.push_back({slots.ids[1], scanner_.line()});
  }

  /// A bearing-range measurement has two rows. Of the third only its own diagonal entry may be
  /// there, wherever the writer put it: what couples it with the other two would change their
  /// information.
  void check_dummy_row(double third, std::span<const double, 6> information) const {
    const auto others = information.subspan<3>();
    if (third != 0.0 || std::ranges::count_if(others, [](double v) { return v != 0.0; }) > 1) {
      scanner_.fail(
          "LANDMARK with a third row that is more than a dummy; expected range, bearing and 0, "
          "then I11 I12 "
          "I22 and at most one more number that is not 0");
    }
  }

  /// Turns the vertices of landmarks into points, and sees to it that nothing is both pose and
  /// landmark.
  void sort_out_landmarks() {
    std::stable_sort(landmarks_.begin(), landmarks_.end(),
                     [](const Landmark& a, const Landmark& b) { return a.id < b.id; });
    const std::int32_t point = draft_.variable_kind("VERTEX_XY");
    std::int64_t angles = 0;
    for (Draft::Variable& variable : draft_.variables()) {
      if (!find_landmark(variable.id)) continue;
      variable.kind = point;
      if (draft_.number(variable.numbers + 2) != 0.0) ++angles;
    }
    if (angles > 0) {
      draft_.report().notes.push_back(fmt::format(
          "{} landmarks have a vertex with an angle, which a point does not keep", angles));
    }
    for (const Draft::Factor& factor : draft_.factors()) check_poses(factor);
  }
  void check_poses(const Draft::Factor& factor) {
    const std::span<const Id> ids = draft_.slots(factor).ids;
    const std::size_t poses = factor.kind == landmark_kind_ ? 1 : ids.size();
    for (std::size_t k = 0; k < poses; ++k) {
      if (const Landmark* landmark = find_landmark(ids[k])) {
        draft_.fail(
            factor.line,
            fmt::format("{} uses {} as a pose, but it is a landmark by line {}; expected ids of "
                        "poses",
                        draft_.factor(factor.kind).name, ids[k], landmark->line));
      }
    }
  }
  const Landmark* find_landmark(Id id) const {
    const auto it = std::lower_bound(landmarks_.begin(), landmarks_.end(), id,
                                     [](const Landmark& l, Id wanted) { return l.id < wanted; });
    return it != landmarks_.end() && it->id == id ? &*it : nullptr;
  }

  const ReadOptions& options_;
  Scanner scanner_;
  Draft draft_;
  TagTable tags_;
  std::int32_t landmark_kind_ = -1;
  std::vector<Landmark> landmarks_;  ///< as often as they are seen; sorted by id in the end
};

}  // namespace

Graph read_toro(std::string_view text, const std::string& name, Registry& types,
                const ReadOptions& options, ReadReport& report) {
  return ToroReader(text, name, types, options, report).read();
}

}  // namespace cairn::formats
