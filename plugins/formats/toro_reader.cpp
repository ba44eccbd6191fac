// SPDX-License-Identifier: BSD-3-Clause
// TORO text. In the plane information has the order I11 I12 I22 I33 I13 I23; in space (VERTEX3,
// EDGE3) it is the upper triangle row by row, of x y z roll pitch yaw. EQUIV a b makes two vertices
// one. With it two flavours that have landmarks, whose vertices are VERTEX2 too:
//     LANDMARK landmark pose range bearing 0  I11 I12 I22 …     SLAM++'s MATLAB toolbox; its third
//                                                               row is a dummy, and ODOMETRY lines
//                                                               are edges like any other
//     BR pose landmark bearing range  σ_bearing σ_range         GTSAM; a landmark needs no vertex

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "equivalences.hpp"
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
        read_factor(scanner, draft, kind, kToroOrder);
      });
    }
    tags_.add("VERTEX3", [kind = -1](Scanner& scanner, Draft& draft) mutable {
      if (kind < 0) kind = draft.variable_kind("VERTEX_SE3:QUAT");
      scanner.expect({1, 6, 0});
      const Id id = scanner.read_id();
      read_pose_of_angles(scanner, draft.add_variable(kind, id, scanner.line()));
      scanner.end_line();
    });
    tags_.add("EDGE3", [kind = -1](Scanner& scanner, Draft& draft) mutable {
      if (kind < 0) kind = draft.factor_kind("EDGE_SE3:QUAT", scanner.tag());
      read_edge_of_angles(scanner, draft, kind, kRows);
    });
    tags_.add("EQUIV", [this](Scanner&, Draft&) { read_equivalence(); });
    tags_.add("LANDMARK", [this](Scanner&, Draft&) { read_landmark(); });
    tags_.add("BR", [this](Scanner&, Draft&) { read_bearing_and_range(); });
    tags_.add("FIX", read_fix);
  }

  Graph read() {
    while (scanner_.next_line()) {
      if (const LineReader* reader = tags_.find(scanner_.tag())) {
        (*reader)(scanner_, draft_);
      } else {
        unknown_tag(scanner_, draft_, options_, [this] { return tags_.tags(); });
      }
    }
    if (!landmarks_.empty()) sort_out_landmarks();
    equivalences_.apply(draft_);
    return draft_.build();
  }

 private:
  struct Landmark {
    Id id;
    std::int64_t line;
  };

  void read_equivalence() {
    scanner_.expect({2, 0, 0});
    const Id a = scanner_.read_id(), b = scanner_.read_id();
    scanner_.end_line();
    equivalences_.add(a, b, scanner_.line());
  }

  std::int32_t landmark_kind(std::string_view tag) {
    std::int32_t& kind = tag == "BR" ? bearing_and_range_ : landmark_;
    if (kind < 0) kind = draft_.factor_kind("EDGE_BEARING_RANGE_SE2_XY", tag);
    return kind;
  }

  void read_landmark() {
    const std::int32_t kind = landmark_kind(scanner_.tag());
    scanner_.expect({2, 3, 6});
    const Draft::FactorSlots slots = draft_.add_factor(kind, scanner_.line());
    slots.ids[1] = scanner_.read_id();
    slots.ids[0] = scanner_.read_id();
    std::array<double, 3> seen;
    scanner_.read_numbers(seen);
    const double range = seen[0], bearing = seen[1];
    check_range(range);
    slots.measurement[0] = bearing;
    slots.measurement[1] = range;
    landmarks_.push_back({slots.ids[1], scanner_.line()});
    if (scanner_.more()) check_dummy_row(seen[2]);
    // The file's rows are range and bearing.
    static constexpr Arrangement kRangeFirst{
        [](std::span<const double> file, std::span<double> rows) {
          for (std::size_t k = 0; k < rows.size(); ++k) rows[k] = file[2 - k];
        }};
    read_information(scanner_, draft_, kRangeFirst);
  }

  void read_bearing_and_range() {
    const std::int32_t kind = landmark_kind(scanner_.tag());
    scanner_.expect({2, 2, 2, "standard deviations"});
    const Draft::FactorSlots slots = draft_.add_factor(kind, scanner_.line());
    for (Id& id : slots.ids) id = scanner_.read_id();
    scanner_.read_numbers(slots.measurement);
    check_range(slots.measurement[1]);
    landmarks_.push_back({slots.ids[1], scanner_.line()});
    if (!scanner_.more()) return draft_.take_unit_information(scanner_);
    std::array<double, 2> sigma;
    scanner_.read_numbers(sigma);
    scanner_.end_line();
    for (std::size_t k = 0; k < sigma.size(); ++k) {
      const double information = 1.0 / (sigma[k] * sigma[k]);
      if (!(sigma[k] > 0.0) || !std::isfinite(information)) {
        scanner_.fail(
            fmt::format("BR with the standard deviation {}; expected one above 0", sigma[k]));
      }
      slots.information[2 * k] = information;
    }
    draft_.finish_factor(scanner_);
  }

  void check_range(double range) const {
    if (range >= 0.0) return;
    scanner_.fail(
        fmt::format("{} with range {}; expected a distance of 0 or more", scanner_.tag(), range));
  }

  /// A bearing-range measurement has two rows. Of the third only its own diagonal entry may be
  /// there, wherever the writer put it: what couples it with the other two would change their
  /// information.
  void check_dummy_row(double third) const {
    std::array<std::string_view, 3> fields;
    scanner_.last_fields(fields);
    const auto others = std::ranges::count_if(fields, [](std::string_view field) {
      double number = 0.0;
      return parse_number(field, number) && number != 0.0;
    });
    if (third != 0.0 || others > 1) {
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
    const std::int32_t planar = draft_.variable_kind("VERTEX_SE2");
    std::int64_t angles = 0;
    for (Draft::Variable& variable : draft_.variables()) {
      if (variable.kind != planar || !find_landmark(variable.id)) continue;
      variable.kind = point;
      if (draft_.number(variable.numbers + 2) != 0.0) ++angles;
    }
    if (angles > 0) {
      draft_.report().notes.push_back(fmt::format(
          "{} landmarks have a vertex with an angle, which a point does not keep", angles));
    }
    for (const Draft::Factor& factor : draft_.factors()) check_poses(factor);
    if (!draft_.variables().empty()) add_landmarks_without_vertex(point, planar);
  }
  /// BR may see landmarks that have no vertex: they are where they are seen first.
  void add_landmarks_without_vertex(std::int32_t point, std::int32_t planar) {
    std::set<Id> there;
    for (const Draft::Variable& variable : draft_.variables()) there.insert(variable.id);
    std::int64_t made = 0;
    for (const Draft::Factor& factor : draft_.factors()) {
      if (factor.kind != bearing_and_range_) continue;
      const Draft::FactorSlots seen = draft_.slots(factor);
      const Id pose = seen.ids[0], landmark = seen.ids[1];
      if (there.contains(landmark)) continue;
      const auto from = std::ranges::find(draft_.variables(), pose, &Draft::Variable::id);
      if (from == draft_.variables().end() || from->kind != planar) continue;
      const std::array<double, 3> x{draft_.number(from->numbers), draft_.number(from->numbers + 1),
                                    draft_.number(from->numbers + 2)};
      const double angle = x[2] + seen.measurement[0], range = seen.measurement[1];
      const std::span<double> state = draft_.add_variable(point, landmark, factor.line);
      state[0] = x[0] + range * std::cos(angle);
      state[1] = x[1] + range * std::sin(angle);
      there.insert(landmark);
      ++made;
    }
    if (made > 0) {
      draft_.report().notes.push_back(
          fmt::format("{} without a vertex: placed where {} first seen",
                      made == 1 ? "1 landmark" : fmt::format("{} landmarks", made),
                      made == 1 ? "it is" : "they are"));
    }
  }
  void check_poses(const Draft::Factor& factor) {
    const std::span<const Id> ids = draft_.slots(factor).ids;
    const bool sees_landmark = factor.kind == landmark_ || factor.kind == bearing_and_range_;
    const std::size_t poses = sees_landmark ? 1 : ids.size();
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
  std::int32_t landmark_ = -1, bearing_and_range_ = -1;  ///< kinds of factors, made when seen
  Equivalences equivalences_;
  std::vector<Landmark> landmarks_;  ///< as often as they are seen; sorted by id in the end
};

}  // namespace

Graph read_toro(std::string_view text, const std::string& name, Registry& types,
                const ReadOptions& options, ReadReport& report) {
  return ToroReader(text, name, types, options, report).read();
}

}  // namespace cairn::formats
