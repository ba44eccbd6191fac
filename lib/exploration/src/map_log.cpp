// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/map_log.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"

namespace cairn {

namespace {

/// From the earliest scan to the latest, whatever their order [s].
double duration(const ScanLog& log) {
  const auto [first, last] = std::ranges::minmax(log.scans, {}, &LoggedScan::stamp);
  return last.stamp - first.stamp;
}

}  // namespace

MappedLog map_log(const ScanLog& log, ScanSlam& slam, const MapLogOptions& options) {
  if (log.scans.empty()) throw Error(ErrorCode::input, "the log has no scans");
  const bool sees = std::ranges::any_of(
      log.scans, [](const LoggedScan& logged) { return measured_beams(logged.scan) > 0; });
  if (!sees) {
    throw Error(ErrorCode::input,
                fmt::format("no range of the {} scans of the log is a measurement: they are "
                            "missing, not above zero, or so long that they count as none",
                            log.scans.size()));
  }
  MappedLog result;
  result.duration = duration(log);
  const LoggedScan* last = &log.scans.front();
  slam.begin(last->odometry, last->scan, options.odometry, Pose2(options.step, 0.0, 0.0));
  result.scans = 1;
  for (std::size_t k = 1; k < log.scans.size(); ++k) {
    if (options.interrupt && *options.interrupt) {
      result.interrupted = true;
      break;
    }
    const LoggedScan& next = log.scans[k];
    const Pose2 motion = last->odometry.between(next.odometry);
    const double length = motion.translation().norm();
    if (length < options.step && std::abs(motion.theta()) < options.turn) continue;
    slam.add(motion, options.odometry.covariance(motion), next.scan);
    last = &next;
    ++result.scans;
    result.distance += length;
    if (options.progress) options.progress(k + 1);
  }
  result.converged = slam.finish();
  return result;
}

}  // namespace cairn
