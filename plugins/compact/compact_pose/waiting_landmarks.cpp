// SPDX-License-Identifier: BSD-3-Clause
#include "waiting_landmarks.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

namespace cairn::compact {
namespace {

/// Of so many views at most a landmark is triangulated: the first, the last and some between. The
/// others are judged one by one once it is in the graph.
constexpr std::size_t kMostViews = 8;

/// Of so many poses at most a landmark waits for others: older ones are given up.
constexpr std::size_t kMostWaitingViews = 64;

/// A landmark that has left the graph so often is left out for good.
constexpr int kMostRemovals = 3;

/// Numbers of views to triangulate from, in order.
std::vector<std::size_t> chosen_of(std::size_t views) {
  const std::size_t count = std::min(views, kMostViews);
  std::vector<std::size_t> chosen;
  for (std::size_t k = 0; k < count; ++k)
    chosen.push_back(count == 1 ? views - 1 : k * (views - 1) / (count - 1));
  return chosen;
}

/// What the triangulation of a landmark needs of each of some of its views, these numbers.
std::vector<PlacedView> placed_views(const WaitingLandmark& waiting,
                                     std::span<const std::size_t> chosen,
                                     const CompactGraph& graph) {
  const RigidGroup& group = graph.group();
  const auto state = [&](const View& view) -> const State& {
    const int pose = graph.kept().find(view.pose);
    return pose < 0 ? graph.newest().state() : graph.kept().state(pose);
  };
  const PlacedState last = group.place(state(waiting.views[chosen.back()]));
  std::vector<PlacedView> views;
  for (const std::size_t k : chosen) {
    const View& view = waiting.views[k];
    const PlacedState placed = group.place(state(view));
    views.push_back({.factors = view.factors,
                     .pose = view.pose,
                     .x = placed.x,
                     .at = placed.at.t,
                     .to_last = group.displacement(last, placed).adjoint});
  }
  return views;
}

/// What a pose measured of a landmark is not used.
LandmarkReport given_up(Id landmark, const View& view) {
  return {.pose = view.pose,
          .landmark = landmark,
          .factors = static_cast<int>(std::ssize(view.factors)),
          .gain = std::numeric_limits<double>::infinity()};
}

}  // namespace

std::vector<Id> WaitingLandmarks::ids() const {
  std::vector<Id> ids;
  for (const auto& [id, waiting] : waiting_) ids.push_back(id);
  return ids;
}

const VariableType* WaitingLandmarks::type(Id landmark) const {
  const auto known = waiting_.find(landmark);
  return known == waiting_.end() ? nullptr : known->second.landmark.type.get();
}

bool WaitingLandmarks::has_views(Id landmark) const {
  const auto known = waiting_.find(landmark);
  return known != waiting_.end() && !known->second.views.empty();
}

bool WaitingLandmarks::may_wait(Id landmark) const {
  const auto removals = removals_.find(landmark);
  return several_views_ && (removals == removals_.end() || removals->second < kMostRemovals);
}

bool WaitingLandmarks::has_views_from(Id pose) const {
  return std::ranges::any_of(waiting_, [&](const auto& one) {
    return std::ranges::find(one.second.views, pose, &View::pose) != one.second.views.end();
  });
}

WaitingLandmark WaitingLandmarks::with_newest(const Variable& landmark,
                                              std::span<const Measured> factors,
                                              const CompactGraph& graph) const {
  WaitingLandmark all{.landmark = landmark, .views = {}};
  if (const auto known = waiting_.find(landmark.id); known != waiting_.end()) all = known->second;
  if (all.views.empty() || all.views.back().pose != graph.newest().id())
    all.views.push_back({.pose = graph.newest().id(), .factors = {}});
  std::vector<Measured>& last = all.views.back().factors;
  last.insert(last.end(), factors.begin(), factors.end());
  return all;
}

std::optional<Triangulated> WaitingLandmarks::triangulate(const WaitingLandmark& waiting,
                                                          CompactGraph& graph,
                                                          PolicySeconds& seconds) const {
  const std::vector<std::size_t> all = chosen_of(waiting.views.size());
  std::vector<int> poses;
  for (const std::size_t k : all) {
    const Id pose = waiting.views[k].pose;
    if (pose != graph.newest().id()) poses.push_back(graph.kept().find(pose));
  }
  const Eigen::MatrixXd covariance = graph.joint_covariance(poses, seconds);
  const Eigen::Index n = graph.group().tangent_size();
  const Consensus of = [&](std::span<const std::size_t> places) -> std::optional<Triangulated> {
    Triangulated some{.chosen = {}, .found = {}};
    std::vector<Eigen::Index> rows;
    for (const std::size_t place : places) {
      some.chosen.push_back(all[place]);
      for (Eigen::Index r = 0; r < n; ++r) rows.push_back(n * static_cast<Eigen::Index>(place) + r);
    }
    std::optional<Triangulation> found =
        compact::triangulate(*waiting.landmark.type, placed_views(waiting, some.chosen, graph),
                             Eigen::MatrixXd(covariance(rows, rows)), trust_);
    if (!found) return std::nullopt;
    some.found = std::move(*found);
    return some;
  };
  std::vector<std::size_t> places(all.size());
  std::iota(places.begin(), places.end(), std::size_t{0});
  std::optional<Triangulated> found = of(places);
  if (!gate_.on() || (found && agree(*found))) return found;
  if (std::optional<Triangulated> consensus = consensus_of(places, of)) return consensus;
  return found;
}

bool WaitingLandmarks::fits(const Triangulated& some) const {
  return gate_.passes(some.found.fit.innovation, some.found.fit.dof);
}

bool WaitingLandmarks::agree(const Triangulated& some) const {
  return (!gate_.on() || some.found.fit.dof > 0) && fits(some);
}

/// The largest set of views that agree without one or two of all, and are more than half of them:
/// the best of these. Nothing: there is none.
std::optional<Triangulated> WaitingLandmarks::consensus_of(std::span<const std::size_t> places,
                                                           const Consensus& of) const {
  std::optional<Triangulated> best;
  const auto consider = [&](std::size_t without, std::size_t and_without) {
    std::vector<std::size_t> others;
    for (const std::size_t place : places) {
      if (place != without && place != and_without) others.push_back(place);
    }
    std::optional<Triangulated> found = of(others);
    if (!found || !agree(*found)) return;
    if (!best || found->found.fit.innovation < best->found.fit.innovation) best = std::move(found);
  };
  const std::size_t count = places.size();
  for (std::size_t k = 0; k < count && 2 * (count - 1) > count; ++k) consider(k, k);
  for (std::size_t k = 0; k < count && !best && 2 * (count - 2) > count; ++k) {
    for (std::size_t other = 0; other < k; ++other) consider(k, other);
  }
  return best;
}

void WaitingLandmarks::note(const Variable& landmark) {
  waiting_.try_emplace(landmark.id, WaitingLandmark{.landmark = landmark, .views = {}});
}

void WaitingLandmarks::note_left(const Variable& landmark) {
  note(landmark);
  ++removals_[landmark.id];
}

void WaitingLandmarks::add(WaitingLandmark waiting, const CompactGraph& graph, PoseReport& report) {
  const Id newest = waiting.landmark.id;
  std::vector<View>& views =
      waiting_.insert_or_assign(newest, std::move(waiting)).first->second.views;
  while (views.size() > kMostWaitingViews) {
    report.landmarks.push_back(given_up(newest, views.front()));
    views.erase(views.begin());
  }
  const auto waits = [](const auto& one) { return !one.second.views.empty(); };
  while (std::ranges::count_if(waiting_, waits) > most_) {
    const auto last_seen = [&](const auto& one) {
      return waits(one) ? graph.kept().find(one.second.views.back().pose)
                        : std::numeric_limits<int>::max();
    };
    auto& [id, oldest] = *std::ranges::min_element(waiting_, {}, last_seen);
    for (const View& view : oldest.views) report.landmarks.push_back(given_up(id, view));
    oldest.views.clear();
  }
}

void WaitingLandmarks::add(Id landmark, const View& view, const CompactGraph& graph) {
  if (!may_wait(landmark) || graph.kept().find(view.pose) < 0) return;
  std::vector<View>& views = waiting_.at(landmark).views;
  const auto number = [&](Id pose) { return graph.kept().find(pose); };
  const auto at = std::ranges::lower_bound(views, number(view.pose), {},
                                           [&](const View& other) { return number(other.pose); });
  if (at != views.end() && at->pose == view.pose) {
    at->factors.insert(at->factors.end(), view.factors.begin(), view.factors.end());
  } else {
    views.insert(at, view);
  }
}

std::vector<View> WaitingLandmarks::take(Id landmark) {
  auto node = waiting_.extract(landmark);
  return node ? std::move(node.mapped().views) : std::vector<View>();
}

void WaitingLandmarks::forget(std::span<const Id> poses, PoseReport& report) {
  for (auto& [id, waiting] : waiting_) {
    for (const Id pose : poses) {
      const auto view = std::ranges::find(waiting.views, pose, &View::pose);
      if (view == waiting.views.end()) continue;
      report.landmarks.push_back(given_up(id, *view));
      waiting.views.erase(view);
    }
  }
}

}  // namespace cairn::compact
