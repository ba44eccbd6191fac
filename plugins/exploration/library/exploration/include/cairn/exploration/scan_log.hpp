// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
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
  std::optional<Pose2> truth = {};  ///< where the lidar truly was, if the log has that
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
  /// The text of a log, from which `read` has the same scans, if its options trust the lidar as far
  /// as it sees. Throws `Error` (usage) for what the format cannot hold.
  virtual std::string write(const ScanLog& log) = 0;
};

/// Reads a log, packed with gzip or not: `fr079.clf.gz`, or with options of its format
/// `fr079.clf.gz:range=20`. The format is that of the ending. Throws `Error` (usage, input).
CAIRN_API ScanLog read_scan_log(std::string_view name, Registry& registry);
/// The inverse; packed with gzip where the name ends in .gz. Throws `Error` (usage, input).
CAIRN_API void write_scan_log(const ScanLog& log, std::string_view name, Registry& registry);
/// Throws `Error` (usage) unless a format goes by that ending.
CAIRN_API void check_scan_log_name(std::string_view name, Registry& registry);
/// The same, and unless that format can hold scans of such a lidar.
CAIRN_API void check_scan_log(const LidarModel& lidar, std::string_view name, Registry& registry);

/// The first scan behind number `from` before which odometry has moved by `step` [m] or turned by
/// `turn` [rad], or more; the number of scans if there is none.
CAIRN_API std::size_t next_scan(const ScanLog& log, std::size_t from, double step, double turn);
/// Throws `Error` (input) for a log without scans, and for one without a measurement.
CAIRN_API void check_measurements(const ScanLog& log);

}  // namespace cairn
