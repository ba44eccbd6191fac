// SPDX-License-Identifier: BSD-3-Clause
#include "compact_pose.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
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

/// What the newest pose may lose where another leaves that landmarks locate, as a part of what the
/// map may: it loses at every pose.
constexpr double kOfNewest = 0.1;
/// So many of the nearest poses are tested for being near a temporary one.
constexpr std::size_t kMostCovers = 4;

[[noreturn]] void refuse(const std::string& message) { throw Error(ErrorCode::input, message); }

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
      graph_(std::move(estimator), options_.composition,
             options_.search == Search::recorded ? KeptMarginals::none : KeptMarginals::diagonal),
      loops_(options_) {
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

void CompactPose::expect(const Graph& recording, std::span<const Arrival> poses) {
  loops_.expect(recording, poses);
}

void CompactPose::load(const Graph& map) {
  if (!graph_.empty() || graph_.kept().size() > 0)
    throw Error(ErrorCode::usage, "load after the first pose, or a second map");
  graph_.load(map);
}

std::vector<Id> CompactPose::unlocated() const {
  if (graph_.located()) return {};
  std::vector<Id> poses = graph_.kept().ids();
  poses.resize(static_cast<std::size_t>(graph_.map_size()));
  return poses;
}

void CompactPose::start(const Variable& pose) {
  // Before anything has changed: what the options say fits this type of pose.
  loops_.search().check_recording();
  Matrix sensor = sensor_covariance(options_.sensor, RigidGroup(pose.type));
  graph_.start(pose, report_.seconds);
  gains_ = options_.gains(graph_.group().tangent_size());
  loops_.begin(graph_.group(), gains_, std::move(sensor));
  absolute_ = {gains_.prior, {options_.gate}};
  landmarks_ = {options_, gains_.landmark};
}

void CompactPose::add_pose(const Variable& pose, std::span<const Factor> odometry) {
  if (open_) throw Error(ErrorCode::usage, "add_pose before the pose before it was ended");
  if (graph_.empty()) {
    if (!odometry.empty())
      refuse(fmt::format("pose {} is the first, and moved from another", id_text(pose.id)));
    if (graph_.kept().size() > 0) check_new(pose);
    report_ = {};
    report_.id = pose.id;
    start(pose);
  } else {
    advance(pose, odometry);
  }
  open_ = true;
  loops_.begin_pose();
  landmarks_.begin_pose();
}

void CompactPose::advance(const Variable& pose, std::span<const Factor> odometry) {
  check_new(pose);
  if (pose.id == graph_.newest().id())
    refuse(fmt::format("pose {} is there already", id_text(pose.id)));
  if (pose.fixed && !graph_.located()) {
    refuse(fmt::format("pose {} is held, while it is unknown where the trajectory is on the map",
                       pose.id));
  }
  if (odometry.empty())
    refuse(fmt::format("pose {} comes without odometry from pose {}", id_text(pose.id),
                       id_text(graph_.newest().id())));
  const Motion motion = graph_.group().fuse(odometry, graph_.newest().id(), pose.id);
  report_ = {};
  report_.id = pose.id;
  const Timed timed(report_.seconds.total);
  loops_.advance(motion, graph_.group());
  graph_.advance(pose, motion, odometry.front().type);
  if (pose.fixed) graph_.keep(report_.seconds);
}

void CompactPose::check_new(const Variable& pose) const {
  if (pose.type->tag() != graph_.group().motions().type().tag()) {
    refuse(fmt::format("pose {} is a {}; the poses before it are {}", id_text(pose.id),
                       pose.type->tag(), graph_.group().motions().type().tag()));
  }
  if (graph_.kept().find(pose.id) >= 0)
    refuse(fmt::format("pose {} is there already", id_text(pose.id)));
  if (graph_.landmarks().type(pose.id) || landmarks_.waiting().type(pose.id))
    refuse(fmt::format("pose {} has the id of a landmark", id_text(pose.id)));
}

std::optional<MatchProposal> CompactPose::next_match() {
  if (!open_) throw Error(ErrorCode::usage, "next_match without a pose");
  const Timed timed(report_.seconds.total);
  return loops_.next_match(graph_, report_);
}

LinkReport CompactPose::offer(Id other, std::span<const Factor> measured) {
  if (!open_) throw Error(ErrorCode::usage, "offer without a pose");
  const Timed timed(report_.seconds.total);
  const int pose = graph_.kept().find(other);
  if (pose < 0) {
    refuse(fmt::format("pose {} is not in the compact graph{}", other,
                       other == graph_.newest().id() ? "; it is the newest" : ""));
  }
  if (other == graph_.newest().id())
    refuse(fmt::format("a link from pose {} to itself", id_text(other)));
  const Motion motion =
      measured.empty() ? Motion() : graph_.group().fuse(measured, other, graph_.newest().id());
  return loops_.judge(pose, measured, motion, graph_, report_);
}

PriorReport CompactPose::offer_prior(const Factor& measured) {
  if (!open_) throw Error(ErrorCode::usage, "offer_prior without a pose");
  const Timed timed(report_.seconds.total);
  return absolute_.judge(measured, graph_, report_);
}

void CompactPose::offer_landmark(const LandmarkObservation& observation) {
  if (!open_) throw Error(ErrorCode::usage, "offer_landmark without a pose");
  landmarks_.offer(observation, graph_);
}

bool CompactPose::revoke(Id a, Id b) {
  const bool was_there = graph_.revoke(a, b, report_.seconds);
  if (!loops_.forget(a, b, was_there, graph_)) return false;
  if (!open_) return true;
  loops_.restart(report_);  // others tell more without it
  report_.closed_loop = std::ranges::any_of(report_.links, [&](const LinkReport& link) {
    return link.verdict == LinkVerdict::linked &&
           std::minmax(link.earlier, link.later) != std::minmax(a, b);
  });
  return true;
}

/// Line 32 of Algorithm 1.
PoseReport CompactPose::end_pose() {
  if (!open_) throw Error(ErrorCode::usage, "end_pose without a pose");
  {
    const Timed timed(report_.seconds.total);
    loops_.end_pose(graph_, report_);
    removed_.clear();
    absolute_.settle(graph_, report_);
    landmarks_.settle_left_out(graph_, report_);  // by links of the pose, or its odometry
    settle_pose();
    make_room();
    landmarks_.settle_left_out(graph_, report_);
  }
  open_ = false;
  report_.kept = graph_.newest().kept;
  return report_;
}

/// What is left to be used, and whether the pose is kept.
void CompactPose::settle_pose() {
  const bool kept = graph_.newest().kept;
  landmarks_.use_known(graph_, report_);
  const bool triangulated = landmarks_.use_waiting(graph_, report_);
  const bool by_landmarks = !kept && graph_.newest().kept;
  if (!graph_.newest().kept && !report_.closed_loop && report_.least_gain > gains_.pose)
    graph_.keep(report_.seconds);
  const bool added = landmarks_.add_new(graph_, report_);
  if (!added && !triangulated && !kept && graph_.newest().kept && gains_.pose > 0.0 &&
      !graph_.landmarks().ids().empty())
    limit_poses_of_landmarks(by_landmarks);
}

/// A pose that stays, within the sensor's range of another: the nearest.
std::optional<Id> CompactPose::cover(int pose) {
  const DistanceTest& test = loops_.search().test();
  std::vector<std::pair<double, int>> near;
  const PlacedState there = graph_.group().place(graph_.kept().state(pose));
  for (int other = 0; other < graph_.kept().size(); ++other) {
    if (other == pose || graph_.temporary(other)) continue;
    const Pose apart =
        RigidGroup::seen_from(graph_.group().place(graph_.kept().state(other)), there);
    if (test.possible(apart)) near.emplace_back(apart.t.norm(), other);
  }
  std::ranges::sort(near);
  if (near.size() > kMostCovers) near.resize(kMostCovers);
  for (const auto& [distance, other] : near) {
    if (test.passes(test.dimensions(graph_.between(other, pose)))) return graph_.kept().id(other);
  }
  return std::nullopt;
}

/// The newest pose is kept, without a link or anything else that must stay.
void CompactPose::limit_poses_of_landmarks(bool located) {
  graph_.make_temporary();
  if (!located) return;
  const InformationLoss most{.map = gains_.landmark_loss,
                             .newest = kOfNewest * gains_.landmark_loss};
  const auto covering = [&](int pose) { return cover(pose); };
  const auto needed = [&](Id pose) { return landmarks_.waiting().has_views_from(pose); };
  while (auto leaving = graph_.drop_temporary(most, covering, needed, report_.seconds))
    note_leaving(*leaving);
}

/// Poses have new numbers.
void CompactPose::note_leaving(const CompactGraph::Leaving& leaving) {
  removed_.insert(removed_.end(), leaving.poses.begin(), leaving.poses.end());
  report_.removed = static_cast<int>(std::ssize(removed_));
  landmarks_.forget(leaving.poses, report_);
  loops_.renumber(leaving.now);
}

void CompactPose::make_room() {
  if (!remover_ || graph_.kept().size() <= options_.keep) return;
  std::vector<int> held = loops_.held();
  std::ranges::copy(absolute_.held(graph_), std::back_inserter(held));
  CompactGraph::Leaving leaving = graph_.make_room(*remover_, options_.keep, held, report_.seconds);
  if (leaving.note != noted_ && !leaving.note.empty()) report_.notes.push_back(leaving.note);
  noted_ = std::move(leaving.note);
  report_.notes.insert(report_.notes.end(), leaving.notes.begin(), leaving.notes.end());
  if (!leaving.poses.empty()) note_leaving(leaving);
}

bool CompactPose::finish() {
  if (open_) throw Error(ErrorCode::usage, "finish before the newest pose was ended");
  if (graph_.empty()) return true;
  removed_.clear();
  if (!graph_.newest().kept) graph_.keep(report_.seconds);
  make_room();
  const bool converged = graph_.solve_fully();
  if (loops_.watches()) noise_scale_ = noise_scale(estimator().graph(), estimator().chi2());
  return converged;
}

std::vector<double> CompactPose::newest_state() const {
  if (graph_.empty()) throw Error(ErrorCode::usage, "newest_state before the first pose");
  const auto state = graph_.group().view(graph_.newest().state());
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
  // Throws where there is no loop closure, perhaps no pose.
  static_cast<void>(loops_.thresholds().sensor());
  SensorRange range = options_.sensor_range();
  range.noise_scale = noise_scale_;
  return loops_.thresholds().found(DistanceTest(graph_.group(), range));
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
  return std::sqrt(
      graph_.group().twist_covariance(loops_.thresholds().sensor()).topLeftCorner<3, 3>().trace());
}

}  // namespace cairn::compact
