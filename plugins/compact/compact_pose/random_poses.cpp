// SPDX-License-Identifier: BSD-3-Clause
#include "random_poses.hpp"

#include <algorithm>
#include <chrono>
#include <random>
#include <string>
#include <utility>

#include "absolute.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"

namespace cairn::compact {
namespace {

using Clock = std::chrono::steady_clock;

/// The same on every machine, unlike std::shuffle.
template <class T>
void shuffle(std::vector<T>& all, std::mt19937_64& engine) {
  for (std::size_t left = all.size(); left > 1; --left)
    std::swap(all[left - 1], all[engine() % left]);
}

/// The pairs (earlier, later) that a recording has loop closures of, each once.
std::vector<std::pair<Id, Id>> linked_pairs(const Graph& recording,
                                            std::span<const Arrival> poses) {
  std::set<std::pair<Id, Id>> pairs;
  for (const Arrival& pose : poses) {
    for (const int f : pose.links) {
      Id earlier = recording.id(pose.pose());
      for (const std::int32_t v : recording.factor_variables(f))
        earlier = std::min(earlier, recording.id(v));
      pairs.emplace(earlier, recording.id(pose.pose()));
    }
  }
  return {pairs.begin(), pairs.end()};
}

}  // namespace

RandomPoses::RandomPoses(std::unique_ptr<Estimator> estimator, const RandomPosesOptions& options)
    : options_(options), graph_(std::move(estimator), CompositionOrder::first) {}

void RandomPoses::expect(const Graph& recording, std::span<const Arrival> poses) {
  kept_.clear();
  linked_.clear();
  if (poses.empty()) return;
  kept_ = {recording.id(poses.front().pose()), recording.id(poses.back().pose())};
  std::vector<Pair> pairs = linked_pairs(recording, poses);
  std::erase_if(pairs, [](const Pair& pair) { return pair.first == pair.second; });
  std::vector<Id> all;
  for (const Arrival& pose : poses) all.push_back(recording.id(pose.pose()));
  if (options_.draw == Draw::loops) {
    draw_loops_first(std::move(pairs), std::move(all));
  } else {
    draw_poses_first(std::move(pairs), std::move(all));
  }
}

void RandomPoses::draw_loops_first(std::vector<Pair> pairs, std::vector<Id> poses) {
  std::mt19937_64 engine(options_.seed);
  shuffle(pairs, engine);
  int loops = 0;
  const auto room = static_cast<std::size_t>(options_.poses);
  const auto draw = [&](bool with_new_poses) {
    for (Pair& pair : pairs) {
      const std::size_t more =
          (kept_.contains(pair.first) ? 0u : 1u) + (kept_.contains(pair.second) ? 0u : 1u);
      if (loops == options_.loops || pair.first == pair.second) continue;
      if (more > 0 && (!with_new_poses || kept_.size() + more > room)) continue;
      kept_.insert({pair.first, pair.second});
      linked_[pair.second].push_back(pair.first);
      pair.second = pair.first;  // drawn
      ++loops;
    }
  };
  draw(/*with_new_poses=*/true);
  shuffle(poses, engine);
  for (const Id id : poses) {
    if (kept_.size() < room) kept_.insert(id);
  }
  draw(/*with_new_poses=*/false);
}

void RandomPoses::draw_poses_first(std::vector<Pair> pairs, std::vector<Id> poses) {
  std::mt19937_64 engine(options_.seed);
  shuffle(poses, engine);
  const auto room = static_cast<std::size_t>(options_.poses);
  for (const Id id : poses) {
    if (kept_.size() < room) kept_.insert(id);
  }
  std::erase_if(pairs, [&](const Pair& pair) {
    return !kept_.contains(pair.first) || !kept_.contains(pair.second);
  });
  shuffle(pairs, engine);
  const auto most = static_cast<std::size_t>(options_.loops);
  if (pairs.size() > most) pairs.resize(most);
  for (const Pair& pair : pairs) linked_[pair.second].push_back(pair.first);
}

void RandomPoses::add_pose(const Variable& pose, std::span<const Factor> odometry) {
  if (kept_.empty()) {
    throw Error(ErrorCode::usage,
                "random_poses draws from a recording; it cannot follow a robot live");
  }
  if (!graph_.empty() && (graph_.kept().find(pose.id) >= 0 || pose.id == graph_.newest().id())) {
    throw Error(ErrorCode::input, "pose " + std::to_string(pose.id) + " is there already");
  }
  report_ = {};
  report_.id = pose.id;
  const auto begin = Clock::now();
  if (graph_.empty()) {
    graph_.start(pose, report_.seconds);
  } else {
    const Motion motion = graph_.group().fuse(odometry, graph_.newest().id(), pose.id);
    graph_.advance(pose, motion, odometry.front().type);
    if (kept_.contains(pose.id) || pose.fixed) graph_.keep(report_.seconds);
  }
  report_.seconds.total = seconds_since(begin);
  const auto planned = linked_.find(pose.id);
  to_match_ = planned == linked_.end() ? std::vector<Id>() : planned->second;
}

std::optional<MatchProposal> RandomPoses::next_match() {
  if (to_match_.empty()) return std::nullopt;
  return MatchProposal{
      .earlier = to_match_.back(), .later = report_.id, .gain = 0.0, .expected = {}};
}

LinkReport RandomPoses::offer(Id other, std::span<const Factor> measured) {
  if (graph_.empty() || graph_.kept().find(other) < 0 || other == graph_.newest().id()) {
    throw Error(ErrorCode::input,
                "pose " + std::to_string(other) + " is not another pose of the compact graph");
  }
  std::erase(to_match_, other);
  LinkReport link{.earlier = other, .later = report_.id};
  if (!measured.empty()) {
    const auto begin = Clock::now();
    graph_.link(measured, report_.seconds);
    report_.seconds.total += seconds_since(begin);
    link.verdict = LinkVerdict::linked;
    report_.closed_loop = true;
  }
  report_.links.push_back(link);
  return link;
}

PriorReport RandomPoses::offer_prior(const Factor& measured) {
  PriorReport prior{.pose = report_.id};
  if (graph_.newest().kept && graph_.referenced()) {
    graph_.link({&measured, 1}, report_.seconds);
    prior.verdict = LinkVerdict::linked;
  } else if (graph_.newest().kept) {
    const State& x = graph_.newest().state();
    const AbsoluteMeasurement first(measured, report_.id, graph_.group().motions().type());
    const FrameEstimate frame(graph_.group(), {{&first, x}}, x,
                              graph_.joint_covariance({}, report_.seconds).replicate(2, 2));
    if (frame.determined()) {
      graph_.refer(frame.best_move(), {&measured, 1}, report_.seconds);
      prior.verdict = LinkVerdict::linked;
    }
  }
  report_.priors.push_back(prior);
  return prior;
}

PoseReport RandomPoses::end_pose() {
  report_.kept = graph_.newest().kept;
  return report_;
}

bool RandomPoses::finish() {
  if (graph_.empty()) return true;
  if (!graph_.newest().kept) graph_.keep(report_.seconds);
  return graph_.solve_fully();
}

std::vector<double> RandomPoses::newest_state() const {
  if (graph_.empty()) throw Error(ErrorCode::usage, "newest_state before the first pose");
  const auto state = graph_.group().view(graph_.newest().state());
  return {state.begin(), state.end()};
}

}  // namespace cairn::compact
