// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/contacts.hpp"

#include <algorithm>
#include <cmath>

namespace cairn {
namespace {

using Eigen::Vector2d;

/// A contact is forgotten after so many metres: the estimate drifts, and what was touched moves.
constexpr double kRemembered = 50.0;
constexpr int kObstacle = 2;  ///< times that it was touched
/// Planners keep no farther from obstacles than this beyond the body's radius [m].
constexpr double kMargin = 0.5;

/// No clearance is larger than to a point at the surface of an obstacle.
void limit(const GridFrame& frame, const Vector2d& point, double reach,
           std::vector<float>& clearance) {
  const double half =
      0.5 * frame.resolution;  // from the surface to the middle of an obstacle's cell
  const Vector2d low = frame.to_cells(point - Vector2d::Constant(reach)).array().floor(),
                 high = frame.to_cells(point + Vector2d::Constant(reach)).array().floor();
  const int first_x = static_cast<int>(std::max(low.x(), 0.0)),
            first_y = static_cast<int>(std::max(low.y(), 0.0)),
            last_x = static_cast<int>(std::min(high.x(), frame.width - 1.0)),
            last_y = static_cast<int>(std::min(high.y(), frame.height - 1.0));
  for (int y = first_y; y <= last_y; ++y) {
    for (int x = first_x; x <= last_x; ++x) {
      float& value = clearance[frame.index(x, y)];
      value = std::min(value, static_cast<float>((frame.centre(x, y) - point).norm() + half));
    }
  }
}

}  // namespace

void Contacts::add(const Vector2d& at, const Vector2d& direction, double driven) {
  const Vector2d point = at + radius_ * direction.normalized();
  for (Contact& contact : contacts_) {
    if ((contact.point - point).norm() > radius_) continue;
    contact = {point, driven, contact.times + 1};
    return;
  }
  contacts_.push_back({point, driven, 1});
}

const FloorMap& Contacts::seen_by(const FloorMap& map, double driven) {
  std::erase_if(contacts_, [&](const Contact& one) { return driven - one.driven > kRemembered; });
  if (!any_obstacle()) return map;
  map_ = map;
  for (const Contact& contact : contacts_) {
    if (contact.times < kObstacle) continue;
    limit(map.frame, contact.point, radius_ + kMargin, map_.clearance);
    if (!map_.caution.empty()) limit(map.frame, contact.point, radius_ + kMargin, map_.caution);
  }
  return map_;
}

bool Contacts::forget() {
  const bool known = any_obstacle();
  contacts_.clear();
  return known;
}

bool Contacts::any_obstacle() const {
  return std::ranges::any_of(contacts_, [](const Contact& one) { return one.times >= kObstacle; });
}

}  // namespace cairn
