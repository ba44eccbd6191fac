// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// Where a round body has touched obstacles, or would. What it has touched at one place twice, or
/// seen in its way, is an obstacle to paths for some time, whatever the map shows there: the same
/// path would touch it again.
class CAIRN_API Contacts {
 public:
  explicit Contacts(double radius) : radius_(radius) {}

  /// Something has stopped the body at `at` [m], after so many metres were `driven`, on a motion in
  /// `direction` (of any length but 0): it is taken to be straight ahead, which is no more than
  /// likely.
  void add(const Eigen::Vector2d& at, const Eigen::Vector2d& direction, double driven);
  /// The surface of an obstacle has been seen at a point [m], after so many metres were `driven`:
  /// it is one at once. False: it was one already.
  bool see(const Eigen::Vector2d& point, double driven);
  /// The map, with clearance and caution no larger than the distance to what is an obstacle;
  /// good until the next call, and as long as `map`.
  const FloorMap& seen_by(const FloorMap& map, double driven);
  /// What is an obstacle is none any more until it is touched or seen once again. Returns whether
  /// there was any.
  bool doubt();
  /// Nothing was touched, or seen.
  void forget() { contacts_.clear(); }

 private:
  struct Contact {
    Eigen::Vector2d point;  // [m]
    double driven;          // when it was touched or seen last [m]
    int times;
    bool seen;
  };
  bool any_obstacle() const;

  double radius_;
  std::vector<Contact> contacts_;
  FloorMap map_;
};

}  // namespace cairn
