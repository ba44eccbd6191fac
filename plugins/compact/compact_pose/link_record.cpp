// SPDX-License-Identifier: BSD-3-Clause
#include "link_record.hpp"

#include <algorithm>
#include <iterator>
#include <set>
#include <string>
#include <unordered_set>
#include <utility>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"
#include "relocation.hpp"

namespace cairn::compact {
namespace {

[[noreturn]] void refuse(Id a, Id b, const std::string& why) {
  throw Error(ErrorCode::input, fmt::format("the link of poses {} and {} {}", a, b, why));
}

std::pair<int, int> ends_of(const Way& way, const KeptPoses& poses) {
  return std::minmax(poses.find(way.from), poses.find(way.to));
}

/// Those of a change that are over.
std::span<Way> closed(Ways::Change& change) {
  return {change.now.data(), change.now.size() - (change.open ? 1 : 0)};
}

}  // namespace

ChangedFactor replaced(FactorId factor, Id from, const Motion& motion, const KeptPoses& poses) {
  const MotionGroup& motions = poses.group()->motions();
  const Factor old = poses.estimator().factor(factor);
  const bool backwards = old.variables.front() != from;
  Factor now = motions.to_factor(old.type, old.variables.front(), old.variables.back(),
                                 backwards ? motions.inverse(motion) : motion);
  return {factor, std::move(now.measurement), std::move(now.information)};
}

void LinkRecord::note(std::span<const Factor> links, FactorId first) {
  for (const Factor& link : links) {
    const FactorId id = first++;
    if (link.variables.size() != 2) continue;
    links_[std::minmax(link.variables[0], link.variables[1])].push_back(id);
  }
}

/// A way that is too long ago to be remembered is a part of the bridge that it belongs to.
void LinkRecord::close_way(Id to, Way::Became became, const KeptPoses& poses) {
  ways_.close(to, became);
  if (ways_.all().size() <= Ways::kMost) return;
  const Way& oldest = ways_.all().front();
  Bridge* const known =
      oldest.became == Way::Became::bridge ? bridge(ends_of(oldest, poses)) : nullptr;
  if (known) {
    std::optional<Motion>& rest = known->rest;
    rest = rest ? poses.group()->motions().fuse(*rest, oldest.bridge) : oldest.bridge;
  }
  ways_.all().pop_front();
}

Bridge* LinkRecord::bridge(std::pair<int, int> ends) {
  const auto known = bridges_.find(ends);
  return known == bridges_.end() ? nullptr : &known->second;
}

bool LinkRecord::has(Id a, Id b) const {
  return links_.contains(std::minmax(a, b)) || ways_.has(a, b);
}

std::optional<Ways::Change> LinkRecord::ways_without(Id a, Id b, const RigidGroup& group) const {
  const MotionGroup& motions = group.motions();
  return ways_.without(a, b, motions, order_, [&](const Way& way, const Motion& match) {
    const int n = group.tangent_size();
    return part_of_way(to_matrix(motion_of(way, motions, order_).covariance, n),
                       to_matrix(match.covariance, n));
  });
}

LinkRecord::Revocation LinkRecord::without(Id a, Id b, const KeptPoses& poses,
                                           const std::shared_ptr<const FactorType>& type) const {
  Revocation revocation{
      .a = a, .b = b, .update = {}, .ways = ways_without(a, b, *poses.group()), .bridges = {}};
  if (const auto direct = links_.find(std::minmax(a, b)); direct != links_.end())
    revocation.update.removed_factors = direct->second;
  if (!revocation.ways) return revocation;
  const Ways::Change& change = *revocation.ways;
  for (std::size_t k = 0; k < change.count; ++k) {
    if (ways_.all()[change.first + k].became != Way::Became::merged) continue;
    refuse(a, b,
           "is part of factors that have taken the place of poses which left the map, and cannot "
           "be separated from them");
  }
  replace_bridges(revocation, poses, type);
  replace_odometry(revocation, poses, type);
  return revocation;
}

/// Computes what each of the new ways adds to its bridge, and the bridges that change.
void LinkRecord::replace_bridges(Revocation& revocation, const KeptPoses& poses,
                                 const std::shared_ptr<const FactorType>& type) const {
  const MotionGroup& motions = poses.group()->motions();
  Ways::Change& change = *revocation.ways;
  std::vector<Way> all(ways_.all().begin(), ways_.all().end());
  const auto first = all.begin() + static_cast<std::ptrdiff_t>(change.first);
  const auto last = first + static_cast<std::ptrdiff_t>(change.count);
  for (Way& way : closed(change)) {
    if (way.became != Way::Became::bridge) continue;
    const Motion end = part_of(way.end->motion, way.end->of_way);
    way.bridge = motions.compose(end, motions.inverse(motion_of(way, motions, order_)), order_);
    if (poses.find(way.to) > poses.find(way.from)) way.bridge = motions.inverse(way.bridge);
  }
  const auto touch = [&](const Way& way) {
    if (way.became == Way::Became::bridge) revocation.bridges[ends_of(way, poses)] = {};
  };
  std::for_each(first, last, touch);
  std::ranges::for_each(closed(change), touch);
  all.erase(first, last);
  std::ranges::copy(closed(change), std::back_inserter(all));
  GraphUpdate& update = revocation.update;
  for (auto& [ends, bridge] : revocation.bridges) {
    const auto known = bridges_.find(ends);
    if (known != bridges_.end()) bridge.rest = known->second.rest;
    if (bridge.rest) bridge.motion = *bridge.rest;
    for (const Way& way : all) {
      if (way.became != Way::Became::bridge || ends_of(way, poses) != ends) continue;
      bridge.motion =
          bridge.motion.mean.empty() ? way.bridge : motions.fuse(bridge.motion, way.bridge);
    }
    if (bridge.motion.mean.empty()) {
      if (known != bridges_.end()) update.removed_factors.push_back(known->second.factor);
      continue;
    }
    const Id from = poses.id(ends.first);
    if (known == bridges_.end()) {
      bridge.factor = -1;
      update.factors.push_back(motions.to_factor(type, from, poses.id(ends.second), bridge.motion));
    } else {
      bridge.factor = known->second.factor;
      update.changed.push_back(replaced(bridge.factor, from, bridge.motion, poses));
    }
  }
}

void LinkRecord::replace_odometry(Revocation& revocation, const KeptPoses& poses,
                                  const std::shared_ptr<const FactorType>& type) const {
  const MotionGroup& motions = poses.group()->motions();
  Ways::Change& change = *revocation.ways;
  for (std::size_t k = change.first; k < change.first + change.count; ++k) {
    const Way& way = ways_.all()[k];
    if (way.became != Way::Became::odometry) continue;
    revocation.update.removed_factors.push_back(
        odometry_factor(way.from, way.to, poses.estimator()));
  }
  for (const Way& way : closed(change)) {
    if (way.became != Way::Became::odometry) continue;
    revocation.update.factors.push_back(
        motions.to_factor(type, way.from, way.to, motion_of(way, motions, order_)));
  }
}

/// The factor of the way between two kept poses that is neither a link nor a bridge.
FactorId LinkRecord::odometry_factor(Id from, Id to, const Estimator& estimator) const {
  std::unordered_set<FactorId> others;
  const Pair ends = std::minmax(from, to);
  if (const auto link = links_.find(ends); link != links_.end())
    others.insert(link->second.begin(), link->second.end());
  for (const auto& [numbers, bridge] : bridges_) others.insert(bridge.factor);
  for (const FactorId id : estimator.factors()) {
    if (others.contains(id)) continue;
    const Factor factor = estimator.factor(id);
    if (factor.variables.size() == 2 &&
        Pair(std::minmax(factor.variables[0], factor.variables[1])) == ends)
      return id;
  }
  refuse(from, to, "has no odometry");
}

void LinkRecord::revoke(Revocation revocation, FactorId first) {
  links_.erase(std::minmax(revocation.a, revocation.b));
  for (auto& [ends, bridge] : revocation.bridges) {
    if (bridge.motion.mean.empty()) {
      bridges_.erase(ends);
      continue;
    }
    if (bridge.factor < 0) bridge.factor = first++;
    bridges_.insert_or_assign(ends, std::move(bridge));
  }
  if (revocation.ways) ways_.replace(std::move(*revocation.ways));
}

void LinkRecord::renumber(const std::unordered_map<FactorId, FactorId>& now) {
  const auto renumbered = [&](FactorId& id) {
    if (const auto at = now.find(id); at != now.end()) id = at->second;
  };
  for (auto& [ends, ids] : links_) std::ranges::for_each(ids, renumbered);
  for (auto& [ends, bridge] : bridges_) renumbered(bridge.factor);
}

void LinkRecord::merge(const GraphUpdate& leaving, std::span<const Factor> removed) {
  const std::unordered_set<Id> gone(leaving.removed_variables.begin(),
                                    leaving.removed_variables.end());
  const std::unordered_set<FactorId> factors(leaving.removed_factors.begin(),
                                             leaving.removed_factors.end());
  std::set<Pair> pairs;
  for (const std::span<const Factor> some : {removed, std::span<const Factor>(leaving.factors)}) {
    for (const Factor& factor : some) {
      if (factor.variables.size() == 2)
        pairs.insert(std::minmax(factor.variables[0], factor.variables[1]));
    }
  }
  for (Way& way : ways_.all()) {
    if (gone.contains(way.from) || gone.contains(way.to) ||
        (way.became != Way::Became::nothing && pairs.contains(std::minmax(way.from, way.to))))
      way.became = Way::Became::merged;
  }
  for (auto& [ends, ids] : links_)
    std::erase_if(ids, [&](FactorId id) { return factors.contains(id); });
  std::erase_if(links_, [](const auto& link) { return link.second.empty(); });
}

void LinkRecord::renumber(const GraphUpdate& leaving, FactorId first_factor,
                          std::span<const int> now, const KeptPoses& poses) {
  const std::unordered_set<FactorId> removed(leaving.removed_factors.begin(),
                                             leaving.removed_factors.end());
  Bridges bridges;
  for (auto& [ends, bridge] : bridges_) {
    if (removed.contains(bridge.factor)) continue;
    bridges.emplace(std::pair{now[ends.first], now[ends.second]}, std::move(bridge));
  }
  // What the robot measures between the same two poses is fused with what they were given; where
  // there is a factor for that already, with that one.
  for (std::size_t k = 0; k < leaving.factors.size(); ++k) {
    const Factor& factor = leaving.factors[k];
    if (factor.variables.size() != 2 || !factor.type->is_relative()) continue;
    const std::pair<int, int> ends =
        std::minmax(poses.find(factor.variables[0]), poses.find(factor.variables[1]));
    const Motion motion = poses.group()->motions().of_factor(factor, poses.id(ends.first));
    bridges.emplace(ends, Bridge{first_factor + static_cast<FactorId>(k), motion, motion});
  }
  bridges_ = std::move(bridges);
}

}  // namespace cairn::compact
