// SPDX-License-Identifier: BSD-3-Clause
// iSAM text: no vertices, and in place of the information its upper-triangular square root U, row
// by row:
//     ODOMETRY|EDGE2 from to x y theta               + 6
//     EDGE3          from to x y z roll pitch yaw    + 21   R = Rz(yaw) Ry(pitch) Rx(roll)
//     LANDMARK       pose landmark x y               + 3    Cartesian, in the frame of the pose

#include <algorithm>
#include <iterator>
#include <limits>
#include <vector>

#include <fmt/core.h>

#include "information.hpp"
#include "readers.hpp"
#include "tag_lines.hpp"

namespace cairn::formats {
namespace {

class IsamReader {
 public:
  IsamReader(std::string_view text, const std::string& name, Registry& types,
             const ReadOptions& options, ReadReport& report)
      : options_(options), scanner_(text, name), draft_(name, "isam", types, options, report) {
    for (const char* tag : {"ODOMETRY", "EDGE2"}) {
      tags_.add(tag, [kind = -1](Scanner& scanner, Draft& draft) mutable {
        if (kind < 0) kind = draft.factor_kind("EDGE_SE2", scanner.tag());
        read_factor(scanner, draft, kind, kRoot);
      });
    }
    tags_.add("EDGE3", [kind = -1](Scanner& scanner, Draft& draft) mutable {
      if (kind < 0) kind = draft.factor_kind("EDGE_SE3:QUAT", scanner.tag());
      read_edge_of_angles(scanner, draft, kind, kRoot);
    });
    tags_.add("LANDMARK", [this](Scanner&, Draft&) { read_landmark(); });
    tags_.add("FIX", read_fix);
  }

  Graph read() {
    while (scanner_.next_line()) {
      if (const LineReader* reader = tags_.find(scanner_.tag())) {
        (*reader)(scanner_, draft_);
      } else {
        refuse_vertices();
        unknown_tag(scanner_, draft_, options_, [this] { return tags_.tags(); });
      }
    }
    if (landmark_kind_ >= 0) separate_landmarks();
    return draft_.build();
  }

 private:
  void read_landmark() {
    if (landmark_kind_ < 0) landmark_kind_ = draft_.factor_kind("EDGE_SE2_XY", scanner_.tag());
    read_factor(scanner_, draft_, landmark_kind_, kRoot);
  }

  void refuse_vertices() const {
    if (!scanner_.tag().starts_with("VERTEX")) return;
    scanner_.fail(fmt::format(
        "'{}', but iSAM text has no vertices; expected edges only (format {} reads such vertices)",
        shown(scanner_.tag()), scanner_.tag().starts_with("VERTEX_") ? "g2o" : "toro"));
  }

  /// Landmarks may have ids of their own that collide with those of poses. Then all landmarks are
  /// moved above the poses.
  void separate_landmarks() {
    std::vector<Id> poses, landmarks;
    for (const Draft::Factor& factor : draft_.factors()) {
      const std::span<const Id> ids = draft_.slots(factor).ids;
      poses.push_back(ids[0]);
      (factor.kind == landmark_kind_ ? landmarks : poses).push_back(ids[1]);
    }
    const auto make_set = [](std::vector<Id>& ids) {
      std::sort(ids.begin(), ids.end());
      ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
    };
    make_set(poses);
    make_set(landmarks);
    std::vector<Id> both;
    std::set_intersection(poses.begin(), poses.end(), landmarks.begin(), landmarks.end(),
                          std::back_inserter(both));
    if (both.empty()) return;
    renumber_landmarks(poses.back(), landmarks.back());
    draft_.report().notes.push_back(fmt::format(
        "{} landmark ids are also ids of poses: landmark {} became variable {}, and so on for all "
        "{} landmarks",
        both.size(), landmarks.front(), landmarks.front() + poses.back() + 1, landmarks.size()));
  }
  void renumber_landmarks(Id last_pose, Id last_landmark) {
    if (last_pose > std::numeric_limits<Id>::max() - 1 - last_landmark) {
      draft_.fail(
          draft_.factors().front().line,
          fmt::format("landmark ids collide with pose ids and are too large to be moved above them "
                      "(up to {} and {})",
                      last_landmark, last_pose));
    }
    for (const Draft::Factor& factor : draft_.factors()) {
      if (factor.kind == landmark_kind_) draft_.slots(factor).ids[1] += last_pose + 1;
    }
  }

  const ReadOptions& options_;
  Scanner scanner_;
  Draft draft_;
  TagTable tags_;
  std::int32_t landmark_kind_ = -1;
};

}  // namespace

Graph read_isam(std::string_view text, const std::string& name, Registry& types,
                const ReadOptions& options, ReadReport& report) {
  return IsamReader(text, name, types, options, report).read();
}

}  // namespace cairn::formats
