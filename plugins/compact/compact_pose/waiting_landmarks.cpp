// SPDX-License-Identifier: BSD-3-Clause
// Landmarks that no single measurement determines, such as those of which bearings are measured:
// what was measured of them waits until several poses determine them together.
#include <algorithm>
#include <cstddef>
#include <limits>
#include <numeric>
#include <utility>

#include "compact_pose.hpp"
#include "landmarks.hpp"
#include "triangulation.hpp"

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

}  // namespace

std::vector<Id> CompactPose::undetermined() const {
  std::vector<Id> ids;
  for (const auto& [id, waiting] : waiting_landmarks_) ids.push_back(id);
  return ids;
}

/// What the newest pose measures of a landmark, beside what waits.
CompactPose::WaitingLandmark CompactPose::with_newest(const Seen& seen) const {
  WaitingLandmark all{.landmark = seen.landmark, .views = {}};
  if (const auto known = waiting_landmarks_.find(seen.landmark.id);
      known != waiting_landmarks_.end())
    all = known->second;
  if (all.views.empty() || all.views.back().pose != graph_.newest_id())
    all.views.push_back({.pose = graph_.newest_id(), .factors = {}});
  std::vector<Measured>& factors = all.views.back().factors;
  factors.insert(factors.end(), seen.factors.begin(), seen.factors.end());
  return all;
}

/// What the triangulation of a landmark needs of each of some of its views, these numbers.
std::vector<PlacedView> CompactPose::placed_views(const WaitingLandmark& waiting,
                                                  std::span<const std::size_t> chosen) const {
  const RigidGroup& group = graph_.group();
  const auto state = [&](const View& view) -> const State& {
    const int pose = graph_.find(view.pose);
    return pose < 0 ? graph_.newest_state() : graph_.state(pose);
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

/// Where views of which the last is the newest pose's put their landmark, and which of them say so.
std::optional<CompactPose::Triangulated> CompactPose::triangulated(const WaitingLandmark& waiting) {
  const std::vector<std::size_t> all = chosen_of(waiting.views.size());
  std::vector<int> poses;
  for (const std::size_t k : all) {
    const Id pose = waiting.views[k].pose;
    if (pose != graph_.newest_id()) poses.push_back(graph_.find(pose));
  }
  const Eigen::MatrixXd covariance = graph_.joint_covariance(poses, report_.seconds);
  const Eigen::Index n = graph_.group().tangent_size();
  const auto of = [&](std::span<const std::size_t> places) -> std::optional<Triangulated> {
    Triangulated some{.chosen = {}, .found = {}};
    std::vector<Eigen::Index> rows;
    for (const std::size_t place : places) {
      some.chosen.push_back(all[place]);
      for (Eigen::Index r = 0; r < n; ++r) rows.push_back(n * static_cast<Eigen::Index>(place) + r);
    }
    std::optional<Triangulation> found =
        triangulate(*waiting.landmark.type, placed_views(waiting, some.chosen),
                    Eigen::MatrixXd(covariance(rows, rows)), options_.trust);
    if (!found) return std::nullopt;
    some.found = std::move(*found);
    return some;
  };
  std::vector<std::size_t> places(all.size());
  std::iota(places.begin(), places.end(), std::size_t{0});
  std::optional<Triangulated> found = of(places);
  if (!check_->on() || (found && agree(*found))) return found;
  if (std::optional<Triangulated> consensus = consensus_of(places, of)) return consensus;
  return found;
}

/// Whether views agree, of which there are more than their landmark needs: any others do.
bool CompactPose::agree(const Triangulated& some) const {
  return some.found.fit.dof > 0 && fits(some);
}

/// The largest set of views that agree without one or two of all, and are more than half of them:
/// the best of these. Nothing: there is none.
std::optional<CompactPose::Triangulated> CompactPose::consensus_of(
    std::span<const std::size_t> places,
    const std::function<std::optional<Triangulated>(std::span<const std::size_t>)>& of) const {
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

/// Adds a landmark with the views that put it there, and judges the others.
void CompactPose::add_triangulated(WaitingLandmark waiting, Triangulated triangulated) {
  const Id id = waiting.landmark.id;
  waiting.landmark.state = std::move(triangulated.found.state);
  std::vector<Factor> factors;
  for (const std::size_t k : triangulated.chosen) {
    View& view = waiting.views[k];
    report_.landmarks.push_back({.pose = view.pose,
                                 .landmark = id,
                                 .factors = static_cast<int>(std::ssize(view.factors)),
                                 .added = k == 0,
                                 .gain = triangulated.found.fit.gain,
                                 .innovation = triangulated.found.fit.innovation,
                                 .verdict = LinkVerdict::linked});
    for (const Measured& factor : view.factors) factors.push_back(factor.factor());
    view.factors.clear();
  }
  std::erase_if(waiting.views, [](const View& view) { return view.factors.empty(); });
  if (check_->on()) agreement_[id].used = static_cast<int>(std::ssize(triangulated.chosen));
  waiting_landmarks_.erase(id);
  see({waiting.landmark}, factors);
  judge_views(id, waiting.views);
}

/// A landmark is in the graph, by what the newest pose alone measured of it.
void CompactPose::settle_landmark(Id landmark) {
  if (!graph_.landmark(landmark)) return;  // it has left at once, and waits with all of its views
  const auto known = waiting_landmarks_.find(landmark);
  if (known == waiting_landmarks_.end()) return;
  const std::vector<View> views = std::move(known->second.views);
  waiting_landmarks_.erase(known);
  judge_views(landmark, views);
}

/// Of a landmark that is in the graph now: what poses that are kept measured of it before.
void CompactPose::judge_views(Id landmark, std::span<const View> views) {
  for (const View& view : views) {
    const VariableType* type = graph_.landmark(landmark);
    if (!type) {  // it has left again
      wait_again(landmark, view);
      continue;
    }
    const std::vector<int> size{type->tangent_size()};
    const int pose = graph_.find(view.pose);
    std::vector<ObservationRows> rows;
    const auto linear_model = [&] {
      return linearized(view.factors, view.pose, graph_.state(pose).data(),
                        graph_.landmark_state(landmark).data());
    };
    Eigen::MatrixXd covariance = graph_.landmark_covariance(landmark, pose, report_.seconds);
    rows.push_back(linear_model());  // at the estimate that the covariance is of
    const PlacedState x = graph_.group().place(graph_.state(pose));
    const ObservationFit fit =
        choose_observations(rows, size, std::move(covariance), landmark_gain_,
                            may_use([&](std::size_t, const Eigen::MatrixXd& joint) {
                              return linear(landmark, view.pose, x, view.factors, rows.front(),
                                            joint);
                            }))
            .front();
    report_.landmarks.push_back(report_of(view.pose, landmark, view.factors.size(), fit));
    if (!fit.used) continue;
    std::vector<Factor> factors;
    for (const Measured& factor : view.factors) factors.push_back(factor.factor());
    graph_.add(factors, report_.seconds);
    settle_left_out();
  }
}

/// With what the newest pose measures, landmarks may be determined that were not: if the poses
/// learn enough by that, it is kept. Whether one was added.
bool CompactPose::use_waiting_landmarks() {
  if (graph_.newest_kept()) return false;  // then all that are determined are added
  for (std::size_t k = 0; k < seen_.size(); ++k) {
    const Id id = seen_[k].landmark.id;
    const auto known = waiting_landmarks_.find(id);
    if (graph_.landmark(id) || known == waiting_landmarks_.end() || known->second.views.empty())
      continue;
    WaitingLandmark all = with_newest(seen_[k]);
    std::optional<Triangulated> found = triangulated(all);
    if (!found || !(found->found.fit.gain > landmark_gain_) ||
        !(check_->on() ? agree(*found) : fits(*found)))
      continue;
    seen_.erase(seen_.begin() + static_cast<std::ptrdiff_t>(k));
    add_triangulated(std::move(all), std::move(*found));
    return true;  // the others are added to a pose that is kept
  }
  return false;
}

bool CompactPose::fits(const Triangulated& triangulated) const {
  const MeasuredFit& fit = triangulated.found.fit;
  return check_->passes(fit.innovation, fit.dof);
}

/// Of a landmark that what the newest pose measures does not determine. Whether it is in the graph
/// now.
bool CompactPose::add_or_wait(const Seen& seen) {
  const Id id = seen.landmark.id;
  if (graph_.landmark(id)) {  // by another measurement of the pose
    const View view{.pose = graph_.newest_id(), .factors = seen.factors};
    judge_views(id, {&view, 1});
    return true;
  }
  LandmarkReport report{.pose = report_.id,
                        .landmark = id,
                        .factors = static_cast<int>(std::ssize(seen.factors)),
                        .gain = std::numeric_limits<double>::infinity()};
  if (!may_wait(id) || !graph_.newest_kept()) {
    waiting_landmarks_.try_emplace(id, WaitingLandmark{.landmark = seen.landmark, .views = {}});
    report_.landmarks.push_back(report);
    return false;
  }
  WaitingLandmark all = with_newest(seen);
  std::optional<Triangulated> found = triangulated(all);
  if (found && (check_->on() ? agree(*found) : fits(*found))) {
    add_triangulated(std::move(all), std::move(*found));
    return true;
  }
  report.verdict = LinkVerdict::waiting;
  if (found) report.innovation = found->found.fit.innovation;
  report_.landmarks.push_back(report);
  waiting_landmarks_.insert_or_assign(id, std::move(all));
  limit_waiting(id);
  return false;
}

/// Gives up what waits of the landmark that was not seen for longest, where more than so many wait;
/// and of the newest's views the oldest.
void CompactPose::limit_waiting(Id newest) {
  const auto give_up = [&](Id id, const View& view) {
    report_.landmarks.push_back({.pose = view.pose,
                                 .landmark = id,
                                 .factors = static_cast<int>(std::ssize(view.factors)),
                                 .gain = std::numeric_limits<double>::infinity()});
  };
  std::vector<View>& views = waiting_landmarks_.at(newest).views;
  while (views.size() > kMostWaitingViews) {
    give_up(newest, views.front());
    views.erase(views.begin());
  }
  const auto waits = [](const auto& one) { return !one.second.views.empty(); };
  while (std::ranges::count_if(waiting_landmarks_, waits) > options_.waiting) {
    const auto last_seen = [&](const auto& one) {
      return waits(one) ? graph_.find(one.second.views.back().pose)
                        : std::numeric_limits<int>::max();
    };
    auto& [id, oldest] = *std::ranges::min_element(waiting_landmarks_, {}, last_seen);
    for (const View& view : oldest.views) give_up(id, view);
    oldest.views.clear();
  }
}

void CompactPose::see(std::vector<Variable> added, std::span<const Factor> factors) {
  graph_.see(std::move(added), factors, report_.seconds);
  settle_left_out();
}

/// A landmark, or what was measured of it, has left the graph, since with it there was no
/// covariance.
void CompactPose::settle_left_out() {
  for (const CompactGraph::LeftOut& left : graph_.take_left_out()) {
    const Id id = left.landmark.id;
    if (left.removed) {
      waiting_landmarks_.try_emplace(id, WaitingLandmark{.landmark = left.landmark, .views = {}});
      ++removals_[id];
      agreement_.erase(id);
    }
    for (const auto& [pose, factor] : left.factors) {
      // What a pose measured that leaves with it, or was not kept, is lost.
      const bool waits = left.removed && may_wait(id) && graph_.find(pose) >= 0;
      report_.landmarks.push_back({.pose = pose,
                                   .landmark = id,
                                   .factors = 1,
                                   .removed = true,
                                   .verdict = waits          ? LinkVerdict::waiting
                                              : left.removed ? LinkVerdict::unmatched
                                                             : LinkVerdict::nonlinear});
      if (waits) {
        const Measured measured =
            checked_observation(factor, pose, graph_.group().motions().type(), left.landmark);
        wait_again(id, {.pose = pose, .factors = {measured}});
      }
    }
  }
}

/// Whether what poses measure of a landmark may wait: not of one that has left the graph so often
/// that it will again.
bool CompactPose::may_wait(Id landmark) const {
  const auto removals = removals_.find(landmark);
  return options_.several_views &&
         (removals == removals_.end() || removals->second < kMostRemovals);
}

/// What a pose that is kept measured of a landmark that waits.
void CompactPose::wait_again(Id landmark, const View& view) {
  if (!may_wait(landmark) || graph_.find(view.pose) < 0) return;
  std::vector<View>& views = waiting_landmarks_.at(landmark).views;
  const auto number = [&](Id pose) { return graph_.find(pose); };
  const auto at = std::ranges::lower_bound(views, number(view.pose), {},
                                           [&](const View& other) { return number(other.pose); });
  if (at != views.end() && at->pose == view.pose) {
    at->factors.insert(at->factors.end(), view.factors.begin(), view.factors.end());
  } else {
    views.insert(at, view);
  }
}

bool CompactPose::has_waiting_views(Id pose) const {
  return std::ranges::any_of(waiting_landmarks_, [&](const auto& one) {
    return std::ranges::find(one.second.views, pose, &View::pose) != one.second.views.end();
  });
}

/// What poses that have left measured waits no more.
void CompactPose::forget_views(std::span<const Id> poses) {
  for (auto& [id, waiting] : waiting_landmarks_) {
    for (const Id pose : poses) {
      const auto view = std::ranges::find(waiting.views, pose, &View::pose);
      if (view == waiting.views.end()) continue;
      report_.landmarks.push_back({.pose = pose,
                                   .landmark = id,
                                   .factors = static_cast<int>(std::ssize(view->factors)),
                                   .gain = std::numeric_limits<double>::infinity()});
      waiting.views.erase(view);
    }
  }
}

}  // namespace cairn::compact
