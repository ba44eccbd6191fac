// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/exploration.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <optional>
#include <span>
#include <utility>

#include <fmt/core.h>

#include "cairn/evaluation/normalized_error.hpp"
#include "cairn/evaluation/trajectory.hpp"
#include "cairn/exploration/contacts.hpp"
#include "cairn/exploration/discovered_floor.hpp"
#include "cairn/exploration/exploration_measures.hpp"
#include "cairn/exploration/recorded_world.hpp"
#include "cairn/exploration/scan_clearance.hpp"
#include "cairn/exploration/scan_slam.hpp"
#include "cairn/grid/cell_traversal.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/runtime/result_fields.hpp"
#include "cairn/runtime/timed.hpp"
#include "end_notes.hpp"

namespace cairn {
namespace {

/// So many motions in a row that move the robot by less than these, and so many decisions in a row
/// that lead to no motion: then it is stuck.
constexpr int kMostIdle = 20;
constexpr double kNoMotion = 0.005;  // [m], [rad]
constexpr int kMostEmptyDecisions = 3;
/// Paths in a row on which the robot would touch something before it has moved.
constexpr int kMostRefused = 60;
/// After so many it drives on one that is planned for the whole body all the same.
constexpr int kMostWideRefused = 30;
/// So many of the newest scans show what is around the robot.
constexpr std::size_t kScansAround = 8;
/// Where the robot would touch what its path avoids, so many motions of this length follow it [m].
constexpr int kCarefulMotions = 6;
constexpr double kCarefulStep = 0.1;
/// Along one path, to pass by what would be touched.
constexpr int kMostSidesteps = 10;
/// Collisions without a free motion in between.
constexpr int kMostCollisions = 10;
/// Of the way of one decision this part of `idle_distance` counts at most: on a large floor the way
/// to the next frontier alone may be longer than that.
constexpr double kMostOfOneWay = 0.2;

/// Whether a body can still go along what is left of a path, which may begin too near to an
/// obstacle.
bool is_open(const FloorMap& map, const Pose2& at, const PlannedPath& path, std::size_t passed,
             double radius) {
  const GridFrame& frame = map.frame;
  Eigen::Vector2d from = at.translation();
  bool leaving = true;
  for (std::size_t k = passed; k < path.points.size(); ++k) {
    const bool open =
        traverse_cells(frame.to_cells(from), frame.to_cells(path.points[k]), [&](int x, int y) {
          if (!frame.contains(x, y)) return false;
          const std::size_t index = frame.index(x, y);
          if (map.clearance[index] >= radius)
            leaving = false;
          else if (!leaving)
            return false;
          return map.cells[index] != CellState::occupied;
        });
    if (!open) return false;
    from = path.points[k];
  }
  return true;
}

double area_of(const GridFrame& grid) {
  return static_cast<double>(grid.size()) * grid.cell_area();
}

/// Metres between two times that contacts are doubted.
constexpr double kBetweenDoubts = 5.0;

class Run {
 public:
  explicit Run(const Exploration& parts)
      : parts_(parts),
        robot_(parts.world.robot()),
        recorded_(query<RecordedWorld>(parts.world)),
        slam_({.policy = parts.policy,
               .registration = parts.registration,
               .mapper = parts.mapper,
               .registry = parts.registry,
               .match_consecutive = parts.match_consecutive,
               .loop_loss = parts.loop_loss}),
        contacts_(robot_.radius) {}

  ExplorationResult run() {
    check_known();
    begin();
    if (recorded_)
      follow();
    else
      explore();
    finish();
    return std::move(result_);
  }

 private:
  void check_known() const {
    const double known = parts_.limits.known;
    if (!std::isfinite(known)) return;
    if (known > 1.0)
      throw Error(
          ErrorCode::usage,
          fmt::format("a run ends by the part of the floor that is known: {:g} is more than "
                      "all of it",
                      known));
    if (parts_.reachable.empty() || recorded_)
      throw Error(ErrorCode::usage,
                  "a run ends by the part of the floor that is known only where it is known what "
                  "the body can cover: of a simulated robot, on a floor");
  }

  void explore() {
    while (!ended_) {
      if (!check_limits()) break;
      const std::optional<Decision> decision = decide();
      if (!decision) {
        end_interrupted();
      } else if (decision->kind == Decision::Kind::drive) {
        drive(decision->candidates.at(decision->chosen).path);
        retracing_ = false;
      } else if (!doubts_contacts()) {
        end(decision->kind == Decision::Kind::finished ? ExplorationEnd::finished
                                                       : ExplorationEnd::stuck,
            decision->why);
      }
    }
  }

  /// A recorded robot goes where it went.
  void follow() {
    while (!ended_ && check_limits()) {
      if (recorded_->has_ended())
        end(ExplorationEnd::finished, "the recording is at its end");
      else
        move(Pose2());
    }
  }

  void begin() {
    LaserScan scan = parts_.world.begin(parts_.start);
    const std::optional<Pose2> truth = parts_.world.truth();
    log(Pose2(), scan, truth);
    slam_.begin(Pose2(), std::move(scan), robot_.odometry, Pose2(robot_.step, 0.0, 0.0), truth);
    parts_.explorer.begin(parts_.start.seed);
    record(0.0);
    if (recorded_) return;
    const FloorMap& map = slam_.map();
    if (map.known_cells() == 0) {
      end(ExplorationEnd::stuck,
          "no beam of the first scan has measured anything, so that no floor is known");
    } else if (std::ranges::find(map.cells, CellState::free) == map.cells.end()) {
      end(ExplorationEnd::stuck,
          "the map of the first scan has no free floor: one scan has to be evidence enough (mapper "
          "log_odds: a larger `miss`, or `free` nearer to 0.5)");
    }
  }

  void log(const Pose2& odometry, const LaserScan& scan, const std::optional<Pose2>& truth) {
    if (!parts_.log) return;
    auto& scans = parts_.log->scans;
    constexpr double kSecondsPerMotion = 1.0;  // a run has no clock
    scans.push_back({.stamp = kSecondsPerMotion * static_cast<double>(scans.size()),
                     .odometry = odometry,
                     .scan = scan,
                     .truth = truth});
  }

  void note_once(const std::string& note) {
    if (std::ranges::find(result_.notes, note) == result_.notes.end())
      result_.notes.push_back(note);
  }

  void record(double driven) {
    const FloorMap& map = slam_.map();
    const std::vector<Id> kept = parts_.policy.kept();
    // The map's grid grows, so that its entropy alone is over another area at each step.
    const double area = area_of(parts_.start.floor ? parts_.start.floor->frame : map.frame);
    ExplorationStep step{.step = static_cast<int>(result_.steps.size()),
                         .decision = decisions_,
                         .distance = driven,
                         .estimate = slam_.pose(),
                         .truth = truth_as_estimated(),
                         .coverage = map.coverage(),
                         .map_entropy = entropy_of_area(map.entropy(), area_of(map.frame), area),
                         .grid_area = area,
                         .trajectory_entropy = trajectory_entropy(parts_.policy.estimator(), kept,
                                                                  parts_.first_sigma),
                         .kept = static_cast<int>(kept.size()),
                         .loops = slam_.counts().loops,
                         .collisions = result_.collisions};
    if (!result_.steps.empty()) step.distance += result_.steps.back().distance;
    watch_progress(step);
    result_.steps.push_back(step);
    sample_map();
    if (parts_.moved) parts_.moved(step, map);
    if (parts_.scanned) parts_.scanned(step, situation(map, kept), slam_.scans().back());
  }

  /// Where the robot truly is, in the frame of the estimate.
  std::optional<Pose2> truth_as_estimated() {
    const std::optional<Pose2> truth = parts_.world.truth();
    if (!truth) return std::nullopt;
    if (!result_.start) {
      result_.start = *truth * slam_.pose().inverse();
      first_truth_ = truth->translation();
    }
    return result_.start->between(*truth);
  }

  /// Every so many metres.
  void sample_map() {
    const double driven = result_.steps.back().distance;
    const double next = static_cast<double>(result_.samples.size()) * parts_.sample_distance;
    if (!std::isfinite(next) || driven < next) return;
    result_.samples.push_back(
        map_sample(recovered_trajectory(parts_.policy, Recovery::distribute)));
  }

  MapSample map_sample(const Graph& estimate) {
    const FloorMap& map = slam_.map();
    return {.distance = result_.steps.back().distance,
            .coverage = map.coverage(),
            .error = contradicted_area(map, slam_.scans(), slam_.poses()),
            .against = beside_floor(estimate)};
  }

  /// None: the floor is not known, or not how the map lies on it.
  std::optional<MapTruth> beside_floor(const Graph& estimate) {
    if (!parts_.start.floor || !result_.start) return std::nullopt;
    const std::optional<Pose2> to_floor = alignment(estimate);
    if (!to_floor) return std::nullopt;
    return compare_with_floor(slam_.map(), *parts_.start.floor, *to_floor, first_truth_,
                              parts_.reachable);
  }

  // Deciding and driving --------------------------------------------------------------------------

  void end(ExplorationEnd how, std::string why) {
    ended_ = true;
    result_.end = how;
    result_.why = std::move(why);
  }

  bool is_interrupted() const { return parts_.interrupt && *parts_.interrupt; }
  void end_interrupted() { end(ExplorationEnd::interrupted, "it was interrupted"); }

  /// False: the run is over.
  bool check_limits() {
    const ExplorationLimits& limits = parts_.limits;
    if (is_interrupted()) {
      end_interrupted();
    } else if (result_.steps.back().distance >= limits.distance) {
      end(ExplorationEnd::limit, fmt::format("{:g} m are driven", limits.distance));
    } else if (result_.steps.back().step >= limits.steps) {
      end(ExplorationEnd::limit, fmt::format("{} motions are made", limits.steps));
    } else if (decisions_ >= limits.decisions) {
      end(ExplorationEnd::limit, fmt::format("{} decisions are made", limits.decisions));
    } else {
      check_discoveries();
      if (!ended_ && !recorded_) check_progress();
    }
    return !ended_;
  }

  void check_discoveries() {
    const ExplorationLimits& limits = parts_.limits;
    const ExplorationStep& last = result_.steps.back();
    constexpr double kBetweenLooks = 0.5;  // [m]
    if (std::isfinite(limits.known) && last.distance >= next_look_) {
      next_look_ = last.distance + kBetweenLooks;
      const auto against = beside_floor(recovered_trajectory(parts_.policy, Recovery::distribute));
      const double seen = against ? against->reachable_seen.value_or(0.0) : 0.0;
      if (seen >= limits.known)
        return end(ExplorationEnd::limit,
                   fmt::format("{:.1f} % of what the body can cover is seen", 100.0 * seen));
    }
    const double from = last.distance - ExplorationLimits::kRateDistance;
    if (!(limits.rate > 0.0) || from < 0.0) return;
    while (result_.steps[rate_from_ + 1].distance <= from) ++rate_from_;
    const ExplorationStep& before = result_.steps[rate_from_];
    const double rate = (last.coverage - before.coverage) / (last.distance - before.distance);
    if (rate < limits.rate)
      end(ExplorationEnd::limit, fmt::format("the last {:.0f} m brought {:.2f} m² of floor a metre",
                                             ExplorationLimits::kRateDistance, rate));
  }

  void check_progress() {
    const ExplorationLimits& limits = parts_.limits;
    if (idle_distance_ + idle_way() > limits.idle_distance) {
      end(ExplorationEnd::stuck, fmt::format("{:.0f} m were driven without finding more floor",
                                             result_.steps.back().distance - useful_distance_));
    } else if (collisions_in_row_ >= kMostCollisions) {
      end(ExplorationEnd::stuck, fmt::format("{} collisions in a row", kMostCollisions));
    } else if (idle_ >= kMostIdle) {
      end(ExplorationEnd::stuck, fmt::format("{} motions in a row were stopped", kMostIdle));
    } else if (empty_decisions_ >= kMostEmptyDecisions) {
      end(ExplorationEnd::stuck,
          fmt::format("{} decisions in a row led to no motion", kMostEmptyDecisions));
    } else if (refused_paths_ >= kMostRefused && !doubts_contacts()) {
      end(ExplorationEnd::stuck,
          fmt::format("on {} paths in a row something is in the way at once", kMostRefused));
    }
  }

  /// What counts of the way since the newest decision, as driven without progress [m].
  double idle_way() const {
    return std::min(result_.steps.back().distance - way_begin_,
                    kMostOfOneWay * parts_.limits.idle_distance);
  }

  /// None: it was interrupted, so that what was decided is worth nothing.
  std::optional<Decision> decide() {
    const FloorMap& map = contacts_.seen_by(slam_.map(), result_.steps.back().distance);
    const std::vector<Id> kept = parts_.policy.kept();
    double seconds = 0.0;
    Decision decision = [&] {
      Timed timed(seconds);
      return call_plugin([] { return std::string("explorer"); },
                         [&] { return parts_.explorer.decide(situation(map, kept)); });
    }();
    if (decision.kind == Decision::Kind::drive && !is_interrupted()) {
      Timed timed(seconds);
      make_drivable(decision, map);
    }
    if (is_interrupted()) return std::nullopt;
    ++decisions_;
    idle_distance_ += idle_way();
    way_begin_ = result_.steps.back().distance;
    result_.decide_seconds += seconds;
    result_.decision_seconds.push_back(seconds);
    for (const std::string& note : decision.notes) note_once(note);
    if (parts_.decided) parts_.decided(decision, situation(map, kept));
    return decision;
  }

  /// The chosen path as the robot can drive it, or that of the next best candidate which it can.
  void make_drivable(Decision& decision, const FloorMap& map) {
    std::vector<std::size_t> order(decision.candidates.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::stable_sort(order, {}, [&](std::size_t k) {
      return std::pair(k != decision.chosen, decision.candidates[k].value);
    });
    const std::size_t wanted = decision.chosen;
    for (const std::size_t k : order) {
      Candidate& candidate = decision.candidates[k];
      std::optional<PlannedPath> driven =
          drivable_path(candidate.path, slam_.pose(), robot_, map, parts_.interrupt);
      if (is_interrupted()) return;
      if (!driven) {
        ++not_driven_;
        continue;
      }
      candidate.path = std::move(*driven);
      decision.chosen = k;
      if (k != wanted)
        decision.why += fmt::format("; it can't follow that path: to {} instead", candidate.what);
      return;
    }
    if (order.empty()) return;
    doubts_contacts();
    decision.why += "; it can't follow that path, nor another: it goes back the way it came";
    decision.candidates[wanted].path = way_back();
    retracing_ = true;
  }

  /// Where the robot has driven it can drive, the other way round, which it does once; from its
  /// start it backs by its radius, though the lidar may not look there.
  PlannedPath way_back() {
    constexpr double kLength = 1.0;  // [m]
    Pose2 at = slam_.pose();
    PlannedPath path{.points = {at.translation()}};
    double way = 1.0;
    while (!trail_.empty() && path.length < kLength) {
      const Pose2 from = slam_.poses()[trail_.back()];
      trail_.pop_back();
      const Pose2 motion = from.between(at);
      const double back = motion.x() < 0.0 ? 1.0 : -1.0;
      if (std::exchange(way, back) != back) path.cusps.push_back(path.points.size() - 1);
      constexpr int kParts = 4;
      for (int part = kParts; part-- > 0;)
        path.points.push_back(from.retract(motion.log() * (double(part) / kParts)).translation());
      path.length += motion.translation().norm();
      at = from;
    }
    if (path.length >= robot_.radius) return path;
    const Eigen::Vector2d behind = slam_.pose() * Point2(-robot_.radius, 0.0);
    return {.points = {slam_.pose().translation(), behind}, .length = robot_.radius, .cusps = {0}};
  }

  Situation situation(const FloorMap& map, std::span<const Id> kept) {
    MatchModel match = parts_.match;
    match.loop_gain = parts_.policy.link_gain().value_or(match.loop_gain);
    return {.estimator = parts_.policy.estimator(),
            .poses = kept,
            .pose = slam_.pose(),
            .map = map,
            .robot = robot_,
            .decision = decisions_,
            .match = match,
            .first_sigma = parts_.first_sigma,
            .budget = parts_.decision_budget,
            .interrupt = parts_.interrupt};
  }

  void drive(const PlannedPath& path) {
    std::size_t passed = 0;
    bool moved = false, refused = false, was_careful = false;
    int careful = 0, sidesteps = 0;
    while (check_limits()) {
      RobotModel robot = robot_;
      if (careful > 0) robot.step = std::min(robot_.step, kCarefulStep);
      const std::size_t before = passed;
      std::optional<Pose2> motion = next_motion(slam_.pose(), path, robot, passed);
      if (!motion) break;
      const std::vector<Eigen::Vector2d> around = seen_around();
      if (const std::optional<bool> is_new = foreseen_obstacle(*motion, around)) {
        refused = *is_new;
        if (!refused && !was_careful) {
          // Paths avoid what is known: it would cut a corner.
          was_careful = true;
          careful = kCarefulMotions;
          passed = before;
          continue;
        }
        // Paths through narrow gaps lead along the middles of cells: it may pass nearer to the
        // middle of the gap.
        std::optional<Pose2> beside;
        if (!refused && sidesteps++ < kMostSidesteps)
          beside = motion_beside(around, *motion, robot_);
        const bool has_other = path.radius > 0.0 || refused_paths_ < kMostWideRefused;
        refused = refused || (!beside && has_other);
        if (refused) {
          if (robot_.motion == MotionModel::dubins) make_room(around);
          break;
        }
        if (beside) motion = beside;
      }
      careful = std::max(careful, 1) - 1;
      moved = true;
      if (motion->translation().norm() > kNoMotion) refused_paths_ = 0;
      if (!move(*motion) || !goes_on(path, passed)) break;
    }
    empty_decisions_ = moved || refused ? 0 : empty_decisions_ + 1;
    refused_paths_ += refused;
  }

  /// A robot that can't turn away from what is in its way goes back, where that is free.
  void make_room(std::span<const Eigen::Vector2d> around) {
    if (touched_points(around, Pose2(-robot_.radius, 0.0, 0.0), robot_).empty()) back_off();
  }

  /// Where beams of the newest scan have ended within a motion's reach, and of those shortly before
  /// it where it does not look, in the frame of the robot [m].
  std::vector<Eigen::Vector2d> seen_around() const {
    const std::size_t count = slam_.scans().size();
    const double aside = 0.5 * robot_.lidar.aperture;
    const double reach = robot_.step + 2.0 * robot_.radius;
    std::vector<Eigen::Vector2d> around;
    for (std::size_t back = 1; back <= std::min(count, kScansAround); ++back) {
      const LaserScan& scan = slam_.scans()[count - back];
      const Pose2 from = slam_.pose().between(slam_.poses()[count - back]);
      if (from.translation().norm() > scan.max_range + reach) continue;
      for (const Eigen::Vector2d& end : beam_ends(scan)) {
        const Eigen::Vector2d point = back == 1 ? end : from * Point2(end);
        const bool is_behind = std::abs(std::atan2(point.y(), point.x())) > aside;
        if (point.norm() < reach && (back == 1 || is_behind)) around.push_back(point);
      }
    }
    return around;
  }

  /// What a motion would touch of these is an obstacle to paths from here on. Returns whether it
  /// was none before; none: the way is clear.
  std::optional<bool> foreseen_obstacle(const Pose2& motion,
                                        std::span<const Eigen::Vector2d> around) {
    const auto points = touched_points(around, motion, robot_);
    if (points.empty()) return std::nullopt;
    bool is_new = false;
    for (const Eigen::Vector2d& point : points)
      is_new |= contacts_.see(slam_.pose() * Point2(point), result_.steps.back().distance);
    return is_new;
  }

  /// Whether the rest of a path can be driven, and is worth it.
  bool goes_on(const PlannedPath& path, std::size_t passed) {
    const FloorMap& map = contacts_.seen_by(slam_.map(), result_.steps.back().distance);
    const double radius = path.radius > 0.0 ? path.radius : robot_.radius;
    if (!is_open(map, slam_.pose(), path, passed, radius)) return false;
    const std::vector<Id> kept = parts_.policy.kept();
    Timed timed(result_.decide_seconds);
    return call_plugin([] { return std::string("explorer"); },
                       [&] { return parts_.explorer.is_worthwhile(situation(map, kept), path); });
  }

  /// False: a new decision is needed.
  bool move(const Pose2& motion) {
    const std::optional<Pose2> from = parts_.world.truth();
    WorldStep step = parts_.world.move(motion);
    result_.collisions += step.collided;
    const std::optional<Pose2> to = parts_.world.truth();
    // Odometry that is noisy adds up to more than was driven.
    const Pose2 moved = from && to ? from->between(*to) : step.odometry;
    const double driven = moved.translation().norm();
    const bool idle = std::max(driven, std::abs(moved.theta())) < kNoMotion;
    idle_ = idle ? idle_ + 1 : 0;
    if (!step.collided && !backing_off_ && driven > robot_.radius) collisions_in_row_ = 0;
    if (parts_.log && !parts_.log->scans.empty())
      log(parts_.log->scans.back().odometry * step.odometry, step.scan, to);
    const Pose2 expected = slam_.pose() * step.odometry;
    slam_.add(step.odometry, step.covariance, std::move(step.scan), to);
    watch_matches(driven);
    if (driven > kNoMotion && !retracing_) trail_.push_back(slam_.poses().size() - 2);
    record(driven);
    const double jump = (slam_.pose().translation() - expected.translation()).norm();
    if (jump > slam_.map().frame.resolution) contacts_.forget();  // they were in another frame
    if (step.collided) {
      touch(motion, slam_.pose().theta() - step.odometry.theta());
      if (!backing_off_) ++collisions_in_row_;
      back_off();
    }
    return !step.collided && jump <= slam_.map().frame.resolution;
  }

  /// How far the robot drives between two scans that are matched with another one.
  void watch_matches(double driven) {
    const int matched = slam_.counts().consecutive + slam_.counts().loops;
    unmatched_ = matched > std::exchange(matched_, matched) ? 0.0 : unmatched_ + driven;
    longest_unmatched_ = std::max(longest_unmatched_, unmatched_);
  }

  /// What was touched may be all that is in the way, but not again where nothing else was tried.
  bool doubts_contacts() {
    const double driven = result_.steps.back().distance;
    if (driven < next_doubt_ || !contacts_.doubt()) return false;
    next_doubt_ = driven + kBetweenDoubts;
    return true;
  }

  /// An obstacle has stopped a motion that began with a heading.
  void touch(const Pose2& motion, double heading) {
    const Eigen::Vector2d direction = Pose2(0.0, 0.0, heading) * motion.translation();
    if (direction.norm() == 0.0) return;
    contacts_.add(slam_.pose().translation(), direction, result_.steps.back().distance);
  }

  /// After a collision, since the same motion from the same place would end like it; and before
  /// one.
  void back_off() {
    if (std::exchange(backing_off_, true)) return;
    move(Pose2(-robot_.radius, 0.0, 0.0));
    backing_off_ = false;
  }

  void watch_progress(const ExplorationStep& step) {
    if (recorded_ || !discovered_.grows(slam_.map())) return;
    idle_distance_ = 0.0;
    way_begin_ = useful_distance_ = step.distance;
  }

  // The end ---------------------------------------------------------------------------------------

  void finish() {
    result_.converged = slam_.finish();
    result_.map = slam_.map();
    result_.slam = slam_.counts();
    result_.graph = parts_.policy.estimator().graph();
    result_.trajectory = recovered_trajectory(parts_.policy, Recovery::distribute);
    result_.truth_trajectory = slam_.truth().clone();
    result_.samples.push_back(map_sample(result_.trajectory));
    result_.map_error = result_.samples.back().error;
    result_.against = result_.samples.back().against;
    Estimator& estimator = parts_.policy.estimator();
    std::vector<Id> kept = parts_.policy.kept();
    std::ranges::sort(kept);
    result_.expected_ate = expected_ate(estimator, estimator.graph(), evenly_spread(kept));
    const RunFacts facts{.not_driven = not_driven_,
                         .turning_radius = robot_.turning_radius,
                         .longest_unmatched = longest_unmatched_,
                         .match_consecutive = parts_.match_consecutive,
                         .recorded = recorded_ != nullptr};
    for (const std::string& note : notes_of_end(result_, facts)) note_once(note);
  }

  /// From the world of the estimate to that of the floor; none: the true poses do not determine it.
  std::optional<Pose2> alignment(const Graph& estimate) const {
    constexpr int kFewest = 3;  // poses that determine one
    const auto known = slam_.truth().variable_count();
    if (known < kFewest) {
      // Of a run that has just begun the first pose does.
      return known == estimate.variable_count() ? result_.start : std::nullopt;
    }
    const Pose pose = align(pair_by_id(trajectory(estimate), trajectory(slam_.truth())));
    return Pose2(pose.t.x(), pose.t.y(), std::atan2(pose.R(1, 0), pose.R(0, 0)));
  }

  const Exploration& parts_;
  RobotModel robot_;
  RecordedWorld* recorded_;  // null: it explores
  ScanSlam slam_;
  Contacts contacts_;
  ExplorationResult result_;
  Eigen::Vector2d first_truth_ = Eigen::Vector2d::Zero();  // position [m], with `result_.start`
  bool ended_ = false, backing_off_ = false;
  double next_doubt_ = 0.0;         // of contacts, so as to go on, no earlier [m driven]
  int not_driven_ = 0;              // paths
  bool retracing_ = false;          // on its way back
  std::vector<std::size_t> trail_;  // scans from which it has driven on and not come back
  int decisions_ = 0, empty_decisions_ = 0, refused_paths_ = 0, idle_ = 0, collisions_in_row_ = 0;
  double next_look_ = 0.0;                            // at what is known, no earlier [m driven]
  std::size_t rate_from_ = 0;                         // the step that many metres ago
  int matched_ = 0;                                   // scans, with one before
  double unmatched_ = 0.0, longest_unmatched_ = 0.0;  // driven between two of them [m]
  DiscoveredFloor discovered_;
  // What counts as driven without progress; where the newest way began, and progress ended [m].
  double idle_distance_ = 0.0, way_begin_ = 0.0, useful_distance_ = 0.0;
};

}  // namespace

std::string_view to_string(ExplorationEnd end) {
  constexpr std::array<std::string_view, 4> kNames{"finished", "limit", "stuck", "interrupted"};
  return kNames[static_cast<std::size_t>(end)];
}

ExplorationResult run_exploration(const Exploration& parts) { return Run(parts).run(); }

ResultFields<ExplorationStep> ExplorationStep::fields() {
  using S = ExplorationStep;
  const auto true_pose = [](auto coordinate) {
    return [coordinate](const S& s) -> std::optional<double> {
      if (!s.truth) return std::nullopt;
      return std::invoke(coordinate, *s.truth);
    };
  };
  return ResultFields<S>()
      .figure("step", &S::step, "how many motions there were")
      .figure("decision", &S::decision, "how many decisions there were")
      .figure("distance", &S::distance, "m", "driven so far: as it truly was, else by odometry")
      .figure(
          "estimate.x", [](const S& s) { return s.estimate.x(); }, "m",
          "where the robot is, as estimated")
      .column("x")
      .figure(
          "estimate.y", [](const S& s) { return s.estimate.y(); }, "m",
          "where the robot is, as estimated")
      .column("y")
      .figure(
          "estimate.theta", [](const S& s) { return s.estimate.theta(); }, "rad",
          "its heading, as estimated")
      .column("theta")
      .figure("truth.x", true_pose(&Pose2::x), "m", "where it truly is, in the same frame")
      .column("true_x")
      .figure("truth.y", true_pose(&Pose2::y), "m", "where it truly is, in the same frame")
      .column("true_y")
      .figure("truth.theta", true_pose(&Pose2::theta), "rad", "its true heading")
      .column("true_theta")
      .figure("coverage", &S::coverage, "m²", "of the cells that are known")
      .figure("map_entropy", &S::map_entropy, "nats·m²",
              "over the floor's grid or, where that is not known, the map's")
      .figure("grid_area", &S::grid_area, "m²", "of that grid, known or not")
      .figure("trajectory_entropy", &S::trajectory_entropy, "nats", "of the trajectory (5.13)")
      .figure("kept", &S::kept, "poses that are kept")
      .figure("loops", &S::loops, "loop closures in the graph")
      .figure("collisions", &S::collisions, "collisions so far");
}

}  // namespace cairn
