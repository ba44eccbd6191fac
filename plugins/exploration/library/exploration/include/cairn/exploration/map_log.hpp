// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>

#include "cairn/exploration/scan_log.hpp"
#include "cairn/exploration/scan_slam.hpp"
#include "cairn/exploration/world.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

struct MapLogOptions {
  double step = 0.3;  ///< a scan is taken once the robot has moved so far [m]
  double turn = 0.3;  ///< or has turned so far [rad]
  OdometryModel odometry{.absolute = {0.01, 0.01, 0.005},
                         .relative = 0.2};  ///< wheels on real floors slip
  const std::atomic<bool>* interrupt = nullptr;
  /// Called after each scan that was taken, with how many of the log are behind it.
  std::function<void(std::size_t read)> progress = {};
};

struct MappedLog {
  std::size_t scans = 0;  ///< of the log that were taken
  double distance = 0.0;  ///< driven, as odometry has it [m]
  double duration = 0.0;  ///< of the log [s]
  bool interrupted = false;
  bool converged = true;
};

/// Runs the scans of a log through a `ScanSlam` that has not begun: as fast as it can, in the order
/// of the log. The first pose is that of odometry. Throws `Error` (input) for a log without scans.
CAIRN_API MappedLog map_log(const ScanLog& log, ScanSlam& slam, const MapLogOptions& options);

}  // namespace cairn
