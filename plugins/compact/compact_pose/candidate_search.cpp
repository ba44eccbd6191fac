// SPDX-License-Identifier: BSD-3-Clause
#include "candidate_search.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"

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

/// Whether the newest pose was matched with this one already, for where it is searched again.
bool answered(int pose, const CompactGraph& graph, const PoseReport& report) {
  return std::ranges::any_of(report.links, [&](const LinkReport& link) {
    return link.later == report.id && link.earlier == graph.kept().id(pose);
  });
}

}  // namespace

void CandidateSearch::expect(const Graph& recording, std::span<const Arrival> poses) {
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

void CandidateSearch::check_recording() const {
  if (options_.search != Search::recorded || recorded_) return;
  throw Error(ErrorCode::usage,
              "compact_pose: search=recorded is for a recording, whose measurements are known "
              "before: give search=index");
}

void CandidateSearch::begin(const RigidGroup& group, double least_gain, Matrix sensor) {
  const SensorRange range = options_.sensor_range();
  test_.emplace(group, range);
  radius_ = options_.search == Search::index ? range.radius(group.dimension()) : kInfinity;
  least_gain_ = least_gain;
  sensor_ = std::move(sensor);
}

void CandidateSearch::advance(Matrix odometry, double distance) {
  odometry_ = std::move(odometry);
  driven_ += distance;
}

void CandidateSearch::restart(PoseReport& report) {
  newest_ = {.answered = newest_.answered, .proposed = newest_.proposed};
  report.candidates = 0;
  report.least_gain = kInfinity;
}

void CandidateSearch::note_verdict(int pose, LinkVerdict verdict) {
  if (verdict == LinkVerdict::linked) newest_.in_vain = 0;
  const bool in_vain = verdict == LinkVerdict::inconsistent || verdict == LinkVerdict::waiting;
  if (pose == newest_.proposed && in_vain) ++newest_.in_vain;
}

void CandidateSearch::look_wide_again() { driven_ = kInfinity; }

/// So many matches that were proposed for the newest pose led to no link that others will hardly do
/// so. Never where all loop closures are wanted, or a recording has them all.
bool CandidateSearch::gives_up() const {
  return options_.attempts > 0 && newest_.in_vain >= options_.attempts &&
         options_.strategy != Strategy::apal && options_.search != Search::recorded;
}

/// What `Search::untested` comes to where only these match, without the square of the number of
/// poses. The pose before is among them: the newest depends on all others by its odometry from
/// there alone, so that no other has a smaller information gain (Σ_in ⪰ Σ of that odometry).
std::vector<int> CandidateSearch::recorded_pairs(const CompactGraph& graph) const {
  std::vector<int> poses{graph.newest().predecessor};
  if (const auto others = recorded_->find(graph.newest().id()); others != recorded_->end()) {
    for (const Id other : others->second) {
      if (const int pose = graph.kept().find(other); pose >= 0) poses.push_back(pose);
    }
  }
  std::ranges::sort(poses);
  poses.erase(std::unique(poses.begin(), poses.end()), poses.end());
  return poses;
}

/// After a link everything is to be computed anew, and mostly for one pose only: the best of what
/// is left, which is then used or tells too little for all others. If it is not so, all that are
/// left are solved for together.
Displacement CandidateSearch::displacement(int pose, CompactGraph& graph, PoseReport& report) {
  if (!graph.prepared(pose)) {
    std::vector<int> poses{pose};
    if (asked_version_ == graph.version()) {
      for (const Candidate& other : newest_.candidates) {
        if (other.gain > least_gain_) poses.push_back(other.pose);
      }
    }
    asked_version_ = graph.version();
    graph.prepare(poses, report.seconds);
  } else {
    graph.prepare({&pose, 1}, report.seconds);
  }
  return graph.displacement(pose);
}

bool CandidateSearch::silenced(CompactGraph& graph, PoseReport& report) {
  if (sensor_.size() > 0 || newest_.answered > 0 || newest_.candidates.empty()) return false;
  const Candidate& best = *std::ranges::max_element(newest_.candidates, {}, &Candidate::gain);
  return best.gain <= least_gain_ &&
         mutual_information(odometry_, displacement(best.pose, graph, report).covariance) >
             least_gain_;
}

/// Where requests are limited, some of them in vain, the gain that is to be expected of one; it
/// only falls with other links, as the gain does.
double CandidateSearch::worth(int pose, double gain, const MatchStatistics& matches) const {
  return options_.matches > 0 ? gain * matches.probability(pose) : gain;
}

/// The poses that are near enough, or recorded, with what their covariances take solved for.
std::vector<int> CandidateSearch::possible(CompactGraph& graph, PoseReport& report) {
  const bool recorded = options_.search == Search::recorded;
  const std::vector<int> near = recorded ? recorded_pairs(graph) : graph.near(radius_);
  std::vector<int> possible;
  for (const int pose : near) {
    if (options_.search == Search::index &&
        !test_->possible(RigidGroup::seen_from(graph.kept().placed(pose), graph.newest().placed)))
      continue;
    possible.push_back(pose);
  }
  if (!recorded && !std::ranges::all_of(possible, [&](int pose) { return graph.prepared(pose); })) {
    // Where nothing has changed for more than one pose, those that the next will need as well.
    if (solved_version_ == graph.version())
      graph.prepare(graph.near(kAhead * radius_), report.seconds);
    solved_version_ = graph.version();
  }
  graph.prepare(possible, report.seconds);
  report.near = static_cast<int>(std::ssize(near));
  return possible;
}

void CandidateSearch::add(int pose, double gain, const Dimensions& dimensions,
                          const MatchStatistics& matches, const CompactGraph& graph) {
  newest_.candidates.push_back({pose, graph.version(), gain, worth(pose, gain, matches),
                                static_cast<int>(std::ssize(newest_.dimensions))});
  newest_.dimensions.push_back(dimensions);
}

void CandidateSearch::search(CompactGraph& graph, const MatchStatistics& matches,
                             PoseReport& report) {
  if (std::exchange(newest_.searched, true) || graph.newest().predecessor < 0) return;
  const Timed timed(report.seconds.search);
  const double solving = report.seconds.covariances;
  const std::vector<int> poses = possible(graph, report);
  // What the options do not say is learnt; the first match is expected to be like odometry.
  const TypicalMatch& typical = matches.typical();
  expected_ = sensor_.size() > 0 ? sensor_ : typical.known() ? typical.covariance() : odometry_;
  for (const int pose : poses) {
    const Displacement d = graph.displacement(pose);
    const Dimensions dimensions = test_->dimensions(d);
    if (tested() && !test_->passes(dimensions)) continue;
    const double gain = mutual_information(expected_, d.covariance);
    ++report.candidates;
    report.least_gain = std::min(report.least_gain, gain);
    if (pose != graph.newest().predecessor && !answered(pose, graph, report))
      add(pose, gain, dimensions, matches, graph);
  }
  if (looks_wide(graph, report)) search_wide(graph, matches, report);
  report.seconds.search -= report.seconds.covariances - solving;
  // One that may leave is matched only where no other can be.
  std::vector<Candidate>& all = newest_.candidates;
  const auto lasts = [&](const Candidate& one) { return !graph.temporary(one.pose); };
  if (std::ranges::any_of(all, lasts)) std::erase_if(all, std::not_fn(lasts));
  std::ranges::make_heap(all, kByWorth);
}

/// Whether the newest pose is so uncertain that equation 18 excludes poses that it may well see,
/// and has moved since they were tested last.
bool CandidateSearch::looks_wide(CompactGraph& graph, PoseReport& report) {
  const SensorRange& range = test_->range();
  if (!tested() || !options_.wide || range.probability <= 0.0) return false;
  const RigidGroup& group = graph.group();
  const int n = group.dimension();
  const auto [smallest, largest] =
      std::minmax_element(range.translation.begin(), range.translation.begin() + n);
  if (driven_ < kEvery * *largest) return false;
  const Eigen::Matrix<double, 6, 6> S =
      group.twist_covariance(graph.newest_covariance(report.seconds));
  const double deviation = range.noise_scale * std::sqrt(S.diagonal().head(n).maxCoeff());
  return deviation > kUncertain * *smallest;
}

/// Proposes besides the kept poses that are as probably within range, beside a displacement of mean
/// zero, as others must be at all. They are no reason to keep a pose, or to relocate it.
void CandidateSearch::search_wide(CompactGraph& graph, const MatchStatistics& matches,
                                  PoseReport& report) {
  driven_ = 0.0;
  const std::vector<int> all = graph.near(kInfinity);
  graph.prepare(all, report.seconds);
  const std::size_t first = newest_.candidates.size();
  std::vector<std::pair<double, Candidate>> found;
  for (const int pose : all) {
    if (pose == graph.newest().predecessor || answered(pose, graph, report)) continue;
    const Displacement d = graph.displacement(pose);
    const Dimensions dimensions = test_->dimensions(d);
    if (test_->passes(dimensions)) continue;
    const std::optional<double> probability = test_->relative_probability(dimensions);
    if (!probability) continue;
    add(pose, mutual_information(expected_, d.covariance), dimensions, matches, graph);
    found.emplace_back(*probability, newest_.candidates.back());
  }
  newest_.candidates.resize(first);
  const auto more_probable = [](const auto& a, const auto& b) { return a.first > b.first; };
  std::ranges::stable_sort(found, more_probable);
  if (found.size() > kMostWide) found.resize(kMostWide);
  for (const auto& [probability, candidate] : found) newest_.candidates.push_back(candidate);
}

std::optional<MatchProposal> CandidateSearch::next(CompactGraph& graph,
                                                   const MatchStatistics& matches,
                                                   PoseReport& report) {
  search(graph, matches, report);
  if (options_.matches > 0 && newest_.answered >= options_.matches) return std::nullopt;
  if (gives_up()) return std::nullopt;
  std::vector<Candidate>& candidates = newest_.candidates;
  while (!candidates.empty()) {
    Candidate& best = candidates.front();
    if (!(best.gain > least_gain_)) {
      if (options_.matches == 0) break;
      std::ranges::pop_heap(candidates, kByWorth);  // one that is worth less may gain more
      candidates.pop_back();
      continue;
    }
    if (best.version == graph.version()) {
      const Displacement d = displacement(best.pose, graph, report);
      const auto mean = graph.group().view(d.mean);
      newest_.proposed = best.pose;
      return MatchProposal{graph.kept().id(best.pose),
                           graph.newest().id(),
                           best.gain,
                           {{mean.begin(), mean.end()},
                            {d.covariance.data(), d.covariance.data() + d.covariance.size()}}};
    }
    std::ranges::pop_heap(candidates, kByWorth);
    Candidate& again = candidates.back();
    again.gain = mutual_information(expected_, displacement(again.pose, graph, report).covariance);
    again.worth = worth(again.pose, again.gain, matches);
    again.version = graph.version();
    std::ranges::push_heap(candidates, kByWorth);
  }
  return std::nullopt;
}

/// Mostly it is the first, since that was proposed.
std::optional<Candidate> CandidateSearch::take(int pose) {
  ++newest_.answered;
  std::vector<Candidate>& candidates = newest_.candidates;
  auto place = std::ranges::find(candidates, pose, &Candidate::pose);
  if (place == candidates.end()) return std::nullopt;
  const Candidate candidate = *place;
  if (place == candidates.begin()) {
    std::ranges::pop_heap(candidates, kByWorth);
    candidates.pop_back();
  } else {
    candidates.erase(place);
    std::ranges::make_heap(candidates, kByWorth);
  }
  return candidate;
}

}  // namespace cairn::compact
