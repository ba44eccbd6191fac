// SPDX-License-Identifier: BSD-3-Clause
// BAL text ("Bundle adjustment in the large", Agarwal, Snavely, Seitz, Szeliski, 2010): a header
// with the numbers of cameras, points and observations; a line "camera point u v" for each
// observation; then, one number a line, nine of each camera and three of each point. There are no
// ids: cameras become 0, 1, 2 …, and the points follow.

#include <algorithm>
#include <array>

#include <fmt/core.h>

#include "bal_camera.hpp"
#include "draft.hpp"
#include "readers.hpp"
#include "scanner.hpp"

namespace cairn::formats {
namespace {

class BalReader {
 public:
  BalReader(std::string_view text, const std::string& name, Registry& types,
            const ReadOptions& options, ReadReport& report)
      : scanner_(text, name), draft_(name, "bal", types, options, report) {}

  Graph read() {
    if (!scanner_.next_line()) return draft_.build();  // which says that there is nothing
    read_header();
    for (Id k = 0; k < observations_; ++k) read_observation(k);
    for (Id k = 0; k < cameras_; ++k) read_camera(k);
    for (Id k = 0; k < points_; ++k) read_point(k);
    if (scanner_.next_line()) {
      scanner_.fail(fmt::format(
          "'{}' after the last point; expected the end of the file, by the header's {} cameras, {} "
          "points and {} observations",
          shown(scanner_.tag()), cameras_, points_, observations_));
    }
    Graph graph = draft_.build();
    note_points_behind(graph);
    return graph;
  }

 private:
  void read_header() {
    scanner_.expect_row({3, 0, 0}, "the header (cameras points observations)");
    cameras_ = scanner_.read_count();
    points_ = scanner_.read_count();
    observations_ = scanner_.read_count();
    scanner_.end_line();
    camera_kind_ = draft_.variable_kind("VERTEX_CAMERA_BAL");
    point_kind_ = draft_.variable_kind("VERTEX_TRACKXYZ");
    factor_kind_ = draft_.factor_kind("EDGE_PROJECT_BAL");
  }

  /// Moves to the next line, which holds part of `what` number `k`.
  void need_line(const char* what, Id k, Id count) {
    if (scanner_.next_line()) return;
    draft_.fail(
        scanner_.line(),
        fmt::format("the file ends here, in {} {} of {}; expected what the header declares: "
                    "{} cameras, {} points and {} observations",
                    what, k + 1, count, cameras_, points_, observations_));
  }

  void read_observation(Id k) {
    need_line("observation", k, observations_);
    scanner_.expect_row({2, 2, 0}, "an observation (camera point u v)");
    const Id camera = read_index("camera", cameras_);
    const Id point = read_index("point", points_);
    const Draft::FactorSlots slots = draft_.add_factor(factor_kind_, scanner_.line());
    slots.ids[0] = camera;
    slots.ids[1] = cameras_ + point;
    scanner_.read_numbers(slots.measurement);
    scanner_.end_line();
    slots.information[0] = slots.information[2] = 1.0;
  }
  Id read_index(const char* what, Id count) {
    const Id index = scanner_.read_id();
    if (index >= count) {
      scanner_.fail(fmt::format("an observation of {} {}; expected {}, by the header", what, index,
                                count > 0 ? fmt::format("one of 0 to {}", count - 1) : "none"));
    }
    return index;
  }

  double read_parameter(const char* owner, const char* row, Id k, Id count) {
    need_line(owner, k, count);
    scanner_.expect_row({0, 1, 0}, row);
    const double number = scanner_.read_number();
    scanner_.end_line();
    return number;
  }
  void read_camera(Id k) {
    BalCamera camera;
    std::int64_t line = 0;
    for (double& number : camera) {
      number = read_parameter("camera", "a line of a camera", k, cameras_);
      if (line == 0) line = scanner_.line();
    }
    to_state(camera, draft_.add_variable(camera_kind_, k, line));
  }
  void read_point(Id k) {
    std::array<double, 3> point;
    std::int64_t line = 0;
    for (double& number : point) {
      number = read_parameter("point", "a line of a point", k, points_);
      if (line == 0) line = scanner_.line();
    }
    std::copy(point.begin(), point.end(),
              draft_.add_variable(point_kind_, cameras_ + k, line).begin());
  }

  /// They have an image all the same, mirrored, so nobody would notice.
  void note_points_behind(const Graph& graph) {
    std::int64_t behind = 0;
    for (int f = 0; f < graph.factor_count(); ++f) {
      const auto ends = graph.factor_variables(f);
      behind += is_behind(graph.state(ends[0]), graph.state(ends[1]));
    }
    if (behind == 0) return;
    draft_.report().notes.push_back(
        fmt::format("{} of {} observations {} of points behind their camera, as the file has them",
                    behind, observations_, behind == 1 ? "is" : "are"));
  }

  Scanner scanner_;
  Draft draft_;
  Id cameras_ = 0, points_ = 0, observations_ = 0;
  std::int32_t camera_kind_ = 0, point_kind_ = 0, factor_kind_ = 0;
};

}  // namespace

Graph read_bal(std::string_view text, const std::string& name, Registry& types,
               const ReadOptions& options, ReadReport& report) {
  return BalReader(text, name, types, options, report).read();
}

}  // namespace cairn::formats
