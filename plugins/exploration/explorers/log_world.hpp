// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "cairn/exploration/recorded_world.hpp"
#include "cairn/exploration/scan_log.hpp"
#include "cairn/exploration/world.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/registry.hpp"

namespace cairn::exploration {

struct LogWorldOptions {
  std::string file;
  double step = 0.3, turn = 0.3;
  double sigma_xy = 0.01, sigma_theta = 0.005, relative = 0.2;
  double range_sigma = 0.01, radius = 0.2;

  static auto fields() {
    using O = LogWorldOptions;
    return OptionFields<O>()
        .text("file", &O::file, "the log: robot.clf, robot.clf.gz")
        .real("step", &O::step, 0.0, 1000.0,
              "a scan is taken once odometry has moved so far [m]; 0: every scan")
        .real("turn", &O::turn, 0.0, 3.2, "or has turned so far [rad]")
        .real("sigma_xy", &O::sigma_xy, 1e-6, 10.0, "error of odometry per step, each axis [m]")
        .real("sigma_theta", &O::sigma_theta, 1e-6, 1.0, "the same of the turn [rad]")
        .real("relative", &O::relative, 0.0, 1.0, "and as a part of the motion")
        .real("range_sigma", &O::range_sigma, 0.0, 10.0, "noise of ranges [m]")
        .real("radius", &O::radius, 0.01, 10.0, "of the robot's body [m]");
  }
};

/// A robot that goes where it went when its scans were recorded.
class LogWorld final : public World, public RecordedWorld {
 public:
  /// Reads the log, if one is named; else `robot` and `begin` throw `Error` (usage). Throws `Error`
  /// (input) if it has no measurement.
  LogWorld(const LogWorldOptions& options, Registry& registry);

  RobotModel robot() const override;
  LaserScan begin(const WorldStart& start) override;
  WorldStep move(const Pose2& motion) override;
  std::optional<Pose2> truth() const override;
  bool has_ended() const override { return next_ >= log_.scans.size(); }
  void* ability(std::string_view name) override;

 private:
  const LaserScan& first_scan() const;
  LogWorldOptions options_;
  ScanLog log_;
  std::size_t at_ = 0, next_ = 0;
};

}  // namespace cairn::exploration
