// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "cairn/geometry/motion.hpp"
#include "cairn/graph/elements.hpp"

namespace cairn::compact {

/// A measurement on the way from one kept pose to the next.
struct WayPart {
  Motion motion;  ///< odometry, or as measured from `matched` to `pose`
  /// Where `matched`: the pose of the trajectory, and the kept one that it was matched with.
  Id pose = 0, kept = 0;
  bool matched = false;
  double of_way = 1.0;  ///< the part of the information that ends the way; the rest begins the next
  bool divided = true;  ///< or the next way begins with all of it, and nothing was added here

  bool is_match_of(Id a, Id b) const {
    return matched && std::minmax(a, b) == std::minmax(pose, kept);
  }
};

/// What the trajectory between two kept poses was made of.
///
/// It begins at a kept pose, or at one that was matched with it (`start`), and ends where a pose is
/// kept, or matched with a kept one and not kept itself (`end`; `CompactGraph::relocate`). Matches
/// with the pose where it begins are among its parts: they measure the same as the parts before.
struct Way {
  enum class Became {
    open,      ///< it is not over
    odometry,  ///< the factor between the two poses
    bridge,    ///< a part of the factor between the two
    nothing,   ///< it was not informative enough
    merged     ///< its factors cannot be separated any more
  };

  Id from = 0, to = 0;
  std::optional<WayPart> start, end;
  std::vector<WayPart> parts;
  Became became = Became::open;
  Motion
      bridge{};  ///< what it adds to the factor, from the smaller number of the two to the larger

  bool has_match() const;
  bool has_match_of(Id a, Id b) const;
};

/// `of_way`, or all, of the information of a match.
Motion part_of(const Motion& match, double of_way);
/// From `from` to the last pose of the way, without the match there.
Motion motion_of(const Way& way, const MotionGroup& group, CompositionOrder order);

/// The latest ways, in their order, whose links can be revoked: those that begin or end with a
/// match, or have one. A way that ends with a match is followed by the one that begins with it.
class Ways {
 public:
  /// More are to be forgotten, the oldest first.
  static constexpr std::size_t kMost = 1000;

  /// Of ways that follow each other, how they would be without a match.
  struct Change {
    std::size_t first = 0, count = 0;  ///< of `all()`
    bool open = false;                 ///< and the open way
    std::vector<Way> now;              ///< what takes their place; the last one open if `open`
  };

  std::deque<Way>& all() { return ways_; }
  const std::deque<Way>& all() const { return ways_; }
  Way& open() { return open_; }
  /// The trajectory goes on from a kept pose.
  void begin(Id from);
  void begin(Id from, WayPart start);
  void add_odometry(const Motion& motion, const MotionGroup& group, CompositionOrder order);
  /// Ends the open way.
  void close(Id to, Way::Became became);

  /// Whether there is a match of two poses among them.
  bool has(Id a, Id b) const;
  /// How the ways would be without the match of two poses; nothing: it is in none of them.
  /// `of_way` divides a match that ends a way now, and did not before.
  std::optional<Change> without(
      Id a, Id b, const MotionGroup& group, CompositionOrder order,
      const std::function<double(const Way&, const Motion&)>& of_way) const;
  void replace(Change change);

 private:
  std::deque<Way> ways_;
  Way open_;
};

}  // namespace cairn::compact
