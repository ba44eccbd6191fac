// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// Where a round body has touched obstacles. What it has touched at one place twice is an obstacle
/// to paths for some time, whatever the map shows there: the same path would touch it again. Once
/// is no reason, since the place is known no better than by the direction of the motion.
class CAIRN_API Contacts {
 public:
  explicit Contacts(double radius) : radius_(radius) {}

  /// Something in the `direction` of the motion (of any length but 0) has stopped the body at `at`
  /// [m], after so many metres were `driven`.
  void add(const Eigen::Vector2d& at, const Eigen::Vector2d& direction, double driven);
  /// The map, whose clearances are no larger than up to obstacles that were touched; it is good
  /// until the next call, and as long as `map`.
  const FloorMap& seen_by(const FloorMap& map, double driven);
  /// Forgets everything. Returns whether something was an obstacle.
  bool forget();

 private:
  struct Contact {
    Eigen::Vector2d point;  // [m]
    double driven;          // when it was touched last [m]
    int times;
  };
  bool any_obstacle() const;

  double radius_;
  std::vector<Contact> contacts_;
  FloorMap map_;
};

}  // namespace cairn
