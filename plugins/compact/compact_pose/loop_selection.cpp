// SPDX-License-Identifier: BSD-3-Clause
#include "loop_selection.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include <fmt/core.h>

#include "relocation.hpp"

namespace cairn::compact {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Links that wait: older ones are given up when there are more.
constexpr std::size_t kMostWaiting = 32;
/// Refused matches that are remembered, and of how many other poses some have to agree with one of
/// them to doubt odometry.
constexpr std::size_t kMostRefused = 32;
constexpr std::size_t kAgreeing = 3;

}  // namespace

void LoopSelection::begin(const RigidGroup& group, const Gains& gains, Matrix sensor) {
  loop_gain_ = gains.loop;
  pose_gain_ = gains.pose;
  search_.begin(group, gains.loop, std::move(sensor));
  check_.emplace(group, options_.sensor_range(), Gate{options_.gate}, options_.trust);
}

void LoopSelection::advance(const Motion& motion, const RigidGroup& group) {
  search_.advance(to_matrix(motion.covariance, group.tangent_size()),
                  group.place(group.state(motion.mean)).at.t.norm());
  follow_refused(motion, group);
}

LinkReport LoopSelection::judge(int pose, std::span<const Factor> measured, const Motion& motion,
                                CompactGraph& graph, PoseReport& report) {
  search_.search(graph, matches_, report);
  LinkReport outcome{.earlier = graph.kept().id(pose), .later = graph.newest().id()};
  const std::optional<Candidate> candidate = search_.take(pose);
  if (candidate) outcome.expected_gain = candidate->gain;
  matches_.note_answer(pose, !measured.empty());
  if (!measured.empty()) {
    Link link{.earlier = pose,
              .later = graph.newest().kept ? graph.kept().size() - 1 : graph.kept().size(),
              .factors = {measured.begin(), measured.end()},
              .motion = motion,
              .mean = graph.group().state(motion.mean),
              .covariance = to_matrix(motion.covariance, graph.group().tangent_size())};
    matches_.note_measured(link.covariance);
    outcome.verdict = verdict(link, outcome, graph, report);
    search_.note_verdict(pose, outcome.verdict);
    if (outcome.verdict == LinkVerdict::linked) {
      graph.make_permanent(pose);
      matches_.note_used(outcome.earlier, outcome.later, link.covariance, outcome.gain,
                         candidate && watches() ? &search_.dimensions(*candidate) : nullptr);
      use(link, graph, report);
    } else if (outcome.verdict == LinkVerdict::waiting) {
      graph.make_permanent(pose);
      wait(std::move(link), outcome, graph, report);
    }
  }
  report.links.push_back(outcome);
  if (outcome.verdict == LinkVerdict::linked) judge_waiting(graph, report);
  return outcome;
}

/// Lines 22 and 23 of Algorithm 1, and whether the link fits.
LinkVerdict LoopSelection::verdict(const Link& link, LinkReport& outcome, CompactGraph& graph,
                                   PoseReport& report) {
  if (!graph.connected(link.earlier, link.later)) {  // nothing is known that it could contradict
    outcome.gain = kInfinity;
    return check_->on() && !agrees_with_waiting(link, graph, report) ? LinkVerdict::waiting
                                                                     : LinkVerdict::linked;
  }
  const Displacement d = search_.displacement(link.earlier, graph, report);
  outcome.gain = mutual_information(link.covariance, d.covariance);
  const Fit fit = check_->fit(link, d);
  outcome.innovation = fit.innovation;
  if (!(outcome.gain > loop_gain_)) return LinkVerdict::uninformative;
  if (!fit.consistent) {
    return doubts_odometry(link, d, graph, report) ? LinkVerdict::linked
                                                   : LinkVerdict::inconsistent;
  }
  if (check_->needs_another(fit) && !agrees_with_waiting(link, graph, report))
    return LinkVerdict::waiting;
  return LinkVerdict::linked;
}

void LoopSelection::wait(Link link, const LinkReport& outcome, CompactGraph& graph,
                         PoseReport& report) {
  graph.keep(report.seconds);
  matches_.note_used(outcome.earlier, outcome.later, link.covariance, outcome.gain, nullptr);
  search_.look_wide_again();  // what agrees with it may be seen from the next pose
  waiting_.push_back({std::move(link), outcome});
  if (waiting_.size() > kMostWaiting) {  // nothing has agreed with it for so long
    waiting_.front().report.verdict = LinkVerdict::inconsistent;
    report.links.push_back(waiting_.front().report);
    waiting_.erase(waiting_.begin());
  }
}

void LoopSelection::follow_refused(const Motion& motion, const RigidGroup& group) {
  const State step = group.state(motion.mean);
  const Matrix A = group.adjoint(group.inverse(step));
  for (Refused& refused : refused_) {
    refused.since.mean = group.compose(refused.since.mean, step);
    refused.since.covariance = A * refused.since.covariance * A.transpose() + search_.odometry();
  }
}

/// Of a link that the gate refuses. Where three of other poses that it has refused before agree
/// with it, each closing a cycle with the odometry between their ends, it is the estimate that is
/// wrong: odometry is less certain than its covariances say, as where a wheel's radius is. False
/// matches that agree so with each other are one place that looks like another.
bool LoopSelection::doubts_odometry(const Link& link, const Displacement& expected,
                                    CompactGraph& graph, PoseReport& report) {
  const Id earlier = graph.kept().id(link.earlier);
  std::set<Id> agree;
  for (const Refused& other : refused_) {
    const int pose = graph.kept().find(other.earlier);
    if (pose < 0 || other.later == graph.newest().id()) continue;
    const Fit fit =
        check_->agreement(other.link, link, graph.between(pose, link.earlier), other.since);
    if (fit.consistent && !check_->needs_another(fit)) agree.insert(other.later);
  }
  if (agree.size() < kAgreeing || !check_->on()) {
    Refused refused{earlier, graph.newest().id(), link, expected};
    refused.since.mean = graph.group().between(link.mean, link.mean);
    refused.since.covariance.setZero();
    refused_.push_back(std::move(refused));
    if (refused_.size() > kMostRefused) refused_.pop_front();
    return false;
  }
  const double loose = check_->loosen_for(link, expected);
  if (!check_->fit(link, expected).consistent) return false;
  report.notes.push_back(fmt::format(
      "matches of {} poses that the gate refused agree with that of poses {} and {}: odometry is "
      "less certain than its covariances say, and the gate takes standard deviations as {:.3g} "
      "times larger from now on",
      agree.size(), earlier, graph.newest().id(), std::sqrt(loose)));
  refused_.clear();
  return true;
}

bool LoopSelection::agrees_with_waiting(const Link& link, CompactGraph& graph, PoseReport& report) {
  return std::ranges::any_of(waiting_, [&](const Waiting& waiting) {
    const Link& other = waiting.link;
    const bool kept = link.later < graph.kept().size();
    if (other.earlier == link.earlier && other.later == link.later) return false;
    if (!graph.connected(other.earlier, link.earlier)) return false;
    // Before it is kept, the newest pose is known by its displacement only.
    const Displacement later = kept ? graph.between(other.later, link.later)
                                    : search_.displacement(other.later, graph, report);
    const Fit fit =
        check_->agreement(other, link, graph.between(other.earlier, link.earlier), later);
    return fit.consistent && !check_->needs_another(fit);
  });
}

/// The part of the match that ends the way, if the newest pose is to be relocated by this link.
///
/// Relocating divides the measurement between two ways. That must leave little between the two
/// poses that is worth a pose of its own, measured by what a match is worth here, whatever the
/// options expect; and must cost little of what is known of the way that ends here: where loop
/// closures are not better than odometry, the loss would add up. The more poses are kept nearby,
/// the less each way matters, and the more is gained by not keeping another.
std::optional<double> LoopSelection::relocation(const Link& link, const CompactGraph& graph,
                                                const PoseReport& report) const {
  // Where another pose would have to leave, information is lost in any case.
  if (!options_.reuse && !graph.full()) return std::nullopt;
  if (!(pose_gain_ > 0.0)) return std::nullopt;  // every pose is to be kept
  const int n = graph.group().tangent_size();
  const Matrix way = to_matrix(graph.newest().odometry.covariance, n);
  const double of_way = part_of_way(way, link.covariance);
  const Matrix rest = link.covariance / (1.0 - of_way);
  // Three matches in one are as good as any; a lower g_pose must not keep poses of one place for
  // ever.
  const double enough = std::max(pose_gain_, 0.5 * n * std::log(4.0));
  if (!(mutual_information(matches_.typical().covariance(), rest) < enough)) return std::nullopt;
  // Where the bridge is not informative, nothing is divided.
  if (graph.full()) return of_way;
  const double lost = mutual_information(way + link.covariance, link.covariance);
  if (lost > options_.reuse_loss * report.candidates * n) return std::nullopt;
  return of_way;
}

void LoopSelection::use(const Link& link, CompactGraph& graph, PoseReport& report) {
  const bool of_newest = link.later == graph.kept().size() && !graph.newest().kept;
  if (!graph.connected(link.earlier, link.later)) {
    graph.locate(link.earlier, link.mean, link.factors, report.seconds);
    search_.restart(report);  // the poses of the map are candidates from now on
  } else if (const std::optional<double> of_way =
                 of_newest ? relocation(link, graph, report) : std::nullopt) {
    graph.relocate(link.earlier, link.motion, *of_way, loop_gain_, report.seconds);
  } else {
    graph.link(link.factors, report.seconds);
  }
  report.closed_loop = true;
}

/// What becomes of a link that waits: it fits closely now, or not at all. Nothing: it waits on.
std::optional<LinkVerdict> LoopSelection::verdict_now(Waiting& old, CompactGraph& graph) {
  if (!graph.connected(old.link.earlier, old.link.later)) return std::nullopt;
  const Displacement d = graph.between(old.link.earlier, old.link.later);
  const Fit fit = check_->fit(old.link, d);
  old.report.innovation = fit.innovation;
  old.report.gain = mutual_information(old.link.covariance, d.covariance);
  if (!fit.consistent) return LinkVerdict::inconsistent;
  if (check_->needs_another(fit)) return std::nullopt;
  return old.report.gain > loop_gain_ ? LinkVerdict::linked : LinkVerdict::uninformative;
}

/// After a link was used, what waits is looked at again.
void LoopSelection::judge_waiting(CompactGraph& graph, PoseReport& report) {
  for (std::size_t k = 0; k < waiting_.size();) {
    const std::optional<LinkVerdict> verdict = verdict_now(waiting_[k], graph);
    if (!verdict) {
      ++k;
      continue;
    }
    waiting_[k].report.verdict = *verdict;
    if (verdict == LinkVerdict::linked) use(waiting_[k].link, graph, report);
    report.links.push_back(waiting_[k].report);
    waiting_.erase(waiting_.begin() + static_cast<std::ptrdiff_t>(k));
    k = 0;
  }
}

bool LoopSelection::forget(Id a, Id b, bool was_there, const CompactGraph& graph) {
  const auto waits = [&](const Waiting& waiting) {
    return std::minmax(waiting.report.earlier, waiting.report.later) == std::minmax(a, b);
  };
  if (std::erase_if(waiting_, waits) == 0 && !was_there) return false;
  matches_.forget(a, b, graph);
  return true;
}

void LoopSelection::end_pose(CompactGraph& graph, PoseReport& report) {
  search_.search(graph, matches_, report);
  if (search_.silenced(graph, report)) matches_.note_silence();
  if (graph.newest().predecessor >= 0 && report.candidates > 0 && watches())
    matches_.thresholds().note_pose(report.least_gain);
  for (const Candidate& left : search_.left())
    report.most_gain = std::max(report.most_gain, left.gain);
}

std::vector<int> LoopSelection::held() const {
  std::vector<int> poses;
  for (const Waiting& waiting : waiting_)
    poses.insert(poses.end(), {waiting.link.earlier, waiting.link.later});
  return poses;
}

void LoopSelection::renumber(std::span<const int> now) {
  matches_.renumber(now);
  for (Waiting& waiting : waiting_) {
    waiting.link.earlier = now[waiting.link.earlier];
    waiting.link.later = now[waiting.link.later];
  }
}

}  // namespace cairn::compact
