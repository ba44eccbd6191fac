// SPDX-License-Identifier: BSD-3-Clause
// iSAM text: no vertices, and in place of the information its upper-triangular square root U, row
// by row:
//     ODOMETRY|EDGE2 from to x y theta               + 6
//     EDGE3          from to x y z roll pitch yaw    + 21   R = Rz(yaw) Ry(pitch) Rx(roll)
//     LANDMARK       pose landmark x y               + 3    Cartesian, in the frame of the pose

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <vector>

#include <fmt/core.h>

#include "information.hpp"
#include "readers.hpp"
#include "tag_lines.hpp"

namespace cairn::formats {
namespace {

/// qx qy qz qw of Rz(yaw) Ry(pitch) Rx(roll).
std::array<double, 4> quaternion_from(double roll, double pitch, double yaw) {
  const double cr = std::cos(roll / 2), sr = std::sin(roll / 2);
  const double cp = std::cos(pitch / 2), sp = std::sin(pitch / 2);
  const double cy = std::cos(yaw / 2), sy = std::sin(yaw / 2);
  return {sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy,
          cr * cp * cy + sr * sp * sy};
}

class IsamReader {
 public:
  IsamReader(std::string_view text, const std::string& name, Registry& types,
             const ReadOptions& options, ReadReport& report)
      : options_(options), scanner_(text, name), draft_(name, "isam", types, options, report) {
    for (const char* tag : {"ODOMETRY", "EDGE2"}) {
      tags_.add(tag, [kind = -1](Scanner& scanner, Draft& draft) mutable {
        if (kind < 0) kind = draft.factor_kind("EDGE_SE2", scanner.tag());
        read_planar(scanner, draft, kind);
      });
    }
    tags_.add("EDGE3", [kind = -1](Scanner& scanner, Draft& draft) mutable {
      if (kind < 0) kind = draft.factor_kind("EDGE_SE3:QUAT", scanner.tag());
      read_spatial(scanner, draft, kind);
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
        unknown_tag(scanner_, draft_, options_, tags_.tags());
      }
    }
    if (landmark_kind_ >= 0) separate_landmarks();
    return draft_.build();
  }

 private:
  static void read_planar(Scanner& scanner, Draft& draft, std::int32_t kind) {
    const Draft::FactorSlots slots = read_factor(scanner, draft, kind);
    std::array<double, 6> as_in_file;
    std::copy(slots.information.begin(), slots.information.end(), as_in_file.begin());
    square_from_root(3, slots.information);
    draft.finish_factor(as_in_file);
  }

  static void read_spatial(Scanner& scanner, Draft& draft, std::int32_t kind) {
    scanner.expect({2, 6, 21});
    const Draft::FactorSlots slots = draft.add_factor(kind, scanner.line());
    for (Id& id : slots.ids) id = scanner.read_id();
    scanner.read_numbers(slots.measurement.first<3>());
    std::array<double, 3> angles;
    scanner.read_numbers(angles);
    const std::array<double, 4> q = quaternion_from(angles[0], angles[1], angles[2]);
    std::copy(q.begin(), q.end(), slots.measurement.begin() + 3);
    scanner.read_numbers(slots.information);
    scanner.end_line();
    square_from_root(6, slots.information);
    draft.finish_factor();
  }

  void read_landmark() {
    if (landmark_kind_ < 0) landmark_kind_ = draft_.factor_kind("EDGE_SE2_XY", scanner_.tag());
    const Draft::FactorSlots slots = read_factor(scanner_, draft_, landmark_kind_);
    square_from_root(2, slots.information);
    draft_.finish_factor();
  }

  void refuse_vertices() const {
    if (scanner_.tag().starts_with("VERTEX")) {
      scanner_.fail(
          fmt::format("'{}', but iSAM text has no vertices; expected edges only, or another format "
                      "(toro, g2o) to be named",
                      shown(scanner_.tag())));
    }
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
