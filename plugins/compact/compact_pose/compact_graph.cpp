// SPDX-License-Identifier: BSD-3-Clause
#include "compact_graph.hpp"

#include <algorithm>
#include <chrono>
#include <iterator>
#include <string>
#include <utility>

#include <fmt/core.h>

#include "cairn/graph/gauge.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"

namespace cairn::compact {
namespace {

using Clock = std::chrono::steady_clock;

[[noreturn]] void refuse(const std::string& message) { throw Error(ErrorCode::input, message); }

}  // namespace

void need_covariance(bool there, Id id) {
  if (there) return;
  throw Error(
      ErrorCode::numerical,
      fmt::format("there is no covariance of {} to judge measurements by: the measurements do not "
                  "determine it, or rounding takes its digits, as on a long trajectory without "
                  "loop closures whose steps are far more accurate than its headings",
                  id));
}

CompactGraph::CompactGraph(std::unique_ptr<Estimator> estimator, CompositionOrder order,
                           KeptMarginals marginals)
    : estimator_(std::move(estimator)), order_(order) {
  estimator_->keep_marginals(marginals);
  keeps_covariances_ = marginals == KeptMarginals::diagonal;
}

void CompactGraph::load(const Graph& map) {
  std::vector<int> order;  // poses first
  for (int v = 0; v < map.variable_count(); ++v) {
    if (is_point(map.type(v))) continue;
    order.push_back(v);
    if (map.pool(v) != map.pool(order.front())) {
      refuse(fmt::format("the map has {} and {}; a map that is continued has poses of one type",
                         map.describe_variable(order.front()), map.describe_variable(v)));
    }
  }
  if (order.empty()) {
    refuse(map.variable_count() == 0 ? "the map is empty: it has no poses to continue from"
                                     : "the map has landmarks alone: no poses to continue from");
  }
  const Gauge gauge = resolve_gauge(map);
  if (gauge.components != 1) {
    refuse(
        fmt::format("the map has {} parts without a measurement between them; expected one, "
                    "since nothing is known of their relative position",
                    gauge.components));
  }
  auto group = std::make_unique<RigidGroup>(map.variable(order.front()).type);
  std::ranges::sort(order, {}, [&](int v) { return map.id(v); });
  GraphUpdate update;
  for (const int v : order) update.variables.push_back(map.variable(v));
  for (int v = 0; v < map.variable_count(); ++v) {
    if (is_point(map.type(v))) update.variables.push_back(map.variable(v));
  }
  for (int f = 0; f < map.factor_count(); ++f) update.factors.push_back(map.factor(f));
  estimator_->update(update, {.full = true});
  group_ = std::move(group);
  index_ = std::make_unique<PoseIndex>(group_->dimension());
  for (const int v : order) {
    number_.emplace(map.id(v), size());
    kept_.push_back({.id = map.id(v)});
    index_->add(group_->place(group_->state(estimator_->state(map.id(v)))).at.t);
  }
  for (std::size_t k = order.size(); k < update.variables.size(); ++k)
    note_landmark(update.variables[k].id, update.variables[k].type);
  map_size_ = solved_ = size();
  located_ = false;
  referenced_ = gauge.anchored.empty() && gauge.left_free.empty();
}

void CompactGraph::start(const Variable& pose, PolicySeconds& seconds) {
  const auto begin = Clock::now();
  auto group = std::make_unique<RigidGroup>(pose.type);
  Variable first = pose;
  if (!located_) first.fixed = false;  // where it is held is not known
  referenced_ = referenced_ || first.fixed;
  if (first.state.empty()) {
    first.state.resize(static_cast<std::size_t>(pose.type->ambient_size()));
    pose.type->identity(first.state.data());
  }
  GraphUpdate update;
  update.variables.push_back(first);
  estimator_->update(update);
  if (!group_) {
    group_ = std::move(group);
    index_ = std::make_unique<PoseIndex>(group_->dimension());
  }
  newest_ = {};
  newest_.pose = first;
  newest_.kept = true;
  anchor_ = size();
  number_.emplace(pose.id, size());
  kept_.push_back({.id = pose.id});
  solved_ = size();
  index_->add(group_->place(group_->state(first.state)).at.t);
  refresh();
  seconds.estimate += seconds_since(begin);
}

Motion CompactGraph::fuse(std::span<const Factor> factors, Id from, Id to) const {
  const MotionGroup& motions = group_->motions();
  if (factors.empty())
    refuse(fmt::format("no measured relative pose from pose {} to {}", from, to));
  Motion all;
  for (const Factor& factor : factors) {
    const auto& on = factor.variables;
    const bool forwards = on == std::vector<Id>{from, to}, back = on == std::vector<Id>{to, from};
    if (!forwards && !back)
      refuse(fmt::format("a measurement that is not between poses {} and {}", from, to));
    if (!factor.type) refuse("a measurement without a type");
    if (!factor.type->is_relative() ||
        factor.type->variable_tags().front() != motions.type().tag()) {
      refuse(fmt::format("{} between {} and {} is not a relative pose of {}", factor.type->tag(),
                         from, to, motions.type().tag()));
    }
    const Motion motion = motions.of_factor(factor, from);
    all = all.mean.empty() ? motion : motions.fuse(all, motion);
  }
  return all;
}

void CompactGraph::advance(const Variable& pose, const Motion& motion,
                           const std::shared_ptr<const FactorType>& type) {
  Newest next;
  next.pose = pose;
  next.type = type;
  next.predecessor = newest_.kept ? size() - 1 : newest_.predecessor;
  next.odometry =
      newest_.kept ? motion : group_->motions().compose(newest_.odometry, motion, order_);
  // While nothing has changed: whether it can be a factor where the pose is kept.
  (void)group_->motions().to_factor(type, kept_[next.predecessor].id, pose.id, next.odometry);
  if (!newest_.kept) next.steps = std::move(newest_.steps);
  if (keeps_chains_) next.steps.push_back({pose.id, motion.mean, motion.covariance});
  next.ahead = compose(kept_[next.predecessor].ahead, next.odometry);
  if (newest_.kept) ways_.begin(newest_.pose.id);
  ways_.add_odometry(motion, group_->motions(), order_);
  newest_ = std::move(next);
  newest_.placed = group_->place(
      group_->compose(kept_[newest_.predecessor].placed.x, group_->state(newest_.odometry.mean)));
  known_ = false;
}

/// To first order, as the estimator's H has it.
CompactGraph::Ahead CompactGraph::compose(const Ahead& ahead, const Motion& motion) const {
  const int n = group_->tangent_size();
  const State z = group_->state(motion.mean);
  Matrix S = to_matrix(motion.covariance, n);
  if (ahead.covariance.size() == 0) return {z, S};  // from the anchor itself
  const Matrix A = group_->adjoint(group_->inverse(z));
  S += A * ahead.covariance * A.transpose();
  return {group_->compose(ahead.mean, z), S};
}

void CompactGraph::keep(PolicySeconds& seconds) {
  if (newest_.kept) return;
  const Id from = kept_[newest_.predecessor].id;
  Kept pose{.id = newest_.pose.id, .placed = newest_.placed, .ahead = newest_.ahead};
  pose.variable = newest_.pose;
  pose.odometry =
      group_->motions().to_factor(newest_.type, from, newest_.pose.id, newest_.odometry);
  end_chain(from, newest_.pose.id);
  close_way(newest_.pose.id, Way::Became::odometry);
  number_.emplace(pose.id, size());
  index_->add(newest_.placed.at.t);
  kept_.push_back(std::move(pose));
  newest_.kept = true;
  if (!newest_.pose.fixed) return;
  referenced_ = true;
  update({}, seconds);  // which is more than odometry
}

/// The steps of the newest pose lead to one that is kept.
void CompactGraph::end_chain(Id from, Id to) {
  if (keeps_chains_) chains_.push_back({from, to, std::move(newest_.steps)});
  newest_.steps.clear();
}

/// A way that is too long ago to be remembered is a part of the bridge that it belongs to.
void CompactGraph::close_way(Id to, Way::Became became) {
  ways_.close(to, became);
  if (ways_.all().size() <= Ways::kMost) return;
  const Way& oldest = ways_.all().front();
  const auto known = oldest.became == Way::Became::bridge
                         ? bridges_.find(std::minmax(find(oldest.from), find(oldest.to)))
                         : bridges_.end();
  if (known != bridges_.end()) {
    std::optional<Motion>& rest = known->second.rest;
    rest = rest ? group_->motions().fuse(*rest, oldest.bridge) : oldest.bridge;
  }
  ways_.all().pop_front();
}

void CompactGraph::link(std::span<const Factor> links, PolicySeconds& seconds) {
  keep(seconds);
  note_links(links, update(links, seconds));
}

void CompactGraph::note_links(std::span<const Factor> links, FactorId first) {
  for (const Factor& link : links) {
    const FactorId id = first++;
    if (link.variables.size() != 2) continue;
    links_[std::minmax(link.variables[0], link.variables[1])].push_back(id);
  }
}

void CompactGraph::locate(int pose, const State& measured, std::span<const Factor> links,
                          PolicySeconds& seconds) {
  keep(seconds);
  update({}, seconds);  // now the estimator has everything
  const auto begin = Clock::now();
  const State move = group_->compose(group_->compose(kept_[pose].placed.x, measured),
                                     group_->inverse(kept_.back().placed.x));
  move_poses(map_size_, move, links);
  located_ = true;
  refresh();
  seconds.estimate += seconds_since(begin);
}

void CompactGraph::refer(const State& move, std::span<const Factor> priors,
                         PolicySeconds& seconds) {
  keep(seconds);
  update({}, seconds);
  const auto begin = Clock::now();
  move_poses(0, move, priors);
  estimator_->update({}, {.full = true});
  referenced_ = true;
  refresh();
  seconds.estimate += seconds_since(begin);
}

/// Moves the poses from this number on, which have no factors with those before, and adds factors.
/// The estimator must have all of them.
void CompactGraph::move_poses(int first, const State& move, std::span<const Factor> factors) {
  GraphUpdate leaving, coming;
  for (int k = first; k < size(); ++k) {
    const State moved = group_->compose(move, kept_[k].placed.x);
    const auto state = group_->view(moved);
    leaving.removed_variables.push_back(kept_[k].id);
    coming.variables.push_back({.type = estimator_->type(kept_[k].id),
                                .id = kept_[k].id,
                                .state = {state.begin(), state.end()}});
  }
  if (first == 0) move_landmarks(move, leaving, coming);
  std::unordered_map<FactorId, FactorId> place;  // in `coming`
  for (const FactorId id : estimator_->factors()) {
    Factor factor = estimator_->factor(id);
    if (first > 0 && find(factor.variables.front()) < first) continue;
    place.emplace(id, std::ssize(coming.factors));
    coming.factors.push_back(std::move(factor));
  }
  const auto old_factors = std::ssize(coming.factors);
  coming.factors.insert(coming.factors.end(), factors.begin(), factors.end());
  estimator_->update(leaving, {.defer = true});
  const UpdateReport report = estimator_->update(coming);
  copy_.reset();
  for (auto& [ends, ids] : links_) {
    for (FactorId& id : ids) {
      if (const auto at = place.find(id); at != place.end()) id = report.first_factor + at->second;
    }
  }
  note_links(factors, report.first_factor + old_factors);
  for (Temporary& pose : temporary_) pose.since = 0;
  for (auto& [ends, bridge] : bridges_) {  // those between poses of the map are where they were
    if (const auto at = place.find(bridge.factor); at != place.end())
      bridge.factor = report.first_factor + at->second;
  }
}

void CompactGraph::relocate(int pose, const Motion& measured, double of_way, double least_gain,
                            PolicySeconds& seconds) {
  const MotionGroup& motions = group_->motions();
  WayPart match{.motion = measured,
                .pose = newest_.pose.id,
                .kept = kept_[pose].id,
                .matched = true,
                .of_way = of_way};
  if (pose == newest_.predecessor) {  // another measurement of the same motion
    ways_.open().parts.push_back(std::move(match));
    newest_.odometry = motions.fuse(newest_.odometry, measured);
    update({}, seconds);
    hang_newest();
    return;
  }
  Motion end = measured, start = measured;
  for (double& entry : end.covariance) entry /= of_way;
  for (double& entry : start.covariance) entry /= 1.0 - of_way;
  const int other = newest_.predecessor;
  const std::pair<int, int> ends = std::minmax(pose, other);
  Motion bridge = motions.compose(end, motions.inverse(newest_.odometry), order_);
  if (pose > other) bridge = motions.inverse(bridge);
  if ((full_ || temporary(other)) && !(gain(ends, bridge) > least_gain)) {
    end = start = measured;
    match.divided = false;
  } else {
    make_permanent(other);
    ways_.open().bridge = bridge;
    add_bridge(ends, std::move(bridge), seconds);
  }
  ways_.open().end = match;
  close_way(kept_[pose].id, match.divided ? Way::Became::bridge : Way::Became::nothing);
  ways_.begin(kept_[pose].id, match);
  const Motion back = motions.inverse(end);
  if (keeps_chains_) {
    newest_.steps.push_back({kept_[pose].id, back.mean, back.covariance, true});
    end_chain(kept_[other].id, kept_[pose].id);
    // The next way begins at another pose than where this one ended.
    newest_.steps.push_back({newest_.pose.id, start.mean, start.covariance, true});
  }
  newest_.predecessor = pose;
  newest_.odometry = start;
  hang_newest();
}

/// One factor between two poses, however often the robot goes from one to the other.
void CompactGraph::add_bridge(std::pair<int, int> ends, Motion bridge, PolicySeconds& seconds) {
  const MotionGroup& motions = group_->motions();
  const auto known = bridges_.find(ends);
  if (known != bridges_.end()) bridge = motions.fuse(known->second.motion, bridge);
  if (known == bridges_.end()) {
    const Factor factor = motions.to_factor(newest_.type, id(ends.first), id(ends.second), bridge);
    const FactorId added = update({&factor, 1}, seconds);
    bridges_.emplace(ends, Bridge{added, bridge});
  } else {
    update({}, seconds, {replaced(known->second.factor, id(ends.first), bridge)});
    known->second.motion = bridge;
  }
}

/// The change that makes a factor measure `motion`, from pose `from` to the other of its two poses.
/// What took the place of poses that have left may go from the later to the earlier, and be of
/// another type than odometry.
ChangedFactor CompactGraph::replaced(FactorId factor, Id from, const Motion& motion) const {
  const MotionGroup& motions = group_->motions();
  const Factor old = estimator_->factor(factor);
  const bool backwards = old.variables.front() != from;
  Factor now = motions.to_factor(old.type, old.variables.front(), old.variables.back(),
                                 backwards ? motions.inverse(motion) : motion);
  return {factor, std::move(now.measurement), std::move(now.information)};
}

/// Puts the newest pose, which is not kept, where its odometry from its predecessor says; that is
/// in the estimator, and the anchor from now on.
void CompactGraph::hang_newest() {
  anchor_ = newest_.predecessor;
  newest_.ahead = compose({}, newest_.odometry);
  newest_.placed =
      group_->place(group_->compose(kept_[anchor_].placed.x, group_->state(newest_.odometry.mean)));
  ++version_;  // covariances with the anchor are with another pose now
  known_ = false;
}

FactorId CompactGraph::update(std::span<const Factor> links, PolicySeconds& seconds,
                              std::vector<ChangedFactor> changed, std::vector<Variable> added) {
  if (links.empty() && changed.empty() && solved_ == size()) return 0;
  const auto begin = Clock::now();
  GraphUpdate update = odometry_from(solved_);
  update.factors.insert(update.factors.end(), links.begin(), links.end());
  update.changed = std::move(changed);
  std::vector<std::pair<Id, std::shared_ptr<const VariableType>>> landmarks;
  for (const Variable& variable : added) landmarks.emplace_back(variable.id, variable.type);
  std::ranges::move(added, std::back_inserter(update.variables));
  const UpdateReport report = estimator_->update(update);  // throws before anything has changed
  copy_.reset();
  for (auto& [id, type] : landmarks) note_landmark(id, std::move(type));
  const FactorId first_link = report.first_factor + (size() - solved_);
  if (!update.factors.empty()) latest_factors_ = report.first_factor;
  for (Temporary& pose : temporary_) pose.since = std::min(pose.since, latest_factors_);
  for (; solved_ < size(); ++solved_) {
    kept_[solved_].ahead = {};
    kept_[solved_].variable = {};
    kept_[solved_].odometry = {};
  }
  anchor_ = newest_.kept ? size() - 1 : newest_.predecessor;
  newest_.ahead = newest_.kept ? Ahead() : compose({}, newest_.odometry);
  if (!landmarks_.empty() && !update.factors.empty()) {
    std::vector<Id> measured;
    for (const Factor& link : links)
      measured.insert(measured.end(), link.variables.begin(), link.variables.end());
    if (!report.ok || !determined(measured)) restore_covariances(measured);
  }
  refresh();
  seconds.estimate += seconds_since(begin);
  return first_link;
}

GraphUpdate CompactGraph::odometry_from(int first) const {
  GraphUpdate update;
  for (int k = first; k < size(); ++k) {
    Variable variable = kept_[k].variable;
    if (!variable.fixed || variable.state.empty()) {
      const auto state = group_->view(kept_[k].placed.x);
      variable.state.assign(state.begin(), state.end());
    }
    update.variables.push_back(std::move(variable));
    update.factors.push_back(kept_[k].odometry);
  }
  return update;
}

Estimator& CompactGraph::estimator() {
  if (solved_ == size()) return *estimator_;
  if (!copy_) {
    copy_ = estimator_->clone();
    copied_ = solved_;
  }
  if (copied_ < size()) copy_->update(odometry_from(std::exchange(copied_, size())));
  return *copy_;
}

bool CompactGraph::solve_fully() {
  PolicySeconds unattended;
  update({}, unattended);
  const UpdateReport report = estimator_->update({}, {.full = true});
  refresh();
  return report.ok && report.converged;
}

/// Reads the estimate, which has changed.
void CompactGraph::refresh() {
  for (int k = 0; k < size(); ++k) {
    kept_[k].placed = group_->place(group_->state(estimator_->state(kept_[k].id)));
    index_->move(k, kept_[k].placed.at.t);
  }
  newest_.placed = newest_.kept
                       ? kept_.back().placed
                       : group_->place(group_->compose(kept_[newest_.predecessor].placed.x,
                                                       group_->state(newest_.odometry.mean)));
  ++version_;
  known_ = false;
}

int CompactGraph::find(Id id) const {
  const auto place = number_.find(id);
  return place == number_.end() ? -1 : place->second;
}

std::vector<Id> CompactGraph::kept() const {
  std::vector<Id> ids;
  for (const Kept& pose : kept_) ids.push_back(pose.id);
  return ids;
}

int CompactGraph::factor_count() const { return estimator_->factor_count() + (size() - solved_); }

std::vector<int> CompactGraph::near(double radius) {
  std::vector<int> found = index_->near(newest_.placed.at.t, radius);
  if (newest_.kept) std::erase(found, size() - 1);
  if (!located_) std::erase_if(found, [&](int pose) { return pose < map_size_; });
  return found;
}

void CompactGraph::prepare(std::span<const int> poses, PolicySeconds& seconds) {
  const auto begin = Clock::now();
  const int n = group_->tangent_size();
  const auto doubles = static_cast<std::size_t>(n) * static_cast<std::size_t>(n);
  std::vector<Id> ids;
  std::vector<int> missing;
  for (const int pose : poses) {
    if (ahead(pose) || kept_[pose].version == version_) continue;
    missing.push_back(pose);
    ids.push_back(kept_[pose].id);
  }
  const Id anchor_id = kept_[anchor_].id;
  if (!ids.empty()) {
    know_anchor();
    Eigen::MatrixXd column(std::ssize(ids) * n, n);
    need_covariance(estimator_->covariance_column(
                        anchor_id, ids, {column.data(), static_cast<std::size_t>(column.size())}),
                    anchor_id);
    for (std::size_t k = 0; k < missing.size(); ++k) {
      Kept& pose = kept_[missing[k]];
      pose.cross = column.middleRows(static_cast<Eigen::Index>(k) * n, n);
      pose.own.resize(n, n);
      need_covariance(estimator_->covariance(pose.id, pose.id, {pose.own.data(), doubles}),
                      pose.id);
      pose.version = version_;
    }
  }
  if (!known_ && anchored_version_ == version_) know_newest();
  seconds.covariances += seconds_since(begin);
}

bool CompactGraph::prepared(int pose) const {
  return ahead(pose) || kept_[pose].version == version_;
}

void CompactGraph::know_anchor() {
  if (anchored_version_ == version_) return;
  anchored_version_ = version_;
  S_aa_ = block(anchor_, anchor_);
  known_ = false;
}

Matrix CompactGraph::newest_covariance(PolicySeconds& seconds) {
  const Timed timed(seconds.covariances);
  know_anchor();
  if (!known_) know_newest();
  return S_nn_;
}

/// A and Σ_nn of the newest pose, from the anchor's Σ_aa.
void CompactGraph::know_newest() {
  const int n = group_->tangent_size();
  if (newest_.ahead.covariance.size() == 0) {
    A_ = Matrix::Identity(n, n);
    S_nn_ = S_aa_;
  } else {
    A_ = group_->adjoint(group_->inverse(newest_.ahead.mean));
    S_nn_ = A_ * S_aa_ * A_.transpose() + newest_.ahead.covariance;
  }
  known_ = true;
}

Displacement CompactGraph::displacement(int pose) const {
  return group_->displacement(kept_[pose].placed, newest_.placed);
}

void CompactGraph::set_covariance(int pose, Displacement& d) const {
  const Kept& kept = kept_[pose];
  const bool newest_ahead = newest_.ahead.covariance.size() > 0;
  if (newest_ahead && pose == newest_.predecessor) {
    d.covariance = to_matrix(newest_.odometry.covariance, group_->tangent_size());
  } else if (!ahead(pose)) {
    group_->set_covariance(kept.own, kept.cross.lazyProduct(A_.transpose()), S_nn_, d);
  } else {
    // Odometry alone is between them: Σ_an = Ad(d⁻¹) Σ_ai Ad(d⁻¹)ᵀ + Σ_d.
    d.covariance = newest_.ahead.covariance;
    if (pose != anchor_) d.covariance -= d.adjoint * kept.ahead.covariance * d.adjoint.transpose();
  }
}

/// Σ_ik of two poses that the estimator has.
Matrix CompactGraph::block(int i, int k) {
  Matrix S(group_->tangent_size(), group_->tangent_size());
  need_covariance(estimator_->covariance(kept_[i].id, kept_[k].id,
                                         {S.data(), static_cast<std::size_t>(S.size())}),
                  kept_[k].id);
  return S;
}

/// The newest is Σ_ia Aᵀ away from those that the estimator has. A column of each of these at a
/// time.
Eigen::MatrixXd CompactGraph::joint_covariance(std::span<const int> poses, PolicySeconds& seconds) {
  update({}, seconds);
  const int n = group_->tangent_size();
  const Eigen::Index last = n * std::ssize(poses);
  Eigen::MatrixXd joint(last + n, last + n);
  joint.bottomRightCorner(n, n) = newest_covariance(seconds);
  const Timed timed(seconds.covariances);
  std::vector<Id> ids;
  for (const int pose : poses) ids.push_back(id(pose));
  ids.push_back(id(anchor_));
  Eigen::MatrixXd column(last + n, n);
  for (std::size_t k = 0; k < poses.size(); ++k) {
    need_covariance(estimator_->covariance_column(
                        ids[k], ids, {column.data(), static_cast<std::size_t>(column.size())}),
                    ids[k]);
    const Eigen::Index at = n * static_cast<Eigen::Index>(k);
    joint.block(0, at, last, n) = column.topRows(last);
    joint.block(last, at, n, n) = A_ * column.bottomRows(n);
    joint.block(at, last, n, n) = joint.block(last, at, n, n).transpose();
  }
  return joint;
}

Matrix CompactGraph::covariance(int pose) {
  PolicySeconds unattended;
  update({}, unattended);
  return block(pose, pose);
}

Displacement CompactGraph::between(int a, int b) {
  PolicySeconds unattended;
  update({}, unattended);
  Displacement d = group_->displacement(kept_[a].placed, kept_[b].placed);
  group_->set_covariance(block(a, a), block(a, b), block(b, b), d);
  return d;
}

}  // namespace cairn::compact
