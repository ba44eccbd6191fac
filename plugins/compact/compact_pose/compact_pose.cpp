// SPDX-License-Identifier: BSD-3-Clause
#include "compact_pose.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <set>
#include <utility>

#include <fmt/core.h>
#include <Eigen/Cholesky>

#include "cairn/graph/id_text.hpp"
#include "cairn/graph/packed.hpp"
#include "cairn/policy/threshold_search.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"

namespace cairn::compact {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Links that wait: older ones are given up when there are more.
constexpr std::size_t kMostWaiting = 32;
/// Refused matches that are remembered, and of how many other poses some have to agree with one of
/// them to doubt odometry.
constexpr std::size_t kMostRefused = 32;
constexpr std::size_t kAgreeing = 3;

/// What a measurement of a landmark must add to be used, and what may be lost where a pose leaves
/// that landmarks locate, by default [nats per DoF of a pose].
constexpr double kLittle = 0.1, kLoss = 0.06;

[[noreturn]] void refuse(const std::string& message) { throw Error(ErrorCode::input, message); }

/// (I + 1)^power − 1 of the gain I of a measurement of n numbers as good as what is known of them,
/// such as odometry between two poses, which is n/2 ln 2: what the thresholds of section 5.2 come
/// to for such data.
double default_gain(int n, double power) {
  return std::pow(0.5 * n * std::log(2.0) + 1.0, power) - 1.0;
}

/// Σ̄_y as the options give it; empty: not given.
Matrix sensor_covariance(const std::vector<double>& numbers, const RigidGroup& group) {
  Matrix S;
  const int n = group.tangent_size();
  const std::size_t given = numbers.size();
  if (given == 2) {
    S = group.isotropic(numbers[0], numbers[1]);
  } else if (given == packed_size(n)) {
    S = unpack(numbers, n);
  } else if (given != 0) {
    throw Error(ErrorCode::usage,
                fmt::format("compact_pose: sensor has {} numbers; expected 2 (standard deviations "
                            "of translation and rotation) or {} (upper triangle of the "
                            "covariance of {})",
                            given, packed_size(n), group.motions().type().tag()));
  }
  if (given != 0 && !(S.allFinite() && Eigen::LLT<Matrix>(S).info() == Eigen::Success))
    throw Error(ErrorCode::usage, "compact_pose: sensor is not a positive definite covariance");
  return S;
}

}  // namespace

CompactPose::CompactPose(std::unique_ptr<Estimator> estimator, CompactPoseOptions options,
                         std::unique_ptr<PoseRemover> remover)
    : options_(std::move(options)),
      remover_(std::move(remover)),
      range_(options_.sensor_range()),
      graph_(std::move(estimator), options_.composition,
             options_.search == Search::recorded ? KeptMarginals::none : KeptMarginals::diagonal) {
  if (options_.keep == 1) {
    throw Error(ErrorCode::usage,
                "compact_pose: keep=1: the first pose and the newest one stay in any case; "
                "expected 2 or more, or 0 for any number");
  }
  if (options_.keep > 0 && options_.strategy != Strategy::fpfl) {
    throw Error(ErrorCode::usage,
                fmt::format("compact_pose: strategy {} keeps all poses, keep={} does not: give one "
                            "(cairn online --keep without a policy sparsifies all poses)",
                            to_string(options_.strategy), options_.keep));
  }
}

void CompactPose::start(const Variable& pose) {
  if (options_.search == Search::recorded && !recorded_) {
    throw Error(ErrorCode::usage,
                "compact_pose: search=recorded is for a recording, whose measurements are known "
                "before: give search=index");
  }
  // Before anything has changed: what the options say fits this type of pose.
  const Matrix sensor = sensor_covariance(options_.sensor, RigidGroup(pose.type));
  graph_.start(pose, report_.seconds);
  sensor_ = sensor;
  const RigidGroup& group = graph_.group();
  const int n = group.tangent_size();
  test_.emplace(group, range_);
  radius_ = options_.search == Search::index ? range_.radius(group.dimension()) : kInfinity;
  check_.emplace(group, range_, options_.gate, options_.trust);
  const auto threshold = [&](bool everything, double chosen, double power) {
    if (everything) return -kInfinity;
    return chosen < 0.0 ? default_gain(n, power) : chosen;
  };
  loop_gain_ = threshold(options_.strategy == Strategy::apal, options_.loop_gain, 1.36);
  pose_gain_ = threshold(options_.strategy != Strategy::fpfl, options_.pose_gain, 1.7);
  prior_gain_ = loop_gain_;
  if (options_.prior_gain >= 0.0 && options_.strategy != Strategy::apal)
    prior_gain_ = options_.prior_gain;
  landmark_gain_ = options_.strategy == Strategy::apal ? -kInfinity
                   : options_.landmark_gain >= 0.0     ? options_.landmark_gain
                                                       : kLittle * n;
  landmark_loss_ = options_.landmark_loss >= 0.0 ? options_.landmark_loss : kLoss * n;
}

void CompactPose::load(const Graph& map) {
  if (!graph_.empty() || graph_.size() > 0)
    throw Error(ErrorCode::usage, "load after the first pose, or a second map");
  graph_.load(map);
}

std::vector<Id> CompactPose::unlocated() const {
  if (graph_.located()) return {};
  std::vector<Id> poses = graph_.kept();
  poses.resize(static_cast<std::size_t>(graph_.map_size()));
  return poses;
}

void CompactPose::add_pose(const Variable& pose, std::span<const Factor> odometry) {
  if (open_) throw Error(ErrorCode::usage, "add_pose before the pose before it was ended");
  PoseReport report;
  report.id = pose.id;
  if (graph_.empty()) {
    if (!odometry.empty())
      refuse(fmt::format("pose {} is the first, and moved from another", id_text(pose.id)));
    if (graph_.size() > 0) check_new(pose);
    std::swap(report_, report);
    start(pose);
  } else {
    check_new(pose);
    if (pose.id == graph_.newest_id())
      refuse(fmt::format("pose {} is there already", id_text(pose.id)));
    if (pose.fixed && !graph_.located()) {
      refuse(fmt::format("pose {} is held, while it is unknown where the trajectory is on the map",
                         pose.id));
    }
    if (odometry.empty())
      refuse(fmt::format("pose {} comes without odometry from pose {}", id_text(pose.id),
                         id_text(graph_.newest_id())));
    const Motion motion = graph_.fuse(odometry, graph_.newest_id(), pose.id);
    std::swap(report_, report);
    const Timed timed(report_.seconds.total);
    odometry_ = to_matrix(motion.covariance, graph_.group().tangent_size());
    driven_ += graph_.group().place(graph_.group().state(motion.mean)).at.t.norm();
    follow_refused(motion);
    graph_.advance(pose, motion, odometry.front().type);
    if (pose.fixed) graph_.keep(report_.seconds);
  }
  open_ = true;
  searched_ = false;
  answered_ = in_vain_ = 0;
  proposed_ = -1;
  candidates_.clear();
  dimensions_.clear();
  seen_.clear();
}

void CompactPose::check_new(const Variable& pose) const {
  if (pose.type->tag() != graph_.group().motions().type().tag()) {
    refuse(fmt::format("pose {} is a {}; the poses before it are {}", id_text(pose.id),
                       pose.type->tag(), graph_.group().motions().type().tag()));
  }
  if (graph_.find(pose.id) >= 0) refuse(fmt::format("pose {} is there already", id_text(pose.id)));
  if (graph_.landmark(pose.id) || waiting_landmarks_.contains(pose.id))
    refuse(fmt::format("pose {} has the id of a landmark", id_text(pose.id)));
}

LinkReport CompactPose::offer(Id other, std::span<const Factor> measured) {
  if (!open_) throw Error(ErrorCode::usage, "offer without a pose");
  const Timed timed(report_.seconds.total);
  const int pose = graph_.find(other);
  if (pose < 0) {
    refuse(fmt::format("pose {} is not in the compact graph{}", other,
                       other == graph_.newest_id() ? "; it is the newest" : ""));
  }
  if (other == graph_.newest_id())
    refuse(fmt::format("a link from pose {} to itself", id_text(other)));
  const Motion motion =
      measured.empty() ? Motion() : graph_.fuse(measured, other, graph_.newest_id());
  if (!searched_) search();
  LinkReport report{.earlier = other, .later = graph_.newest_id()};
  const std::optional<Candidate> candidate = take_candidate(pose);
  if (candidate) report.expected_gain = candidate->gain;
  record_.note(pose, !measured.empty());
  ++answered_;
  if (!measured.empty()) {
    Link link{.earlier = pose,
              .later = graph_.newest_kept() ? graph_.size() - 1 : graph_.size(),
              .factors = {measured.begin(), measured.end()},
              .motion = motion,
              .mean = graph_.group().state(motion.mean),
              .covariance = to_matrix(motion.covariance, graph_.group().tangent_size())};
    typical_.note(link.covariance);
    report.verdict = judge(link, report);
    const bool waits = report.verdict == LinkVerdict::waiting;
    if (report.verdict == LinkVerdict::linked) in_vain_ = 0;
    if (pose == proposed_ && (report.verdict == LinkVerdict::inconsistent || waits)) ++in_vain_;
    if (report.verdict == LinkVerdict::linked || waits) graph_.make_permanent(pose);
    if (report.verdict == LinkVerdict::linked) {
      const bool noted = candidate && watches();
      if (noted) finder_.note_loop(dimensions_[candidate->place], report.gain, link.covariance);
      learnt_.push_back({other, graph_.newest_id(), link.covariance, report.gain, noted});
      use(link);
    } else if (waits) {
      if (!graph_.newest_kept()) graph_.keep(report_.seconds);
      learnt_.push_back({other, graph_.newest_id(), link.covariance, report.gain, false});
      driven_ = kInfinity;  // what agrees with it may be seen from the next pose
      waiting_.push_back({std::move(link), report});
      if (waiting_.size() > kMostWaiting) {  // nothing has agreed with it for so long
        waiting_.front().report.verdict = LinkVerdict::inconsistent;
        report_.links.push_back(waiting_.front().report);
        waiting_.erase(waiting_.begin());
      }
    }
  }
  if (learnt_.size() > Ways::kMost) learnt_.pop_front();
  report_.links.push_back(report);
  if (report.verdict == LinkVerdict::linked) judge_waiting();
  return report;
}

/// Lines 22 and 23 of Algorithm 1, and whether the link fits.
LinkVerdict CompactPose::judge(const Link& link, LinkReport& report) {
  if (!graph_.connected(link.earlier, link.later)) {  // nothing is known that it could contradict
    report.gain = kInfinity;
    return check_->on() && !agrees_with_waiting(link) ? LinkVerdict::waiting : LinkVerdict::linked;
  }
  const Displacement d = known_displacement(link.earlier);
  report.gain = mutual_information(link.covariance, d.covariance);
  const Fit fit = check_->fit(link, d);
  report.innovation = fit.innovation;
  if (!(report.gain > loop_gain_)) return LinkVerdict::uninformative;
  if (!fit.consistent)
    return doubts_odometry(link, d) ? LinkVerdict::linked : LinkVerdict::inconsistent;
  if (check_->needs_another(fit) && !agrees_with_waiting(link)) return LinkVerdict::waiting;
  return LinkVerdict::linked;
}

void CompactPose::follow_refused(const Motion& motion) {
  const RigidGroup& group = graph_.group();
  const State step = group.state(motion.mean);
  const Matrix A = group.adjoint(group.inverse(step));
  for (Refused& refused : refused_) {
    refused.since.mean = group.compose(refused.since.mean, step);
    refused.since.covariance = A * refused.since.covariance * A.transpose() + odometry_;
  }
}

/// Of a link that the gate refuses. Where three of other poses that it has refused before agree
/// with it, each closing a cycle with the odometry between their ends, it is the estimate that is
/// wrong: odometry is less certain than its covariances say, as where a wheel's radius is. False
/// matches that agree so with each other are one place that looks like another.
bool CompactPose::doubts_odometry(const Link& link, const Displacement& expected) {
  const Id earlier = graph_.id(link.earlier);
  std::set<Id> agree;
  for (const Refused& other : refused_) {
    const int pose = graph_.find(other.earlier);
    if (pose < 0 || other.later == graph_.newest_id()) continue;
    const Fit fit =
        check_->agreement(other.link, link, graph_.between(pose, link.earlier), other.since);
    if (fit.consistent && !check_->needs_another(fit)) agree.insert(other.later);
  }
  if (agree.size() < kAgreeing || !check_->on()) {
    Refused refused{earlier, graph_.newest_id(), link, expected};
    refused.since.mean = graph_.group().between(link.mean, link.mean);
    refused.since.covariance.setZero();
    refused_.push_back(std::move(refused));
    if (refused_.size() > kMostRefused) refused_.pop_front();
    return false;
  }
  const double loose = check_->loosen_for(link, expected);
  if (!check_->fit(link, expected).consistent) return false;
  report_.notes.push_back(fmt::format(
      "matches of {} poses that the gate refused agree with that of poses {} and {}: odometry is "
      "less "
      "certain than its covariances say, and the gate takes standard deviations as {:.3g} times "
      "larger from now on",
      agree.size(), earlier, graph_.newest_id(), std::sqrt(loose)));
  refused_.clear();
  return true;
}

bool CompactPose::agrees_with_waiting(const Link& link) {
  for (std::size_t k = 0; k < waiting_.size(); ++k) {
    const Link& other = waiting_[k].link;
    const bool kept = link.later < graph_.size();
    if (other.earlier == link.earlier && other.later == link.later) continue;
    if (!graph_.connected(other.earlier, link.earlier)) continue;
    // Before it is kept, the newest pose is known by its displacement only.
    const Displacement later =
        kept ? graph_.between(other.later, link.later) : known_displacement(other.later);
    const Fit fit =
        check_->agreement(other, link, graph_.between(other.earlier, link.earlier), later);
    if (!fit.consistent || check_->needs_another(fit)) continue;
    return true;
  }
  return false;
}

/// Relocating divides the measurement between two ways. That must leave little between the two
/// poses that is worth a pose of its own, measured by what a match is worth here, whatever the
/// options expect; and must cost little of what is known of the way that ends here: where loop
/// closures are not better than odometry, the loss would add up. The more poses are kept nearby,
/// the less each way matters, and the more is gained by not keeping another.
std::optional<double> CompactPose::relocation(const Link& link) const {
  // Where another pose would have to leave, information is lost in any case.
  if (!options_.reuse && !graph_.full()) return std::nullopt;
  if (!(pose_gain_ > 0.0)) return std::nullopt;  // every pose is to be kept
  const double n = graph_.group().tangent_size();
  const double of_way = part_of_way(graph_.newest_odometry(), link.covariance);
  const Matrix rest = link.covariance / (1.0 - of_way);
  // Three matches in one are as good as any; a lower g_pose must not keep poses of one place for
  // ever.
  const double enough = std::max(pose_gain_, 0.5 * n * std::log(4.0));
  if (!(mutual_information(typical_.covariance(), rest) < enough)) return std::nullopt;
  // Where the bridge is not informative, nothing is divided.
  if (graph_.full()) return of_way;
  const Matrix end = graph_.newest_odometry() + link.covariance;
  const double lost = mutual_information(end, link.covariance);
  if (lost > options_.reuse_loss * report_.candidates * n) return std::nullopt;
  return of_way;
}

void CompactPose::use(const Link& link) {
  if (!graph_.connected(link.earlier, link.later)) {
    graph_.locate(link.earlier, link.mean, link.factors, report_.seconds);
    // The poses of the map are candidates from now on.
    searched_ = false;
    candidates_.clear();
    dimensions_.clear();
    report_.candidates = 0;
    report_.least_gain = kInfinity;
    report_.closed_loop = true;
    return;
  }
  const bool of_newest = link.later == graph_.size() && !graph_.newest_kept();
  const std::optional<double> of_way = of_newest ? relocation(link) : std::nullopt;
  if (of_way) {
    graph_.relocate(link.earlier, link.motion, *of_way, loop_gain_, report_.seconds);
  } else {
    graph_.link(link.factors, report_.seconds);
  }
  report_.closed_loop = true;
}

/// After a link was used, what waits is looked at again: it fits closely now, or not at all.
void CompactPose::judge_waiting() {
  for (bool again = true; std::exchange(again, false);) {
    for (std::size_t k = 0; k < waiting_.size() && !again; ++k) {
      Waiting& old = waiting_[k];
      if (!graph_.connected(old.link.earlier, old.link.later)) continue;
      const Displacement d = graph_.between(old.link.earlier, old.link.later);
      const Fit fit = check_->fit(old.link, d);
      old.report.innovation = fit.innovation;
      old.report.gain = mutual_information(old.link.covariance, d.covariance);
      if (fit.consistent && check_->needs_another(fit)) continue;
      if (!fit.consistent) {
        old.report.verdict = LinkVerdict::inconsistent;
      } else if (!(old.report.gain > loop_gain_)) {
        old.report.verdict = LinkVerdict::uninformative;
      } else {
        old.report.verdict = LinkVerdict::linked;
        use(old.link);
      }
      report_.links.push_back(old.report);
      waiting_.erase(waiting_.begin() + static_cast<std::ptrdiff_t>(k));
      again = true;
    }
  }
}

/// Line 32 of Algorithm 1.
PoseReport CompactPose::end_pose() {
  if (!open_) throw Error(ErrorCode::usage, "end_pose without a pose");
  {
    const Timed timed(report_.seconds.total);
    if (!searched_) search();
    if (silenced()) typical_.note_silence();
    removed_.clear();
    settle_priors();
    settle_left_out();  // by links of the pose, or its odometry
    const bool kept = graph_.newest_kept();
    use_landmarks();
    const bool triangulated = use_waiting_landmarks();
    const bool by_landmarks = !kept && graph_.newest_kept();
    if (!graph_.newest_kept() && !report_.closed_loop && report_.least_gain > pose_gain_)
      graph_.keep(report_.seconds);
    if (!add_landmarks() && !triangulated && !kept && graph_.newest_kept() && pose_gain_ > 0.0 &&
        !graph_.landmarks().empty())
      limit_poses_of_landmarks(by_landmarks);
    if (graph_.predecessor() >= 0 && report_.candidates > 0 && watches())
      finder_.note_pose(report_.least_gain);
    for (const Candidate& left : candidates_)
      report_.most_gain = std::max(report_.most_gain, left.gain);
    make_room();
    settle_left_out();
  }
  open_ = false;
  report_.kept = graph_.newest_kept();
  return report_;
}

bool CompactPose::finish() {
  if (open_) throw Error(ErrorCode::usage, "finish before the newest pose was ended");
  if (graph_.empty()) return true;
  removed_.clear();
  if (!graph_.newest_kept()) graph_.keep(report_.seconds);
  make_room();
  const bool converged = graph_.solve_fully();
  if (watches()) noise_scale_ = noise_scale(estimator().graph(), estimator().chi2());
  return converged;
}

std::vector<double> CompactPose::newest_state() const {
  if (graph_.empty()) throw Error(ErrorCode::usage, "newest_state before the first pose");
  const auto state = graph_.group().view(graph_.newest_state());
  return {state.begin(), state.end()};
}

void* CompactPose::ability(std::string_view name) {
  if (name == OptionFinder::kAbility) return static_cast<OptionFinder*>(this);
  return PosePolicy::ability(name);
}

OptionValues CompactPose::watching(bool recorded_only) const {
  return {{"strategy", "apal"}, {"search", recorded_only ? "recorded" : "untested"}, {"keep", "0"}};
}

OptionValues CompactPose::found() const {
  static_cast<void>(finder_.sensor());  // throws where there is no loop closure, perhaps no pose
  SensorRange range = range_;
  range.noise_scale = noise_scale_;
  return finder_.found(DistanceTest(graph_.group(), range));
}

OptionValues CompactPose::scaled(const OptionValues& found, double links, double poses) const {
  OptionValues values = found;
  const auto scale = [&](const char* name, double factor) {
    std::string& gain = values.at(name);
    gain = fmt::format("{:.9g}", factor * std::stod(gain));
  };
  scale("loop_gain", links);
  scale("pose_gain", poses);
  return values;
}

double CompactPose::accuracy() const {
  return std::sqrt(graph_.group().twist_covariance(finder_.sensor()).topLeftCorner<3, 3>().trace());
}

}  // namespace cairn::compact
