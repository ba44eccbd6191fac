// SPDX-License-Identifier: BSD-3-Clause
// Which earlier poses the newest may see, and in which order they are proposed: lines 14 to 17 of
// Algorithm 1.
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"
#include "compact_pose.hpp"

namespace cairn::compact {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Covariances are asked for within so many radii.
constexpr double kAhead = 2.0;
/// From so many ranges on the newest pose is too uncertain for the distance test: one pose in ten
/// that is in reach, its mean off by 1.6 deviations, fails it with s = 0.1, and all from 8 on.
constexpr double kUncertain = 2.0;
/// All kept poses are tested then, each time so many ranges have been driven, or a match waits for
/// another.
constexpr double kEvery = 5.0;
/// So many are proposed besides, the most probable.
constexpr std::size_t kMostWide = 64;

constexpr auto kByWorth = [](const auto& a, const auto& b) {
  return a.worth < b.worth || (a.worth == b.worth && a.pose < b.pose);
};

}  // namespace

void CompactPose::expect(const Graph& recording, std::span<const Arrival> poses) {
  if (options_.search != Search::recorded) return;
  recorded_.emplace();
  for (const Arrival& arrival : poses) {
    const Id pose = recording.id(arrival.pose());
    for (const int f : arrival.links) {
      for (const int v : recording.factor_variables(f)) {
        if (recording.id(v) != pose) (*recorded_)[pose].push_back(recording.id(v));
      }
    }
  }
}

/// What `Search::untested` comes to where only these match, without the square of the number of
/// poses. The pose before is among them: the newest depends on all others by its odometry from
/// there alone, so that no other has a smaller information gain (Σ_in ⪰ Σ of that odometry).
std::vector<int> CompactPose::recorded_pairs() const {
  std::vector<int> poses{graph_.predecessor()};
  if (const auto others = recorded_->find(graph_.newest_id()); others != recorded_->end()) {
    for (const Id other : others->second) {
      if (const int pose = graph_.find(other); pose >= 0) poses.push_back(pose);
    }
  }
  std::ranges::sort(poses);
  poses.erase(std::unique(poses.begin(), poses.end()), poses.end());
  return poses;
}

/// Σ̄_y of this pose. What the options do not say is learnt; the first match is expected to be like
/// odometry.
void CompactPose::expect_matches() {
  if (sensor_.size() > 0) {
    expected_ = sensor_;
  } else {
    expected_ = typical_.known() ? typical_.covariance() : odometry_;
  }
}

/// After a link everything is to be computed anew, and mostly for one pose only: the best of what
/// is left, which is then used or tells too little for all others. If it is not so, all that are
/// left are solved for together.
Displacement CompactPose::known_displacement(int pose) {
  if (!graph_.prepared(pose)) {
    std::vector<int> poses{pose};
    if (asked_version_ == graph_.version()) {
      for (const Candidate& other : candidates_) {
        if (other.gain > loop_gain_) poses.push_back(other.pose);
      }
    }
    asked_version_ = graph_.version();
    graph_.prepare(poses, report_.seconds);
  } else {
    graph_.prepare({&pose, 1}, report_.seconds);
  }
  Displacement d = graph_.displacement(pose);
  graph_.set_covariance(pose, d);
  return d;
}

double CompactPose::expected_gain(int pose) {
  return mutual_information(expected_, known_displacement(pose).covariance);
}

/// Whether no match was asked for only since what is expected of one is poor: one as good as the
/// newest odometry would be informative enough.
bool CompactPose::silenced() {
  if (sensor_.size() > 0 || answered_ > 0 || candidates_.empty()) return false;
  const Candidate& best = *std::ranges::max_element(candidates_, {}, &Candidate::gain);
  return best.gain <= loop_gain_ &&
         mutual_information(odometry_, known_displacement(best.pose).covariance) > loop_gain_;
}

/// Where requests are limited, some of them in vain, the gain that is to be expected of one; it
/// only falls with other links, as the gain does.
double CompactPose::worth(int pose, double gain) const {
  return options_.matches > 0 ? gain * record_.probability(pose) : gain;
}

/// Whether the newest pose was matched with this one already, for where it is searched again.
bool CompactPose::answered(int pose) const {
  return std::ranges::any_of(report_.links, [&](const LinkReport& link) {
    return link.later == report_.id && link.earlier == graph_.id(pose);
  });
}

/// Lines 14 and 15 of Algorithm 1.
void CompactPose::search() {
  searched_ = true;
  if (graph_.predecessor() < 0) return;
  const Timed timed(report_.seconds.search);
  const bool recorded = options_.search == Search::recorded;
  const std::vector<int> near = recorded ? recorded_pairs() : graph_.near(radius_);
  std::vector<int> possible;
  for (const int pose : near) {
    if (options_.search == Search::index && !test_->possible(graph_.newest_seen_from(pose)))
      continue;
    possible.push_back(pose);
  }
  const double solving = report_.seconds.covariances;
  if (!recorded &&
      !std::ranges::all_of(possible, [&](int pose) { return graph_.prepared(pose); })) {
    // Where nothing has changed for more than one pose, those that the next will need as well.
    if (solved_version_ == graph_.version())
      graph_.prepare(graph_.near(kAhead * radius_), report_.seconds);
    solved_version_ = graph_.version();
  }
  graph_.prepare(possible, report_.seconds);
  expect_matches();
  for (const int pose : possible) {
    Displacement d = graph_.displacement(pose);
    graph_.set_covariance(pose, d);
    const Dimensions dimensions = test_->dimensions(d);
    const bool tested = options_.search == Search::index || options_.search == Search::all;
    if (tested && !test_->passes(dimensions)) continue;
    const double gain = mutual_information(expected_, d.covariance);
    ++report_.candidates;
    report_.least_gain = std::min(report_.least_gain, gain);
    if (pose != graph_.predecessor() && !answered(pose)) {
      candidates_.push_back({pose, graph_.version(), gain, worth(pose, gain),
                             static_cast<int>(std::ssize(dimensions_))});
      dimensions_.push_back(dimensions);
    }
  }
  report_.near = static_cast<int>(std::ssize(near));
  if (looks_wide()) search_wide();
  report_.seconds.search -= report_.seconds.covariances - solving;
  // One that may leave is matched only where no other can be.
  const auto lasts = [&](const Candidate& one) { return !graph_.temporary(one.pose); };
  if (std::ranges::any_of(candidates_, lasts)) std::erase_if(candidates_, std::not_fn(lasts));
  std::ranges::make_heap(candidates_, kByWorth);
}

/// Whether the newest pose is so uncertain that equation 18 excludes poses that it may well see,
/// and has moved since they were tested last.
bool CompactPose::looks_wide() {
  const bool tested = options_.search == Search::index || options_.search == Search::all;
  if (!tested || !options_.wide || range_.probability <= 0.0) return false;
  const RigidGroup& group = graph_.group();
  const int n = group.dimension();
  const auto [smallest, largest] =
      std::minmax_element(range_.translation.begin(), range_.translation.begin() + n);
  if (driven_ < kEvery * *largest) return false;
  const Eigen::Matrix<double, 6, 6> S =
      group.twist_covariance(graph_.newest_covariance(report_.seconds));
  const double deviation = range_.noise_scale * std::sqrt(S.diagonal().head(n).maxCoeff());
  return deviation > kUncertain * *smallest;
}

/// Proposes besides the kept poses that are as probably within range, beside a displacement of mean
/// zero, as others must be at all. They are no reason to keep a pose, or to relocate it.
void CompactPose::search_wide() {
  driven_ = 0.0;
  const std::vector<int> all = graph_.near(kInfinity);
  graph_.prepare(all, report_.seconds);
  std::vector<std::pair<double, Candidate>> found;
  for (const int pose : all) {
    if (pose == graph_.predecessor() || answered(pose)) continue;
    Displacement d = graph_.displacement(pose);
    graph_.set_covariance(pose, d);
    const Dimensions dimensions = test_->dimensions(d);
    if (test_->passes(dimensions)) continue;
    const std::optional<double> probability = test_->relative_probability(dimensions);
    if (!probability) continue;
    const double gain = mutual_information(expected_, d.covariance);
    found.push_back({*probability,
                     {pose, graph_.version(), gain, worth(pose, gain),
                      static_cast<int>(std::ssize(dimensions_))}});
    dimensions_.push_back(dimensions);
  }
  const auto more_probable = [](const auto& a, const auto& b) { return a.first > b.first; };
  std::ranges::stable_sort(found, more_probable);
  if (found.size() > kMostWide) found.resize(kMostWide);
  for (const auto& [probability, candidate] : found) candidates_.push_back(candidate);
}

std::optional<MatchProposal> CompactPose::next_match() {
  if (!open_) throw Error(ErrorCode::usage, "next_match without a pose");
  const Timed timed(report_.seconds.total);
  if (!searched_) search();
  if (options_.matches > 0 && answered_ >= options_.matches) return std::nullopt;
  if (gives_up()) return std::nullopt;
  while (!candidates_.empty()) {
    Candidate& best = candidates_.front();
    if (!(best.gain > loop_gain_)) {
      if (options_.matches == 0) break;
      std::ranges::pop_heap(candidates_, kByWorth);  // one that is worth less may gain more
      candidates_.pop_back();
      continue;
    }
    if (best.version == graph_.version()) {
      const Displacement d = known_displacement(best.pose);
      const auto mean = graph_.group().view(d.mean);
      proposed_ = best.pose;
      return MatchProposal{graph_.id(best.pose),
                           graph_.newest_id(),
                           best.gain,
                           {{mean.begin(), mean.end()},
                            {d.covariance.data(), d.covariance.data() + d.covariance.size()}}};
    }
    std::ranges::pop_heap(candidates_, kByWorth);
    Candidate& again = candidates_.back();
    again.gain = expected_gain(again.pose);
    again.worth = worth(again.pose, again.gain);
    again.version = graph_.version();
    std::ranges::push_heap(candidates_, kByWorth);
  }
  return std::nullopt;
}

/// Takes a pose off the list; mostly it is the first, since that was proposed.
std::optional<CompactPose::Candidate> CompactPose::take_candidate(int pose) {
  auto place = std::ranges::find(candidates_, pose, &Candidate::pose);
  if (place == candidates_.end()) return std::nullopt;
  const Candidate candidate = *place;
  if (place == candidates_.begin()) {
    std::ranges::pop_heap(candidates_, kByWorth);
    candidates_.pop_back();
  } else {
    candidates_.erase(place);
    std::ranges::make_heap(candidates_, kByWorth);
  }
  return candidate;
}

}  // namespace cairn::compact
