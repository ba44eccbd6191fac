// SPDX-License-Identifier: BSD-3-Clause
#include "compact_graph.hpp"

#include <algorithm>
#include <array>
#include <iterator>
#include <tuple>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include <fmt/core.h>

#include "cairn/geometry/pose.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"

namespace cairn::compact {
namespace {

[[noreturn]] void refuse(const std::string& message) { throw Error(ErrorCode::input, message); }

/// The poses of a map, by index, in the order of their ids.
std::vector<int> poses_of(const Graph& map) {
  std::vector<int> poses;
  for (int v = 0; v < map.variable_count(); ++v) {
    if (is_point(map.type(v))) continue;
    poses.push_back(v);
    if (map.pool(v) != map.pool(poses.front())) {
      refuse(fmt::format("the map has {} and {}; a map that is continued has poses of one type",
                         map.describe_variable(poses.front()), map.describe_variable(v)));
    }
  }
  if (poses.empty()) {
    refuse(map.variable_count() == 0 ? "the map is empty: it has no poses to continue from"
                                     : "the map has landmarks alone: no poses to continue from");
  }
  std::ranges::sort(poses, {}, [&](int v) { return map.id(v); });
  return poses;
}

/// Where a pose is by odometry from a kept one.
PlacedState placed(const KeptPoses& kept, int from, const Motion& odometry) {
  const RigidGroup& group = *kept.group();
  return group.place(group.compose(kept.state(from), group.state(odometry.mean)));
}

/// The number that each kept pose has where these have left.
std::vector<int> numbers_without(const std::unordered_set<Id>& gone, const KeptPoses& kept) {
  std::vector<int> now;
  int left = 0;
  for (int k = 0; k < kept.size(); ++k) now.push_back(gone.contains(kept.id(k)) ? -1 : left++);
  return now;
}

/// The odometry to a pose and on from it, as one factor.
Factor joined_odometry(Id pose, const Factor& to, const Factor& on, const MotionGroup& motions,
                       CompositionOrder order) {
  const auto other = [&](const Factor& factor) {
    return factor.variables.front() == pose ? factor.variables.back() : factor.variables.front();
  };
  const Motion motion =
      motions.compose(motions.of_factor(to, other(to)), motions.of_factor(on, pose), order);
  return motions.to_factor(on.type, other(to), other(on), motion);
}

/// Whether variables are in one piece by these factors.
class Pieces {
 public:
  void join(const Factor& factor) {
    for (const Id id : factor.variables) parent_[root(factor.variables.front())] = root(id);
  }
  Id root(Id id) {
    parent_.try_emplace(id, id);
    while (parent_[id] != id) id = parent_[id] = parent_[parent_[id]];
    return id;
  }

 private:
  std::unordered_map<Id, Id> parent_;
};

}  // namespace

CompactGraph::CompactGraph(std::unique_ptr<Estimator> estimator, CompositionOrder order,
                           KeptMarginals marginals)
    : order_(order), kept_(std::move(estimator)), landmarks_(marginals), links_(order) {
  kept_.estimator().keep_marginals(marginals);
}

void CompactGraph::load(const Graph& map) {
  std::vector<int> order = poses_of(map);
  const Gauge gauge = resolve_gauge(map);
  if (gauge.components != 1) {
    refuse(
        fmt::format("the map has {} parts without a measurement between them; expected one, "
                    "since nothing is known of their relative position",
                    gauge.components));
  }
  auto group = std::make_unique<RigidGroup>(map.variable(order.front()).type);
  const std::size_t poses = order.size();
  for (int v = 0; v < map.variable_count(); ++v) {
    if (is_point(map.type(v))) order.push_back(v);
  }
  GraphUpdate update;
  for (const int v : order) update.variables.push_back(map.variable(v));
  for (int f = 0; f < map.factor_count(); ++f) update.factors.push_back(map.factor(f));
  kept_.update(update, {.full = true});
  kept_.set_group(std::move(group));
  for (std::size_t k = 0; k < order.size(); ++k) {
    const Variable& variable = update.variables[k];
    if (k < poses) {
      kept_.add(variable.id);
    } else {
      landmarks_.add(variable.id, variable.type);
    }
  }
  map_size_ = kept_.size();
  located_ = false;
  referenced_ = gauge.anchored.empty() && gauge.left_free.empty();
}

void CompactGraph::start(const Variable& pose, PolicySeconds& seconds) {
  const Timed timed(seconds.estimate);
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
  kept_.update(update);
  if (!kept_.group()) kept_.set_group(std::move(group));
  kept_.add(pose.id);
  newest_ = {.pose = std::move(first), .kept = true, .type = {}, .odometry = {}};
  set_anchor();
  refresh();
}

void CompactGraph::advance(const Variable& pose, const Motion& motion,
                           const std::shared_ptr<const FactorType>& type) {
  const MotionGroup& motions = group().motions();
  Newest next{.pose = pose, .type = type, .odometry = motion};
  next.predecessor = newest_.kept ? kept_.size() - 1 : newest_.predecessor;
  if (!newest_.kept) next.odometry = motions.compose(newest_.odometry, motion, order_);
  // While nothing has changed: whether it can be a factor where the pose is kept.
  (void)motions.to_factor(type, kept_.id(next.predecessor), pose.id, next.odometry);
  next.placed = placed(kept_, next.predecessor, next.odometry);
  chains_.step(pose.id, motion);
  if (newest_.kept) links_.ways().begin(newest_.pose.id);
  links_.ways().add_odometry(motion, motions, order_);
  newest_ = std::move(next);
  covariances_.advance(compose(group(), kept_.ahead(newest_.predecessor), newest_.odometry));
}

void CompactGraph::keep(PolicySeconds& seconds) {
  if (newest_.kept) return;
  const Id id = newest_.pose.id, from = kept_.id(newest_.predecessor);
  KeptPoses::Coming pose{
      .variable = newest_.pose,
      .odometry = group().motions().to_factor(newest_.type, from, id, newest_.odometry),
      .ahead = covariances_.ahead()};
  chains_.end(from, id);
  links_.close_way(id, Way::Became::odometry, kept_);
  kept_.add(std::move(pose), newest_.placed);
  newest_.kept = true;
  if (!newest_.pose.fixed) return;
  referenced_ = true;
  update({}, seconds);  // which is more than odometry
}

void CompactGraph::link(std::span<const Factor> links, PolicySeconds& seconds) {
  keep(seconds);
  links_.note(links, update(links, seconds));
}

void CompactGraph::see(std::vector<Variable> added, std::span<const Factor> factors,
                       PolicySeconds& seconds) {
  keep(seconds);
  update(factors, seconds, {}, std::move(added));
}

void CompactGraph::locate(int pose, const State& measured, std::span<const Factor> links,
                          PolicySeconds& seconds) {
  keep(seconds);
  update({}, seconds);  // now the estimator has everything
  const Timed timed(seconds.estimate);
  const State move = group().compose(group().compose(kept_.state(pose), measured),
                                     group().inverse(newest_.placed.x));
  move_poses(map_size_, move, links);
  located_ = true;
  refresh();
}

void CompactGraph::refer(const State& move, std::span<const Factor> priors,
                         PolicySeconds& seconds) {
  keep(seconds);
  update({}, seconds);
  const Timed timed(seconds.estimate);
  move_poses(0, move, priors);
  kept_.update({}, {.full = true});
  referenced_ = true;
  refresh();
}

/// Moves the poses from this number on, which have no factors with those before, and adds factors.
/// The estimator must have all of them.
void CompactGraph::move_poses(int first, const State& move, std::span<const Factor> factors) {
  const Estimator& estimator = kept_.estimator();
  GraphUpdate leaving, coming;
  for (int k = first; k < kept_.size(); ++k) {
    const Id id = kept_.id(k);
    const State moved = group().compose(move, kept_.state(k));
    const auto state = group().view(moved);
    leaving.removed_variables.push_back(id);
    coming.variables.push_back(
        {.type = estimator.type(id), .id = id, .state = {state.begin(), state.end()}});
  }
  if (first == 0) landmarks_.move(group().place(move).at, kept_, leaving, coming);
  std::unordered_map<FactorId, FactorId> now;
  for (const FactorId id : estimator.factors()) {
    Factor factor = estimator.factor(id);
    if (first > 0 && kept_.find(factor.variables.front()) < first) continue;
    now.emplace(id, std::ssize(coming.factors));
    coming.factors.push_back(std::move(factor));
  }
  const auto moved = std::ssize(coming.factors);
  coming.factors.insert(coming.factors.end(), factors.begin(), factors.end());
  kept_.update(leaving, {.defer = true});
  const UpdateReport report = kept_.update(coming);
  for (auto& [old, id] : now) id += report.first_factor;
  links_.renumber(now);  // those between poses of the map are where they were
  links_.note(factors, report.first_factor + moved);
  temporary_.forget_factors();
}

void CompactGraph::relocate(int pose, const Motion& measured, double of_way, double least_gain,
                            PolicySeconds& seconds) {
  const MotionGroup& motions = group().motions();
  Ways& ways = links_.ways();
  WayPart match{.motion = measured,
                .pose = newest_.pose.id,
                .kept = kept_.id(pose),
                .matched = true,
                .of_way = of_way};
  if (pose == newest_.predecessor) {  // another measurement of the same motion
    ways.open().parts.push_back(std::move(match));
    newest_.odometry = motions.fuse(newest_.odometry, measured);
    update({}, seconds);
    hang_newest();
    return;
  }
  Motion end = part_of(measured, of_way), start = part_of(measured, 1.0 - of_way);
  const int other = newest_.predecessor;
  const std::pair<int, int> ends = std::minmax(pose, other);
  Motion bridge = motions.compose(end, motions.inverse(newest_.odometry), order_);
  if (pose > other) bridge = motions.inverse(bridge);
  const auto gain = [&] {
    return mutual_information(to_matrix(bridge.covariance, group().tangent_size()),
                              between(ends.first, ends.second).covariance);
  };
  if ((full_ || temporary(other)) && !(gain() > least_gain)) {
    end = start = measured;
    match.divided = false;
  } else {
    make_permanent(other);
    ways.open().bridge = bridge;
    add_bridge(ends, std::move(bridge), seconds);
  }
  ways.open().end = match;
  links_.close_way(match.kept, match.divided ? Way::Became::bridge : Way::Became::nothing, kept_);
  ways.begin(match.kept, match);
  chains_.step(match.kept, motions.inverse(end), true);
  chains_.end(kept_.id(other), match.kept);
  // The next way begins at another pose than where this one ended.
  chains_.step(newest_.pose.id, start, true);
  newest_.predecessor = pose;
  newest_.odometry = start;
  hang_newest();
}

/// One factor between two poses, however often the robot goes from one to the other.
void CompactGraph::add_bridge(std::pair<int, int> ends, Motion motion, PolicySeconds& seconds) {
  const MotionGroup& motions = group().motions();
  const Id from = kept_.id(ends.first);
  if (Bridge* const known = links_.bridge(ends)) {
    motion = motions.fuse(known->motion, motion);
    update({}, seconds, {replaced(known->factor, from, motion, kept_)});
    known->motion = std::move(motion);
  } else {
    const Factor factor = motions.to_factor(newest_.type, from, kept_.id(ends.second), motion);
    const FactorId added = update({&factor, 1}, seconds);
    links_.add_bridge(ends, {added, std::move(motion)});
  }
}

/// Puts the newest pose, which is not kept, where its odometry from its predecessor says; that is
/// in the estimator, and the anchor from now on.
void CompactGraph::hang_newest() {
  set_anchor();
  newest_.placed = placed(kept_, newest_.predecessor, newest_.odometry);
  covariances_.estimate_changed();  // those with the anchor are with another pose now
}

/// Where the estimator has all that is kept.
void CompactGraph::set_anchor() {
  if (newest_.kept) {
    covariances_.set_anchor(kept_.size() - 1, {});
  } else {
    covariances_.set_anchor(newest_.predecessor, compose(group(), {}, newest_.odometry));
  }
}

bool CompactGraph::revoke(Id a, Id b, PolicySeconds& seconds) {
  if (!links_.has(a, b)) return false;
  update({}, seconds);  // now the estimator has everything
  const Timed timed(seconds.estimate);
  LinkRecord::Revocation revocation = links_.without(a, b, kept_, newest_.type);
  check_connected(a, b, revocation.update);
  const UpdateReport report = kept_.update(revocation.update);  // throws before anything changes
  const MotionGroup& motions = group().motions();
  Ways& ways = links_.ways();
  const bool open = revocation.ways && revocation.ways->open;
  if (const auto& change = revocation.ways)
    chains_.divide(*change, change->count > 0 ? &ways.all()[change->first] : nullptr, motions);
  links_.revoke(std::move(revocation), report.first_factor);
  if (open) {
    newest_.predecessor = kept_.find(ways.open().from);
    newest_.odometry = motion_of(ways.open(), motions, order_);
  }
  set_anchor();
  refresh();
  return true;
}

/// Of a trajectory on a map: a link may be all that connects the two.
void CompactGraph::check_connected(Id a, Id b, const GraphUpdate& leaving) const {
  if (map_size_ == 0 || !located_) return;
  const std::unordered_set<FactorId> gone(leaving.removed_factors.begin(),
                                          leaving.removed_factors.end());
  Pieces pieces;
  for (const FactorId id : kept_.estimator().factors()) {
    if (!gone.contains(id)) pieces.join(kept_.estimator().factor(id));
  }
  for (const Factor& factor : leaving.factors) pieces.join(factor);
  for (const Id id : kept_.ids()) {
    if (pieces.root(id) == pieces.root(kept_.id(0))) continue;
    refuse(
        fmt::format("the link of poses {} and {} is all that connects the trajectory to the "
                    "map, without it nothing is known of their relative position; expected "
                    "another link between the two first",
                    a, b));
  }
}

void CompactGraph::release(std::span<const Id> landmarks, PolicySeconds& seconds) {
  update({}, seconds);
  const Timed timed(seconds.estimate);
  landmarks_.leave_out(landmarks, kept_);
  kept_.update({});
  refresh();
}

CompactGraph::Leaving CompactGraph::make_room(PoseRemover& remover, int limit,
                                              std::span<const int> held, PolicySeconds& seconds) {
  update({}, seconds);  // now the estimator has everything
  const Timed timed(seconds.estimate);
  GraphUpdate staying;  // a remover leaves poses alone that something is about to be measured of
  Factor& factor = staying.factors.emplace_back();
  factor.variables = {kept_.id(kept_.size() - 1), kept_.id(map_size_)};
  if (!newest_.kept) factor.variables.push_back(kept_.id(newest_.predecessor));
  for (const int pose : held) factor.variables.push_back(kept_.id(pose));
  PoseRemover::Removal removal = remover.make_room(kept_.estimator(), limit, staying);
  const std::vector<Id>& poses = removal.update.removed_variables;
  if (poses.empty()) return {.poses = {}, .now = {}, .note = removal.note, .notes = removal.notes};
  const std::unordered_set<Id> gone(poses.begin(), poses.end());
  std::vector<Factor> removed;
  for (const FactorId id : removal.update.removed_factors)
    removed.push_back(kept_.estimator().factor(id));
  // Where landmarks are held by bearings, what takes the place of poses may not determine them.
  std::unique_ptr<Estimator> before = landmarks_.empty() ? nullptr : kept_.estimator().clone();
  const UpdateReport report = kept_.update(removal.update);
  if (before && !(report.ok && landmarks_.determined({}, kept_, gone))) {
    kept_.restore(std::move(before));
    return {.poses = {},
            .now = {},
            .note = fmt::format("more than {} poses stay for now: what would take the place of {} "
                                "others leaves poses or landmarks undetermined",
                                limit, poses.size())};
  }
  Leaving leaving{.poses = poses,
                  .now = numbers_without(gone, kept_),
                  .note = removal.note,
                  .notes = removal.notes};
  renumber(leaving, removal.update, removed, report.first_factor);
  chains_.join(gone);
  full_ = true;
  refresh();
  return leaving;
}

std::optional<CompactGraph::Leaving> CompactGraph::drop_temporary(
    const InformationLoss& most, const std::function<std::optional<Id>(int)>& cover,
    const std::function<bool(Id)>& needed, PolicySeconds& seconds) {
  update({}, seconds);
  const Timed timed(seconds.estimate);
  const auto followed = [&](Id id) {
    return id == kept_.id(kept_.size() - 1) ||
           (!newest_.kept && id == kept_.id(newest_.predecessor));
  };
  const std::optional<TemporaryPoses::Leaving> leaving = temporary_.judge(
      {.most = most, .cover = cover, .needed = needed, .followed = followed}, kept_);
  if (!leaving) return std::nullopt;
  return remove(*leaving);
}

/// With all that it measured.
CompactGraph::Leaving CompactGraph::remove(const TemporaryPoses::Leaving& pose) {
  GraphUpdate update, removal;
  std::vector<Factor> removed, odometry;
  for (const LinearFactor& f : pose.factors) {
    if (!f.is_on(pose.pose)) continue;
    removal.removed_factors.push_back(f.id);
    removed.push_back(f.factor);
    if (f.factor.type->is_relative()) odometry.push_back(f.factor);
  }
  if (pose.joined) {
    update.factors.push_back(
        joined_odometry(pose.pose, odometry[0], odometry[1], group().motions(), order_));
  }
  if (chains_.end_at(pose.pose)) {
    const Displacement there = between(kept_.find(pose.cover), kept_.find(pose.pose));
    chains_.recast(pose.pose, pose.cover, there, group());
  }
  removal.removed_variables = update.removed_variables = {pose.pose};
  const bool ok = kept_.update(update).ok;
  temporary_.remove(pose.pose);
  Leaving leaving{.poses = {pose.pose}, .now = numbers_without({pose.pose}, kept_)};
  renumber(leaving, removal, removed, 0);
  if (!ok || !landmarks_.determined({}, kept_)) landmarks_.restore_covariances({}, kept_);
  refresh();
  return leaving;
}

/// After poses have left, with the factors `removed`, and factors have come in their place.
void CompactGraph::renumber(const Leaving& leaving, const GraphUpdate& update,
                            std::span<const Factor> removed, FactorId first_factor) {
  const std::span<const int> now = leaving.now;
  links_.merge(update, removed);
  map_size_ -= static_cast<int>(std::ranges::count(now.first(map_size_), -1));
  kept_.renumber(now);
  if (newest_.predecessor >= 0) newest_.predecessor = now[newest_.predecessor];
  set_anchor();
  links_.renumber(update, first_factor, now, kept_);
}

/// Passes to the estimator what it does not have yet, and links. Returns the number of the first
/// of these.
FactorId CompactGraph::update(std::span<const Factor> links, PolicySeconds& seconds,
                              std::vector<ChangedFactor> changed, std::vector<Variable> added) {
  if (links.empty() && changed.empty() && kept_.solved() == kept_.size()) return 0;
  const Timed timed(seconds.estimate);
  GraphUpdate update = kept_.coming();
  const auto odometry = std::ssize(update.factors);
  update.factors.insert(update.factors.end(), links.begin(), links.end());
  update.changed = std::move(changed);
  update.variables.insert(update.variables.end(), added.begin(), added.end());
  const UpdateReport report = kept_.update(update);
  for (const Variable& landmark : added) landmarks_.add(landmark.id, landmark.type);
  if (!update.factors.empty()) temporary_.note_factors(report.first_factor);
  set_anchor();
  if (!landmarks_.empty() && !update.factors.empty()) {
    std::vector<Id> measured;
    for (const Factor& link : links)
      measured.insert(measured.end(), link.variables.begin(), link.variables.end());
    if (!report.ok || !landmarks_.determined(measured, kept_))
      landmarks_.restore_covariances(measured, kept_);
  }
  refresh();
  return report.first_factor + odometry;
}

bool CompactGraph::solve_fully() {
  PolicySeconds unattended;
  update({}, unattended);
  const UpdateReport report = kept_.update({}, {.full = true});
  refresh();
  return report.ok && report.converged;
}

/// Reads the estimate, which has changed.
void CompactGraph::refresh() {
  kept_.read_states();
  newest_.placed = newest_.kept ? kept_.placed(kept_.size() - 1)
                                : placed(kept_, newest_.predecessor, newest_.odometry);
  covariances_.estimate_changed();
}

int CompactGraph::factor_count() const {
  return kept_.estimator().factor_count() + (kept_.size() - kept_.solved());
}

std::vector<int> CompactGraph::near(double radius) const {
  std::vector<int> found = kept_.near(newest_.placed.at.t, radius);
  if (newest_.kept) std::erase(found, kept_.size() - 1);
  if (!located_) std::erase_if(found, [&](int pose) { return pose < map_size_; });
  return found;
}

void CompactGraph::prepare(std::span<const int> poses, PolicySeconds& seconds) {
  const Timed timed(seconds.covariances);
  covariances_.prepare(poses, kept_);
}

Displacement CompactGraph::displacement(int pose) const {
  Displacement d = group().displacement(kept_.placed(pose), newest_.placed);
  covariances_.set_covariance(pose, newest_.predecessor, newest_.odometry, kept_, d);
  return d;
}

Matrix CompactGraph::newest_covariance(PolicySeconds& seconds) {
  const Timed timed(seconds.covariances);
  return covariances_.newest(kept_);
}

Eigen::MatrixXd CompactGraph::landmark_covariance(std::span<const Id> landmarks,
                                                  PolicySeconds& seconds) {
  const Timed timed(seconds.covariances);
  std::vector<int> sizes;
  for (const Id id : landmarks) sizes.push_back(landmarks_.type(id)->tangent_size());
  return covariances_.joint({landmarks.begin(), landmarks.end()}, sizes, kept_);
}

Eigen::MatrixXd CompactGraph::joint_covariance(std::span<const int> poses, PolicySeconds& seconds) {
  update({}, seconds);
  const Timed timed(seconds.covariances);
  std::vector<Id> ids;
  for (const int pose : poses) ids.push_back(kept_.id(pose));
  const std::vector<int> sizes(poses.size(), group().tangent_size());
  return covariances_.joint(std::move(ids), sizes, kept_);
}

Eigen::MatrixXd CompactGraph::landmark_covariance(Id landmark, int pose, PolicySeconds& seconds) {
  update({}, seconds);
  const Timed timed(seconds.covariances);
  const std::array<Id, 2> ids{landmark, kept_.id(pose)};
  const Eigen::Index first = landmarks_.type(landmark)->tangent_size(), n = group().tangent_size();
  Eigen::MatrixXd joint(first + n, first + n);
  for (const auto& [of, column, size] :
       {std::tuple{ids[0], Eigen::Index{0}, first}, std::tuple{ids[1], first, n}}) {
    Eigen::MatrixXd block(first + n, size);
    need_covariance(kept_.estimator().covariance_column(
                        of, ids, {block.data(), static_cast<std::size_t>(block.size())}),
                    of);
    joint.middleCols(column, size) = block;
  }
  return joint;
}

Matrix CompactGraph::covariance(int pose) {
  PolicySeconds unattended;
  update({}, unattended);
  return kept_.covariance(pose, pose);
}

Displacement CompactGraph::between(int a, int b) {
  PolicySeconds unattended;
  update({}, unattended);
  return kept_.between(a, b);
}

}  // namespace cairn::compact
