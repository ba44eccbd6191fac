// SPDX-License-Identifier: BSD-3-Clause
#include "log_world.hpp"

#include <utility>

#include "cairn/runtime/error.hpp"

namespace cairn::exploration {

LogWorld::LogWorld(const LogWorldOptions& options, Registry& registry) : options_(options) {
  if (options.file.empty()) return;
  log_ = read_scan_log(options.file, registry);
  try {
    check_measurements(log_);
  } catch (const Error& error) {
    throw Error(error.code(), options.file + ": " + error.what());
  }
}

const LaserScan& LogWorld::first_scan() const {
  if (log_.scans.empty()) {
    throw Error(
        ErrorCode::usage,
        "world log: no log is named; name one with log:file=robot.clf or file=robot.clf.gz");
  }
  return log_.scans.front().scan;
}

RobotModel LogWorld::robot() const {
  const LaserScan& scan = first_scan();
  return {.radius = options_.radius,
          .step = options_.step,
          .turn = options_.turn,
          .lidar = {.aperture = scan.angle_step * static_cast<double>(scan.ranges.size() - 1),
                    .beams = static_cast<int>(scan.ranges.size()),
                    .range = scan.max_range,
                    .sigma = options_.range_sigma},
          .odometry = {.absolute = {options_.sigma_xy, options_.sigma_xy, options_.sigma_theta},
                       .relative = options_.relative}};
}

LaserScan LogWorld::begin(const WorldStart&) {
  const LaserScan& first = first_scan();
  at_ = 0;
  next_ = next_scan(log_, at_, options_.step, options_.turn);
  return first;
}

WorldStep LogWorld::move(const Pose2&) {
  if (has_ended())
    throw Error(ErrorCode::usage, "world log: there is no further scan in " + options_.file);
  const LoggedScan& next = log_.scans[next_];
  WorldStep step;
  step.odometry = log_.scans[at_].odometry.between(next.odometry);
  step.covariance = robot().odometry.covariance(step.odometry);
  step.scan = next.scan;
  at_ = std::exchange(next_, next_scan(log_, next_, options_.step, options_.turn));
  return step;
}

std::optional<Pose2> LogWorld::truth() const {
  return at_ < log_.scans.size() ? log_.scans[at_].truth : std::nullopt;
}

void* LogWorld::ability(std::string_view name) {
  return name == RecordedWorld::kAbility ? static_cast<RecordedWorld*>(this) : nullptr;
}

}  // namespace cairn::exploration
