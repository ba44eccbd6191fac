// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/map_log.hpp"

#include <algorithm>

namespace cairn {

namespace {

/// From the earliest scan to the latest, whatever their order [s].
double duration(const ScanLog& log) {
  const auto [first, last] = std::ranges::minmax(log.scans, {}, &LoggedScan::stamp);
  return last.stamp - first.stamp;
}

}  // namespace

MappedLog map_log(const ScanLog& log, ScanSlam& slam, const MapLogOptions& options) {
  check_measurements(log);
  MappedLog result;
  result.duration = duration(log);
  std::size_t last = 0;
  slam.begin(log.scans.front().odometry, log.scans.front().scan, options.odometry,
             Pose2(options.step, 0.0, 0.0));
  result.scans = 1;
  while (true) {
    if (options.interrupt && *options.interrupt) {
      result.interrupted = true;
      break;
    }
    const std::size_t next = next_scan(log, last, options.step, options.turn);
    if (next == log.scans.size()) break;
    const Pose2 motion = log.scans[last].odometry.between(log.scans[next].odometry);
    slam.add(motion, options.odometry.covariance(motion), log.scans[next].scan);
    last = next;
    ++result.scans;
    result.distance += motion.translation().norm();
    if (options.progress) options.progress(next + 1);
  }
  result.converged = slam.finish();
  return result;
}

}  // namespace cairn
