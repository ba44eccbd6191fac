// SPDX-License-Identifier: BSD-3-Clause
// A robot that drives on a floor of known walls.
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "cairn/exploration/dubins_curve.hpp"
#include "cairn/exploration/random_stream.hpp"
#include "cairn/exploration/world.hpp"
#include "cairn/grid/floor_survey.hpp"
#include "cairn/grid/ray_caster.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "log_world.hpp"

namespace cairn::exploration {
namespace {

using Eigen::Vector2d;

constexpr double kDegree = std::numbers::pi / 180.0;
/// Turns by less are none [rad].
constexpr double kStraight = 1e-9;

struct LidarBuildingOptions {
  double fov = 180.0;  // [°]
  int beams = 181;
  double range = 8.0, range_sigma = 0.01, dropouts = 0.0;
  double sigma_xy = 0.01, sigma_theta = 0.005, relative = 0.05;
  double radius = 0.2, step = 0.5, turn = 0.3;
  MotionModel motion = MotionModel::differential;
  double turning_radius = 0.5;
  std::string surveyor = "round_body";

  static auto fields() {
    using O = LidarBuildingOptions;
    return OptionFields<O>()
        .real("fov", &O::fov, 1.0, 360.0, "aperture of the lidar [°]")
        .integer("beams", &O::beams, 1, 100000, "of the lidar")
        .real("range", &O::range, 0.05, 1000.0, "within which the lidar sees anything [m]")
        .real("range_sigma", &O::range_sigma, 0.0, 10.0, "noise of ranges [m]")
        .real("dropouts", &O::dropouts, 0.0, 1.0, "part of the beams without a measurement")
        .real("sigma_xy", &O::sigma_xy, 1e-6, 10.0, "noise of odometry per step, each axis [m]")
        .real("sigma_theta", &O::sigma_theta, 1e-6, 1.0, "the same of the turn [rad]")
        .real("relative", &O::relative, 0.0, 1.0, "and as a part of the motion")
        .real("radius", &O::radius, 0.01, 10.0, "of the robot's round body [m]")
        .real("step", &O::step, 0.01, 100.0, "farthest that it drives between two scans [m]")
        .real("turn", &O::turn, 0.01, 3.14, "most that it turns between two scans [rad]")
        .choice("motion", &O::motion,
                "differential: turns in place, then drives ahead; holonomic: drives in any "
                "direction at once; dubins: drives ahead along arcs, or back, and can't turn in "
                "place")
        .real("turning_radius", &O::turning_radius, 0.01, 100.0,
              "least one, with motion=dubins [m]")
        .component<FloorSurveyor>("surveyor", &O::surveyor, "finds the start, or checks it");
  }
};

/// The distance between a point and the nearest point of a cell [cells].
double distance_to_cell(const Vector2d& point, int x, int y) {
  const Vector2d corner(x, y);
  const Vector2d nearest = point.cwiseMax(corner).cwiseMin(corner + Vector2d::Ones());
  return (point - nearest).norm();
}

class LidarBuilding final : public World {
 public:
  LidarBuilding(const LidarBuildingOptions& options, std::unique_ptr<FloorSurveyor> surveyor)
      : options_(options),
        surveyor_(std::move(surveyor)),
        model_{.radius = options.radius,
               .step = options.step,
               .turn = options.turn,
               .motion = options.motion,
               .turning_radius = options.turning_radius,
               .lidar = {.aperture = options.fov * kDegree,
                         .beams = options.beams,
                         .range = options.range,
                         .sigma = options.range_sigma},
               .odometry = {.absolute = {options.sigma_xy, options.sigma_xy, options.sigma_theta},
                            .relative = options.relative}},
        beams_(beam_directions(model_.lidar)),
        hits_(beams_.size()) {}

  RobotModel robot() const override { return model_; }

  LaserScan begin(const WorldStart& start) override {
    if (!start.floor)
      throw Error(ErrorCode::usage, "world lidar_building: needs a floor to drive on");
    FloorSurveyOptions survey{.radius = options_.radius};
    if (start.pose) survey.start = start.pose->translation();
    const FloorSurvey found = surveyor_->survey(*start.floor, survey);
    floor_ = *start.floor;
    rays_.emplace(floor_);
    odometry_noise_.emplace(start.seed, RandomStream::Purpose::odometry);
    lidar_noise_.emplace(start.seed, RandomStream::Purpose::lidar);
    const double heading = RandomStream(start.seed, RandomStream::Purpose::start)
                               .uniform(-std::numbers::pi, std::numbers::pi);
    truth_ = start.pose.value_or(Pose2(found.start.x(), found.start.y(), heading));
    return scan();
  }

  WorldStep move(const Pose2& motion) override {
    const Pose2 before = truth_;
    const std::optional<double> curvature = curvature_of(motion);
    double part;
    if (curvature) {
      const double length = std::abs(motion.theta()) > kStraight ? motion.theta() / *curvature
                                                                 : motion.translation().norm();
      const auto along = [&](double of) { return along_arc(*curvature, of * length); };
      part = free_part(length, [&](double of) { return truth_ * along(of).translation(); });
      truth_ = part < 1.0 ? before * along(part) : before * motion;
    } else {
      part = free_part(motion.translation());
      truth_ = before * Pose2(part * motion.x(), part * motion.y(), motion.theta());
    }
    const Pose2 moved = before.between(truth_);
    WorldStep step;
    step.collided = part < 1.0;
    step.covariance = model_.odometry.covariance(moved);
    const Eigen::Vector3d sigma = model_.odometry.sigma(moved);
    Eigen::Vector3d error;
    for (int k = 0; k < 3; ++k) error[k] = sigma[k] * odometry_noise_->gaussian();
    step.odometry = moved.retract(error);
    step.scan = scan();
    return step;
  }

  std::optional<Pose2> truth() const override { return truth_; }

 private:
  LaserScan scan() {
    const LidarModel& lidar = model_.lidar;
    LaserScan scan{.first_angle = lidar.first_angle(),
                   .angle_step = lidar.step(),
                   .max_range = lidar.range,
                   .ranges = {}};
    rays_->cast(truth_.translation(), truth_.theta(), beams_, lidar.range, hits_);
    scan.ranges.reserve(hits_.size());
    for (const RayHit& hit : hits_) {
      // As many random numbers for each beam, whatever it meets.
      const bool lost = lidar_noise_->chance(options_.dropouts);
      const double noise = lidar.sigma * lidar_noise_->gaussian();
      double range = hit.hit ? std::clamp(hit.range + noise, 1e-3, lidar.range) : lidar.range;
      if (lost) range = std::numeric_limits<double>::quiet_NaN();
      scan.ranges.push_back(static_cast<float>(range));
    }
    return scan;
  }

  /// Of the arc that a robot which can't turn in place drives, ahead or back; none: the motion is a
  /// straight one.
  std::optional<double> curvature_of(const Pose2& motion) const {
    if (model_.motion != MotionModel::dubins) return std::nullopt;
    const double chord = motion.translation().norm(), turn = motion.theta();
    const bool is_straight = std::abs(motion.y()) <= kStraight * chord;
    if (is_straight && std::abs(turn) <= kStraight) return std::nullopt;  // ahead or back
    const double curvature = chord > 0.0 ? 2.0 * motion.y() / (chord * chord) : 0.0;
    constexpr double kSlack = 1e-6;
    const auto turns_by = [&](double aside) { return std::abs(2.0 * aside - turn) <= kSlack; };
    const bool is_ahead = turns_by(std::atan2(motion.y(), motion.x()));
    if (!(chord > 0.0) || !(is_ahead || turns_by(std::atan2(-motion.y(), -motion.x()))) ||
        std::abs(curvature) * model_.turning_radius > 1.0 + kSlack) {
      throw Error(ErrorCode::usage,
                  fmt::format("world lidar_building: with motion=dubins the robot can't make the "
                              "motion {}: it drives along arcs of at least {:g} m "
                              "(turning_radius)",
                              to_string(motion), model_.turning_radius));
    }
    return curvature;
  }

  /// How much of a straight motion the body makes before it touches a cell that is not free.
  double free_part(const Vector2d& motion) const {
    const Vector2d from = floor_.frame.to_cells(truth_.translation());
    const Vector2d apart = floor_.frame.to_cells(truth_ * motion) - from;
    return free_part_of(apart.norm(), from,
                        [&](double part) -> Vector2d { return from + apart * part; });
  }

  /// The same of a motion of this length [m], `at` of which is a point for each part [m].
  template <class At>
  double free_part(double length, At&& at) const {
    return free_part_of(std::abs(length) / floor_.frame.resolution,
                        floor_.frame.to_cells(truth_.translation()),
                        [&](double part) -> Vector2d { return floor_.frame.to_cells(at(part)); });
  }

  /// The same in cells.
  template <class At>
  double free_part_of(double length, const Vector2d& from, At&& at) const {
    constexpr double kStride = 0.25;  // [cells]
    const int strides = std::max(1, static_cast<int>(std::ceil(length / kStride)));
    // A body that touches something already may move away from it.
    double room = clearance(from);
    for (int k = 1; k <= strides; ++k) {
      const double next = clearance(at(double(k) / strides));
      if (next < options_.radius && next < room) return double(k - 1) / strides;
      room = next;
    }
    return 1.0;
  }

  /// From a point [cells] to the nearest point of a cell that is not free [m], up to the body's
  /// radius and a cell.
  double clearance(const Vector2d& point) const {
    const GridFrame& frame = floor_.frame;
    const int reach = static_cast<int>(std::ceil(options_.radius / frame.resolution)) + 1;
    const int middle_x = static_cast<int>(std::floor(point.x()));
    const int middle_y = static_cast<int>(std::floor(point.y()));
    double least = reach;
    for (int y = middle_y - reach; y <= middle_y + reach; ++y) {
      for (int x = middle_x - reach; x <= middle_x + reach; ++x) {
        if (!is_free(x, y)) least = std::min(least, distance_to_cell(point, x, y));
      }
    }
    return least * frame.resolution;
  }

  bool is_free(int x, int y) const {
    return floor_.frame.contains(x, y) &&
           CellThresholds{}.state(floor_.occupancy[floor_.frame.index(x, y)]) == CellState::free;
  }

  LidarBuildingOptions options_;
  std::unique_ptr<FloorSurveyor> surveyor_;
  RobotModel model_;
  OccupancyGrid floor_;
  std::optional<RayCaster> rays_;
  std::vector<Vector2d> beams_;
  std::vector<RayHit> hits_;
  std::optional<RandomStream> odometry_noise_, lidar_noise_;
  Pose2 truth_;
};

}  // namespace
}  // namespace cairn::exploration

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  using namespace cairn::exploration;
  registrar.add<World>(
      "lidar_building", LidarBuildingOptions::fields().table(),
      [](const Options& given, Registry& registry) {
        const LidarBuildingOptions options = LidarBuildingOptions::fields().read(given);
        if (given.given("turning_radius") && options.motion != MotionModel::dubins) {
          throw Error(
              ErrorCode::usage,
              fmt::format("world lidar_building: turning_radius goes with motion=dubins, and the "
                          "robot is {}, which turns in place: add motion=dubins, or leave "
                          "turning_radius out",
                          to_string(options.motion)));
        }
        return std::make_unique<LidarBuilding>(options,
                                               registry.make<FloorSurveyor>(options.surveyor));
      });
  registrar.add<World, LogWorldOptions>("log",
                                        [](const LogWorldOptions& options, Registry& registry) {
                                          return std::make_unique<LogWorld>(options, registry);
                                        });
}
