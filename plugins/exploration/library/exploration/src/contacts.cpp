// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/contacts.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace cairn {
namespace {

using Eigen::Vector2d;

/// A contact is forgotten after so many metres: the estimate drifts, and what was touched moves.
constexpr double kRemembered = 50.0;
constexpr int kObstacle = 2;  ///< times that it was touched
/// Contacts as near to each other as the body is wide are one, but at least, and at most [m].
constexpr double kSamePlace = 0.1, kSamePlaceAtMost = 0.5;
/// Points as near to each other of what is seen are one [m].
constexpr double kSeenApart = 0.05;
/// Beyond the radius: clearances are left as they are where no planner keeps so far away [m].
constexpr double kReach = 2.0;

/// No clearance is larger than to a point at the surface of an obstacle.
void limit(const GridFrame& frame, const Vector2d& point, double reach,
           std::vector<float>& clearance) {
  const Vector2d low = frame.to_cells(point - Vector2d::Constant(reach)).array().floor(),
                 high = frame.to_cells(point + Vector2d::Constant(reach)).array().floor();
  const int first_x = static_cast<int>(std::max(low.x(), 0.0)),
            first_y = static_cast<int>(std::max(low.y(), 0.0)),
            last_x = static_cast<int>(std::min(high.x(), frame.width - 1.0)),
            last_y = static_cast<int>(std::min(high.y(), frame.height - 1.0));
  for (int y = first_y; y <= last_y; ++y) {
    for (int x = first_x; x <= last_x; ++x) {
      float& value = clearance[frame.index(x, y)];
      value = std::min(value, static_cast<float>((frame.centre(x, y) - point).norm()));
    }
  }
}

}  // namespace

void Contacts::add(const Vector2d& at, const Vector2d& direction, double driven) {
  const Vector2d point = at + radius_ * direction.normalized();
  const auto apart = [&](const Contact& contact) { return (contact.point - point).norm(); };
  // What was seen is where it is, which is more than likely.
  const auto guessed = [&](const Contact& contact) {
    return contact.seen ? std::numeric_limits<double>::infinity() : apart(contact);
  };
  const auto nearest = std::ranges::min_element(contacts_, {}, guessed);
  if (nearest != contacts_.end() &&
      guessed(*nearest) <= std::clamp(radius_, kSamePlace, kSamePlaceAtMost)) {
    *nearest = {point, driven, nearest->times + 1, false};
  } else {
    contacts_.push_back({point, driven, 1, false});
  }
}

bool Contacts::see(const Vector2d& point, double driven) {
  const auto known = std::ranges::find_if(contacts_, [&](const Contact& contact) {
    return contact.seen && (contact.point - point).norm() < kSeenApart;
  });
  if (known == contacts_.end()) {
    contacts_.push_back({point, driven, kObstacle, true});
    return true;
  }
  known->driven = driven;
  return std::exchange(known->times, kObstacle) < kObstacle;
}

const FloorMap& Contacts::seen_by(const FloorMap& map, double driven) {
  std::erase_if(contacts_, [&](const Contact& one) { return driven - one.driven > kRemembered; });
  if (!any_obstacle()) {
    map_ = {};
    return map;
  }
  map_ = map;
  for (const Contact& contact : contacts_) {
    if (contact.times < kObstacle) continue;
    limit(map.frame, contact.point, radius_ + kReach, map_.clearance);
    if (map.has_caution()) limit(map.frame, contact.point, radius_ + kReach, map_.caution);
  }
  return map_;
}

bool Contacts::doubt() {
  const bool any = any_obstacle();
  for (Contact& contact : contacts_) contact.times = std::min(contact.times, kObstacle - 1);
  return any;
}

bool Contacts::any_obstacle() const {
  return std::ranges::any_of(contacts_, [](const Contact& one) { return one.times >= kObstacle; });
}

}  // namespace cairn
