// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/exploration.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/exploration/contacts.hpp"
#include "cairn/exploration/recorded_world.hpp"
#include "cairn/exploration/scan_clearance.hpp"
#include "cairn/grid/cell_traversal.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/runtime/result_fields.hpp"
#include "cairn/runtime/timed.hpp"
#include "end_notes.hpp"
#include "mapping_robot.hpp"
#include "run_limits.hpp"
#include "run_progress.hpp"
#include "way_back.hpp"

namespace cairn {
namespace {

/// So many of the newest scans show what is around the robot.
constexpr std::size_t kScansAround = 8;
/// Where the robot would touch what its path avoids, so many motions of this length follow it [m].
constexpr int kCarefulMotions = 6;
constexpr double kCarefulStep = 0.1;
/// Along one path, to pass by what would be touched.
constexpr int kMostSidesteps = 10;
/// Metres between two times that contacts are doubted.
constexpr double kBetweenDoubts = 5.0;

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

/// Where beams of the newest scan have ended within a motion's reach, and of those shortly before
/// it where it does not look, in the frame of the robot [m].
std::vector<Eigen::Vector2d> seen_around(const ScanSlam& slam, const RobotModel& robot) {
  const std::size_t count = slam.scans().size();
  const double aside = 0.5 * robot.lidar.aperture;
  const double reach = robot.step + 2.0 * robot.radius;
  std::vector<Eigen::Vector2d> around;
  for (std::size_t back = 1; back <= std::min(count, kScansAround); ++back) {
    const LaserScan& scan = slam.scans()[count - back];
    const Pose2 from = slam.pose().between(slam.poses()[count - back]);
    if (from.translation().norm() > scan.max_range + reach) continue;
    for (const Eigen::Vector2d& end : beam_ends(scan)) {
      const Eigen::Vector2d point = back == 1 ? end : from * Point2(end);
      const bool is_behind = std::abs(std::atan2(point.y(), point.x())) > aside;
      if (point.norm() < reach && (back == 1 || is_behind)) around.push_back(point);
    }
  }
  return around;
}

void check_known(const Exploration& parts, bool is_recorded) {
  const double known = parts.limits.known;
  if (!std::isfinite(known)) return;
  if (known > 1.0)
    throw Error(ErrorCode::usage,
                fmt::format("a run ends by the part of the floor that is known: {:g} is more than "
                            "all of it",
                            known));
  if (parts.reachable.empty() || is_recorded)
    throw Error(ErrorCode::usage,
                "a run ends by the part of the floor that is known only where it is known what "
                "the body can cover: of a simulated robot, on a floor");
}

/// Decides and drives, until the run ends.
class Run {
 public:
  explicit Run(const Exploration& parts)
      : parts_(parts),
        recorded_(query<RecordedWorld>(parts.world)),
        robot_(parts),
        contacts_(robot_.model().radius),
        limits_(parts.limits),
        progress_(parts.limits.idle_distance) {}

  ExplorationResult run() {
    check_known(parts_, recorded_ != nullptr);
    robot_.begin();
    if (recorded_)
      follow();
    else
      explore();
    return result();
  }

 private:
  struct End {
    ExplorationEnd how;
    std::string why;
  };

  /// A recorded robot goes where it went.
  void follow() {
    while (check_limits()) {
      if (recorded_->has_ended())
        end(ExplorationEnd::finished, "the recording is at its end");
      else
        robot_.move(Pose2(), decisions_);
    }
  }

  void explore() {
    progress_.discover(robot_.map(), robot_.driven());
    check_first_map();
    while (check_limits()) {
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

  void check_first_map() {
    const FloorMap& map = robot_.map();
    if (map.known_cells() == 0) {
      end(ExplorationEnd::stuck,
          "no beam of the first scan has measured anything, so that no floor is known");
    } else if (std::ranges::find(map.cells, CellState::free) == map.cells.end()) {
      end(ExplorationEnd::stuck,
          "the map of the first scan has no free floor: one scan has to be evidence enough (mapper "
          "log_odds: a larger `miss`, or `free` nearer to 0.5)");
    }
  }

  // The end ---------------------------------------------------------------------------------------

  void end(ExplorationEnd how, std::string why) { end_ = {how, std::move(why)}; }
  void end_interrupted() { end(ExplorationEnd::interrupted, "it was interrupted"); }
  bool is_interrupted() const { return parts_.interrupt && *parts_.interrupt; }

  /// False: the run is over.
  bool check_limits() {
    if (end_) return false;
    if (is_interrupted())
      end_interrupted();
    else if (const auto limit = limits_.reached(robot_, decisions_))
      end(ExplorationEnd::limit, *limit);
    else if (!recorded_)
      check_progress();
    return !end_;
  }

  void check_progress() {
    if (const auto stuck = progress_.why_stuck(robot_.driven()))
      end(ExplorationEnd::stuck, *stuck);
    else if (const auto refused = progress_.why_refused(); refused && !doubts_contacts())
      end(ExplorationEnd::stuck, *refused);
  }

  void note_once(const std::string& note) {
    if (std::ranges::find(notes_, note) == notes_.end()) notes_.push_back(note);
  }

  ExplorationResult result() {
    ExplorationResult result = robot_.finish();
    result.end = end_->how;
    result.why = end_->why;
    result.decision_seconds = std::move(decision_seconds_);
    result.decide_seconds = decide_seconds_;
    const RunFacts facts{.not_driven = not_driven_,
                         .turning_radius = robot_.model().turning_radius,
                         .longest_unmatched = robot_.longest_unmatched(),
                         .match_consecutive = parts_.match_consecutive,
                         .recorded = recorded_ != nullptr};
    for (const std::string& note : notes_of_end(result, facts)) note_once(note);
    result.notes = std::move(notes_);
    return result;
  }

  // Deciding --------------------------------------------------------------------------------------

  /// None: it was interrupted, so that what was decided is worth nothing.
  std::optional<Decision> decide() {
    const FloorMap& map = contacts_.seen_by(robot_.map(), robot_.driven());
    const std::vector<Id> kept = parts_.policy.kept();
    double seconds = 0.0;
    Decision decision = [&] {
      Timed timed(seconds);
      return call_plugin(
          [] { return std::string("explorer"); },
          [&] { return parts_.explorer.decide(robot_.situation(map, kept, decisions_)); });
    }();
    if (decision.kind == Decision::Kind::drive && !is_interrupted()) {
      Timed timed(seconds);
      make_drivable(decision, map);
    }
    if (is_interrupted()) return std::nullopt;
    ++decisions_;
    progress_.decide(robot_.driven());
    decide_seconds_ += seconds;
    decision_seconds_.push_back(seconds);
    for (const std::string& note : decision.notes) note_once(note);
    if (parts_.decided) parts_.decided(decision, robot_.situation(map, kept, decisions_));
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
          drivable_path(candidate.path, robot_.pose(), robot_.model(), map, parts_.interrupt);
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
    decision.candidates[wanted].path = way_back_.take(robot_.slam(), robot_.model().radius);
    retracing_ = true;
  }

  // Driving ---------------------------------------------------------------------------------------

  void drive(const PlannedPath& path) {
    std::size_t passed = 0;
    bool moved = false, refused = false, was_careful = false;
    int careful = 0, sidesteps = 0;
    while (check_limits()) {
      RobotModel robot = robot_.model();
      if (careful > 0) robot.step = std::min(robot.step, kCarefulStep);
      const std::size_t before = passed;
      std::optional<Pose2> motion = next_motion(robot_.pose(), path, robot, passed);
      if (!motion) break;
      const std::vector<Eigen::Vector2d> around = seen_around(robot_.slam(), robot_.model());
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
          beside = motion_beside(around, *motion, robot_.model());
        const bool has_other = path.radius > 0.0 || !progress_.is_refused_often();
        refused = refused || (!beside && has_other);
        if (refused) {
          if (robot.motion == MotionModel::dubins) make_room(around);
          break;
        }
        if (beside) motion = beside;
      }
      careful = std::max(careful, 1) - 1;
      moved = true;
      progress_.set_out(*motion);
      if (!move(*motion) || !goes_on(path, passed)) break;
    }
    progress_.end_path(moved, refused);
  }

  /// A robot that can't turn away from what is in its way goes back, where that is free.
  void make_room(std::span<const Eigen::Vector2d> around) {
    const RobotModel& robot = robot_.model();
    if (touched_points(around, Pose2(-robot.radius, 0.0, 0.0), robot).empty()) back_off();
  }

  /// What a motion would touch of these is an obstacle to paths from here on. Returns whether it
  /// was none before; none: the way is clear.
  std::optional<bool> foreseen_obstacle(const Pose2& motion,
                                        std::span<const Eigen::Vector2d> around) {
    const auto points = touched_points(around, motion, robot_.model());
    if (points.empty()) return std::nullopt;
    bool is_new = false;
    for (const Eigen::Vector2d& point : points)
      is_new |= contacts_.see(robot_.pose() * Point2(point), robot_.driven());
    return is_new;
  }

  /// Whether the rest of a path can be driven, and is worth it.
  bool goes_on(const PlannedPath& path, std::size_t passed) {
    const FloorMap& map = contacts_.seen_by(robot_.map(), robot_.driven());
    const double radius = path.radius > 0.0 ? path.radius : robot_.model().radius;
    if (!is_open(map, robot_.pose(), path, passed, radius)) return false;
    const std::vector<Id> kept = parts_.policy.kept();
    Timed timed(decide_seconds_);
    return call_plugin([] { return std::string("explorer"); },
                       [&] {
                         return parts_.explorer.is_worthwhile(
                             robot_.situation(map, kept, decisions_), path);
                       });
  }

  /// False: a new decision is needed.
  bool move(const Pose2& motion) {
    const MadeMotion made = robot_.move(motion, decisions_);
    progress_.discover(robot_.map(), robot_.driven());
    progress_.move(made, backing_off_, robot_.model().radius);
    if (made.driven() > kNoMotion && !retracing_) way_back_.add(robot_.slam().poses().size() - 2);
    const bool jumped = made.jump > robot_.map().frame.resolution;
    if (jumped) contacts_.forget();  // they were in another frame
    if (made.collided) {
      touch(motion, robot_.pose().theta() - made.odometry.theta());
      back_off();
    }
    return !made.collided && !jumped;
  }

  /// An obstacle has stopped a motion that began with a heading.
  void touch(const Pose2& motion, double heading) {
    const Eigen::Vector2d direction = Pose2(0.0, 0.0, heading) * motion.translation();
    if (direction.norm() == 0.0) return;
    contacts_.add(robot_.pose().translation(), direction, robot_.driven());
  }

  /// After a collision, since the same motion from the same place would end like it; and before
  /// one.
  void back_off() {
    if (std::exchange(backing_off_, true)) return;
    move(Pose2(-robot_.model().radius, 0.0, 0.0));
    backing_off_ = false;
  }

  /// What was touched may be all that is in the way, but not again where nothing else was tried.
  bool doubts_contacts() {
    if (robot_.driven() < next_doubt_ || !contacts_.doubt()) return false;
    next_doubt_ = robot_.driven() + kBetweenDoubts;
    return true;
  }

  const Exploration& parts_;
  RecordedWorld* recorded_;  // null: it explores
  MappingRobot robot_;
  Contacts contacts_;
  double next_doubt_ = 0.0;  // of contacts, so as to go on, no earlier [m driven]
  RunLimits limits_;
  RunProgress progress_;
  WayBack way_back_;
  bool backing_off_ = false;
  bool retracing_ = false;  // on its way back
  int decisions_ = 0;
  int not_driven_ = 0;  // paths
  std::vector<double> decision_seconds_;
  double decide_seconds_ = 0.0;
  std::vector<std::string> notes_;
  std::optional<End> end_;
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
