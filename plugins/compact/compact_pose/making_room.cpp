// SPDX-License-Identifier: BSD-3-Clause
// A compact graph of at most so many poses: others leave, and factors between their neighbours take
// their place.
#include <algorithm>
#include <set>
#include <unordered_set>
#include <utility>

#include <fmt/core.h>

#include "cairn/runtime/timed.hpp"
#include "compact_graph.hpp"

namespace cairn::compact {
namespace {

/// Appends what follows a pose that has left to what led there. Where the pose was not reached but
/// matched, the way there from the pose that was matched and back is no part of the trajectory.
void append(OdometryChain&& next, OdometryChain& chain) {
  auto first = next.steps.begin();
  if (!chain.steps.empty() && chain.steps.back().matched && first != next.steps.end() &&
      first->matched) {
    chain.steps.pop_back();
    ++first;
  }
  chain.steps.insert(chain.steps.end(), std::make_move_iterator(first),
                     std::make_move_iterator(next.steps.end()));
  chain.to = next.to;
}

}  // namespace

CompactGraph::Leaving CompactGraph::make_room(PoseRemover& remover, int limit,
                                              std::span<const int> held, PolicySeconds& seconds) {
  update({}, seconds);  // now the estimator has everything
  const Timed timed(seconds.estimate);
  GraphUpdate staying;  // a remover leaves poses alone that something is about to be measured of
  Factor& factor = staying.factors.emplace_back();
  factor.variables = {kept_.back().id, kept_[map_size_].id};
  if (!newest_.kept) factor.variables.push_back(kept_[newest_.predecessor].id);
  for (const int pose : held) factor.variables.push_back(kept_[pose].id);
  PoseRemover::Removal removal = remover.make_room(*estimator_, limit, staying);
  Leaving leaving{.poses = removal.update.removed_variables,
                  .now = {},
                  .note = removal.note,
                  .notes = removal.notes};
  if (leaving.poses.empty()) return leaving;
  const std::unordered_set<Id> gone(leaving.poses.begin(), leaving.poses.end());
  int left = 0;
  for (const Kept& pose : kept_) leaving.now.push_back(gone.contains(pose.id) ? -1 : left++);
  std::vector<Factor> removed;
  for (const FactorId id : removal.update.removed_factors)
    removed.push_back(estimator_->factor(id));
  // Where landmarks are held by bearings, what takes the place of poses may not determine them.
  std::unique_ptr<Estimator> before = landmarks_.empty() ? nullptr : estimator_->clone();
  const UpdateReport report = estimator_->update(removal.update);
  copy_.reset();
  if (before && !(report.ok && determined({}, gone))) {
    estimator_ = std::move(before);
    return {.poses = {},
            .now = {},
            .note = fmt::format("more than {} poses stay for now: what would take the place of {} "
                                "others leaves poses or landmarks undetermined",
                                limit, leaving.poses.size()),
            .notes = {}};
  }
  merge_ways(removal.update, removed);
  renumber(removal.update, report.first_factor, leaving.now);
  join_chains(removal.update);
  full_ = true;
  refresh();
  return leaving;
}

/// After poses have left, and factors have come in their place.
void CompactGraph::renumber(const GraphUpdate& leaving, FactorId first_factor,
                            std::span<const int> now) {
  const std::unordered_set<FactorId> removed(leaving.removed_factors.begin(),
                                             leaving.removed_factors.end());
  std::map<std::pair<int, int>, Bridge> bridges;
  for (auto& [ends, bridge] : bridges_) {
    if (removed.contains(bridge.factor)) continue;
    bridges.emplace(std::pair{now[ends.first], now[ends.second]}, std::move(bridge));
  }
  map_size_ -= static_cast<int>(std::ranges::count(now.first(map_size_), -1));
  std::erase_if(kept_, [&, k = 0](const Kept&) mutable { return now[k++] < 0; });
  solved_ = size();
  anchor_ = newest_.kept ? size() - 1 : now[anchor_];
  if (newest_.predecessor >= 0) newest_.predecessor = now[newest_.predecessor];
  number_.clear();
  index_ = std::make_unique<PoseIndex>(group_->dimension());
  for (int k = 0; k < size(); ++k) {
    number_.emplace(kept_[k].id, k);
    index_->add(kept_[k].placed.at.t);
  }
  // What the robot measures between the same two poses is fused with what they were given; where
  // there is a factor for that already, with that one.
  for (std::size_t k = 0; k < leaving.factors.size(); ++k) {
    const Factor& factor = leaving.factors[k];
    if (factor.variables.size() != 2 || !factor.type->is_relative()) continue;
    const std::pair<int, int> ends =
        std::minmax(find(factor.variables[0]), find(factor.variables[1]));
    const Motion motion = group_->motions().of_factor(factor, id(ends.first));
    bridges.emplace(ends, Bridge{first_factor + static_cast<FactorId>(k), motion, motion});
  }
  bridges_ = std::move(bridges);
}

/// Links that became a part of the factors between the neighbours of poses that have left.
void CompactGraph::merge_ways(const GraphUpdate& leaving, std::span<const Factor> removed) {
  const std::unordered_set<Id> gone(leaving.removed_variables.begin(),
                                    leaving.removed_variables.end());
  const std::unordered_set<FactorId> factors(leaving.removed_factors.begin(),
                                             leaving.removed_factors.end());
  std::set<std::pair<Id, Id>> pairs;
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

/// The way from one kept pose to the next leads past those that have left.
void CompactGraph::join_chains(const GraphUpdate& leaving) {
  const std::unordered_set<Id> gone(leaving.removed_variables.begin(),
                                    leaving.removed_variables.end());
  std::vector<OdometryChain> joined;
  joined.reserve(chains_.size());
  for (OdometryChain& chain : chains_) {
    if (!joined.empty() && gone.contains(chain.from)) {
      append(std::move(chain), joined.back());
    } else {
      joined.push_back(std::move(chain));
    }
  }
  chains_ = std::move(joined);
}

/// Of a measurement between two kept poses: ½ ln (|Σ_y + Σ_d| / |Σ_y|) [nats].
double CompactGraph::gain(std::pair<int, int> ends, const Motion& measured) {
  return mutual_information(to_matrix(measured.covariance, group_->tangent_size()),
                            between(ends.first, ends.second).covariance);
}

}  // namespace cairn::compact
