// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "cairn/exploration/path_planner.hpp"
#include "cairn/exploration/scan_slam.hpp"

namespace cairn {

/// The way that a robot has come: where it has driven it can drive back.
class WayBack {
 public:
  /// It drives on from where a scan was taken.
  void add(std::size_t scan) { scans_.push_back(scan); }
  /// Back along the way, by a metre at most, which is taken only once; from its start by `radius`,
  /// though the lidar may not look there.
  PlannedPath take(const ScanSlam& slam, double radius);

 private:
  std::vector<std::size_t> scans_;  // from which it has driven on and not come back
};

}  // namespace cairn
