// SPDX-License-Identifier: BSD-3-Clause
// A compact graph as it would be without a link that it has.
#include <algorithm>
#include <span>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"
#include "compact_graph.hpp"
#include "relocation.hpp"

namespace cairn::compact {
namespace {

[[noreturn]] void refuse(Id a, Id b, const std::string& why) {
  throw Error(ErrorCode::input, fmt::format("the link of poses {} and {} {}", a, b, why));
}

std::pair<Id, Id> pair_of(Id a, Id b) { return std::minmax(a, b); }

/// Whether variables are in one piece by these factors.
class Pieces {
 public:
  void join(Id a, Id b) { parent_[root(a)] = root(b); }
  Id root(Id id) {
    parent_.try_emplace(id, id);
    while (parent_[id] != id) id = parent_[id] = parent_[parent_[id]];
    return id;
  }

 private:
  std::unordered_map<Id, Id> parent_;
};

bool is_match_step(const ChainStep& step) { return step.matched; }

}  // namespace

bool CompactGraph::revoke(Id a, Id b, PolicySeconds& seconds) {
  if (!group_) return false;
  const auto direct = links_.find(pair_of(a, b));
  std::optional<Ways::Change> change =
      ways_.without(a, b, group_->motions(), order_, [&](const Way& way, const Motion& match) {
        const int n = group_->tangent_size();
        return part_of_way(to_matrix(motion_of(way, group_->motions(), order_).covariance, n),
                           to_matrix(match.covariance, n));
      });
  if (direct == links_.end() && !change) return false;
  update({}, seconds);  // now the estimator has everything
  const Timed timed(seconds.estimate);
  GraphUpdate leaving;
  if (direct != links_.end()) leaving.removed_factors = direct->second;
  std::map<std::pair<int, int>, Bridge> bridges;
  if (change) {
    for (std::size_t k = 0; k < change->count; ++k) {
      if (ways_.all()[change->first + k].became != Way::Became::merged) continue;
      refuse(a, b,
             "is part of factors that have taken the place of poses which left the map, and cannot "
             "be separated from them");
    }
    bridges = replace_ways(*change, leaving);
  }
  check_connected(a, b, leaving);
  const UpdateReport report = estimator_->update(leaving);  // throws before anything has changed
  copy_.reset();
  if (direct != links_.end()) links_.erase(direct);
  FactorId next = report.first_factor;
  for (auto& [ends, bridge] : bridges) {
    if (bridge.motion.mean.empty()) {
      bridges_.erase(ends);
      continue;
    }
    if (bridge.factor < 0) bridge.factor = next++;
    bridges_.insert_or_assign(ends, std::move(bridge));
  }
  if (change) {
    replace_chains(*change);
    std::deque<Way>& ways = ways_.all();
    const auto at =
        ways.erase(ways.begin() + static_cast<std::ptrdiff_t>(change->first),
                   ways.begin() + static_cast<std::ptrdiff_t>(change->first + change->count));
    auto last = change->now.end();
    if (change->open) {
      ways_.open() = *--last;
      newest_.predecessor = find(ways_.open().from);
      newest_.odometry = motion_of(ways_.open(), group_->motions(), order_);
    }
    ways.insert(at, change->now.begin(), last);
  }
  anchor_ = newest_.kept ? size() - 1 : newest_.predecessor;
  newest_.ahead = newest_.kept ? Ahead() : compose({}, newest_.odometry);
  refresh();
  return true;
}

/// What the estimator has of the old ways goes, and what the new ones are takes its place; new
/// factors of bridges come first. Computes what each of the new ways adds to its bridge. Returns
/// the bridges that change; an empty one is none any more.
std::map<std::pair<int, int>, CompactGraph::Bridge> CompactGraph::replace_ways(
    Ways::Change& change, GraphUpdate& update) {
  const MotionGroup& motions = group_->motions();
  std::vector<Way> all(ways_.all().begin(), ways_.all().end());
  const auto first = all.begin() + static_cast<std::ptrdiff_t>(change.first);
  const auto last = first + static_cast<std::ptrdiff_t>(change.count);
  const std::vector<Way> old(first, last);
  const std::span<Way> now(change.now.data(), change.now.size() - (change.open ? 1 : 0));
  for (Way& way : now) {
    if (way.became != Way::Became::bridge) continue;
    const Motion end = part_of(way.end->motion, way.end->of_way);
    way.bridge = motions.compose(end, motions.inverse(motion_of(way, motions, order_)), order_);
    if (find(way.to) > find(way.from)) way.bridge = motions.inverse(way.bridge);
  }
  std::map<std::pair<int, int>, Bridge> bridges;
  const auto touch = [&](const Way& way) {
    if (way.became == Way::Became::bridge) bridges[std::minmax(find(way.from), find(way.to))] = {};
  };
  std::ranges::for_each(old, touch);
  std::ranges::for_each(now, touch);
  all.erase(first, last);
  all.insert(all.end(), now.begin(), now.end());
  for (auto& [ends, bridge] : bridges) {
    const auto known = bridges_.find(ends);
    if (known != bridges_.end()) bridge.rest = known->second.rest;
    if (bridge.rest) bridge.motion = *bridge.rest;
    for (const Way& way : all) {
      if (way.became != Way::Became::bridge ||
          std::pair<int, int>(std::minmax(find(way.from), find(way.to))) != ends)
        continue;
      bridge.motion =
          bridge.motion.mean.empty() ? way.bridge : motions.fuse(bridge.motion, way.bridge);
    }
    if (bridge.motion.mean.empty()) {
      if (known != bridges_.end()) update.removed_factors.push_back(known->second.factor);
      continue;
    }
    if (known == bridges_.end()) {
      bridge.factor = -1;
      update.factors.push_back(
          motions.to_factor(newest_.type, id(ends.first), id(ends.second), bridge.motion));
    } else {
      bridge.factor = known->second.factor;
      update.changed.push_back(replaced(bridge.factor, id(ends.first), bridge.motion));
    }
  }
  for (const Way& way : old) {
    if (way.became == Way::Became::odometry)
      update.removed_factors.push_back(odometry_factor(way.from, way.to));
  }
  for (const Way& way : now) {
    if (way.became != Way::Became::odometry) continue;
    update.factors.push_back(
        motions.to_factor(newest_.type, way.from, way.to, motion_of(way, motions, order_)));
  }
  return bridges;
}

/// The factor of the way between two kept poses that is neither a link nor a bridge.
FactorId CompactGraph::odometry_factor(Id from, Id to) const {
  std::unordered_set<FactorId> others;
  if (const auto link = links_.find(pair_of(from, to)); link != links_.end())
    others.insert(link->second.begin(), link->second.end());
  for (const auto& [ends, bridge] : bridges_) others.insert(bridge.factor);
  for (const FactorId id : estimator_->factors()) {
    if (others.contains(id)) continue;
    const Factor factor = estimator_->factor(id);
    if (factor.variables.size() == 2 &&
        pair_of(factor.variables[0], factor.variables[1]) == pair_of(from, to))
      return id;
  }
  refuse(from, to, "has no odometry");
}

/// Of a trajectory on a map: a link may be all that connects the two.
void CompactGraph::check_connected(Id a, Id b, const GraphUpdate& leaving) const {
  if (map_size_ == 0 || !located_) return;
  const std::unordered_set<FactorId> gone(leaving.removed_factors.begin(),
                                          leaving.removed_factors.end());
  Pieces pieces;
  const auto join = [&](const Factor& factor) {
    for (const Id id : factor.variables) pieces.join(factor.variables.front(), id);
  };
  for (const FactorId id : estimator_->factors()) {
    if (!gone.contains(id)) join(estimator_->factor(id));
  }
  std::ranges::for_each(leaving.factors, join);
  for (const Kept& pose : kept_) {
    if (pieces.root(pose.id) == pieces.root(kept_.front().id)) continue;
    refuse(a, b,
           "is all that connects the trajectory to the map, without it nothing is known of their "
           "relative position; expected another link between the two first");
  }
}

/// The poses of the chains stay, and are divided as the ways are.
void CompactGraph::replace_chains(const Ways::Change& change) {
  if (!keeps_chains_) return;
  const MotionGroup& motions = group_->motions();
  // The chains of these ways follow each other; the first is found by its ends.
  std::size_t first = chains_.size();
  if (change.count > 0) {
    const Way& way = ways_.all()[change.first];
    const auto is_of = [&](const OdometryChain& chain) {
      if (chain.from != way.from || chain.to != way.to) return false;
      const std::size_t steps = chain.steps.size();
      if (!way.end) return steps > 0 && !chain.steps.back().matched;
      return steps > 1 && chain.steps.back().matched &&
             chain.steps[steps - 2].pose == way.end->pose;
    };
    const auto found = std::find_if(chains_.rbegin(), chains_.rend(), is_of);
    if (found == chains_.rend()) return;
    first = static_cast<std::size_t>(chains_.rend() - found) - 1;
  }
  std::vector<ChainStep> steps;
  const auto gather = [&](std::vector<ChainStep>& some) {
    std::erase_if(some, is_match_step);
    std::ranges::move(some, std::back_inserter(steps));
  };
  const std::size_t end = std::min(first + change.count, chains_.size());
  for (std::size_t k = first; k < end; ++k) gather(chains_[k].steps);
  if (change.open) gather(newest_.steps);
  std::vector<OdometryChain> now;
  auto next = steps.begin();
  for (const Way& way : change.now) {
    OdometryChain& chain = now.emplace_back(OdometryChain{way.from, way.to, {}});
    if (way.start) {
      const Motion start = way.start->divided ? part_of(way.start->motion, 1.0 - way.start->of_way)
                                              : way.start->motion;
      chain.steps.push_back({way.start->pose, start.mean, start.covariance, true});
    }
    const bool all = !way.end && &way == &change.now.back();
    const bool none = way.end && way.start && way.end->pose == way.start->pose;
    for (bool more = !none; more && next != steps.end(); ++next) {
      more = all || next->pose != (way.end ? way.end->pose : way.to);
      chain.steps.push_back(std::move(*next));
    }
    if (way.end) {
      const Motion part =
          way.end->divided ? part_of(way.end->motion, way.end->of_way) : way.end->motion;
      const Motion back = motions.inverse(part);
      chain.steps.push_back({way.to, back.mean, back.covariance, true});
    }
  }
  if (change.open) {
    newest_.steps = std::move(now.back().steps);
    now.pop_back();
  }
  chains_.erase(chains_.begin() + static_cast<std::ptrdiff_t>(first),
                chains_.begin() + static_cast<std::ptrdiff_t>(end));
  chains_.insert(chains_.begin() + static_cast<std::ptrdiff_t>(first),
                 std::make_move_iterator(now.begin()), std::make_move_iterator(now.end()));
}

}  // namespace cairn::compact
