// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/exploration/laser_scan.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/component.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

class Registry;

/// A scan and where odometry had the lidar when it was taken.
struct LoggedScan {
  double stamp = 0.0;  ///< [s]
  Pose2 odometry;
  LaserScan scan;
};

struct ScanLog {
  std::vector<LoggedScan> scans;  ///< in the order of the file
};

/// A format of recorded scans.
class CAIRN_API ScanLogFormat : public Component {
 public:
  static constexpr std::string_view kKind = "scan_log";
  ~ScanLogFormat() override;

  /// File name endings without the dot.
  virtual std::vector<std::string> extensions() const = 0;
  /// Throws `Error` (input) with file and line for what cannot be read. `name`: for messages.
  virtual ScanLog read(std::string_view text, const std::string& name) = 0;
};

/// Reads a log, packed with gzip or not: `fr079.clf.gz`, or with options of its format
/// `fr079.clf.gz:range=20`. The format is that of the ending. Throws `Error` (usage, input).
CAIRN_API ScanLog read_scan_log(std::string_view name, Registry& registry);

}  // namespace cairn
