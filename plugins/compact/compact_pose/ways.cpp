// SPDX-License-Identifier: BSD-3-Clause
#include "ways.hpp"

#include <algorithm>

namespace cairn::compact {

bool Way::has_match() const {
  return start || end || std::ranges::any_of(parts, &WayPart::matched);
}

bool Way::has_match_of(Id a, Id b) const {
  return (end && end->is_match_of(a, b)) ||
         std::ranges::any_of(parts, [&](const WayPart& part) { return part.is_match_of(a, b); });
}

Motion part_of(const Motion& match, double of_way) {
  Motion part = match;
  for (double& entry : part.covariance) entry /= of_way;
  return part;
}

Motion motion_of(const Way& way, const MotionGroup& group, CompositionOrder order) {
  std::optional<Motion> motion;
  if (way.start) {
    motion = way.start->divided ? part_of(way.start->motion, 1.0 - way.start->of_way)
                                : way.start->motion;
  }
  for (const WayPart& part : way.parts) {
    if (!motion) {
      motion = part.motion;
    } else if (part.matched) {
      motion = group.fuse(*motion, part.motion);
    } else {
      motion = group.compose(*motion, part.motion, order);
    }
  }
  return motion ? *motion : group.identity();
}

void Ways::begin(Id from) {
  open_ = {};
  open_.from = from;
}

void Ways::begin(Id from, WayPart start) {
  begin(from);
  open_.start = std::move(start);
}

void Ways::add_odometry(const Motion& motion, const MotionGroup& group, CompositionOrder order) {
  std::vector<WayPart>& parts = open_.parts;
  if (parts.empty() || parts.back().matched) {
    parts.push_back({.motion = motion});
  } else {
    parts.back().motion = group.compose(parts.back().motion, motion, order);
  }
}

void Ways::close(Id to, Way::Became became) {
  open_.to = to;
  open_.became = became;
  if (open_.has_match()) ways_.push_back(std::move(open_));
  open_ = {};
}

bool Ways::has(Id a, Id b) const {
  return open_.has_match_of(a, b) ||
         std::ranges::any_of(ways_, [&](const Way& way) { return way.has_match_of(a, b); });
}

void Ways::replace(Change change) {
  const auto first = ways_.begin() + static_cast<std::ptrdiff_t>(change.first);
  const auto at = ways_.erase(first, first + static_cast<std::ptrdiff_t>(change.count));
  if (change.open) {
    open_ = std::move(change.now.back());
    change.now.pop_back();
  }
  ways_.insert(at, change.now.begin(), change.now.end());
}

std::optional<Ways::Change> Ways::without(
    Id a, Id b, const MotionGroup& group, CompositionOrder order,
    const std::function<double(const Way&, const Motion&)>& of_way) const {
  const auto has = [&](const Way& way) { return way.has_match_of(a, b); };
  const auto found = std::ranges::find_if(ways_, has);
  if (found == ways_.end() && !has(open_)) return std::nullopt;
  Change change;
  change.first = static_cast<std::size_t>(found - ways_.begin());
  const auto old = [&](std::size_t k) -> const Way& { return k < ways_.size() ? ways_[k] : open_; };
  const auto begun = [&](const Way& like) {
    Way way;
    way.from = like.from;
    way.start = like.start;
    return way;
  };
  Way now = begun(old(change.first));
  const auto end_with = [&](WayPart match, Way::Became became) {
    now.to = match.kept;
    now.end = match;
    now.became = became;
    change.now.push_back(std::move(now));
    now = {};
    now.from = match.kept;
    now.start = std::move(match);
  };
  for (std::size_t k = change.first;; ++k) {
    const Way& way = old(k);
    for (const WayPart& part : way.parts) {
      if (part.is_match_of(a, b)) continue;
      if (!part.matched && !now.parts.empty() && !now.parts.back().matched) {
        now.parts.back().motion = group.compose(now.parts.back().motion, part.motion, order);
      } else if (!part.matched || part.kept == now.from) {
        now.parts.push_back(part);
      } else {  // without the revoked match the way did not begin at that pose
        WayPart match = part;
        match.of_way = of_way(now, part.motion);
        end_with(std::move(match), Way::Became::bridge);
      }
    }
    if (way.became == Way::Became::open) {
      change.open = true;
      change.now.push_back(std::move(now));
      return change;
    }
    ++change.count;
    if (!way.end) {
      now.to = way.to;
      now.became = way.became;
      change.now.push_back(std::move(now));
      return change;
    }
    if (way.end->is_match_of(a, b)) continue;
    if (way.end->kept != now.from) {  // from here on all is as it was
      end_with(*way.end, way.became);
      return change;
    }
    WayPart match = *way.end;
    now.parts.push_back(std::move(match));
  }
}

}  // namespace cairn::compact
