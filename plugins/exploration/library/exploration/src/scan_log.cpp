// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/scan_log.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/core.h>

#include "cairn/io/format_by_ending.hpp"

namespace cairn {
namespace {

constexpr std::string_view kWhat = "scan logs";

}  // namespace

ScanLogFormat::~ScanLogFormat() = default;

ScanLog read_scan_log(std::string_view name, Registry& registry) {
  return with_format<ScanLogFormat>(name, kWhat, registry,
                                    [](ScanLogFormat& format, const std::filesystem::path& file) {
                                      return format.read(read_file(file), file.string());
                                    });
}

void write_scan_log(const ScanLog& log, std::string_view name, Registry& registry) {
  with_format<ScanLogFormat>(name, kWhat, registry,
                             [&](ScanLogFormat& format, const std::filesystem::path& file) {
                               write_file(file, format.write(log));
                             });
}

void check_scan_log_name(std::string_view name, Registry& registry) {
  with_format<ScanLogFormat>(name, kWhat, registry,
                             [](ScanLogFormat&, const std::filesystem::path&) {});
}

void check_scan_log(const LidarModel& lidar, std::string_view name, Registry& registry) {
  LoggedScan logged;
  logged.scan = {.first_angle = lidar.first_angle(),
                 .angle_step = lidar.step(),
                 .max_range = lidar.range,
                 .ranges = std::vector<float>(static_cast<std::size_t>(lidar.beams),
                                              static_cast<float>(lidar.range))};
  ScanLog log;
  log.scans.push_back(std::move(logged));
  with_format<ScanLogFormat>(name, kWhat, registry,
                             [&](ScanLogFormat& format, const std::filesystem::path&) {
                               static_cast<void>(format.write(log));
                             });
}

std::size_t next_scan(const ScanLog& log, std::size_t from, double step, double turn) {
  for (std::size_t k = from + 1; k < log.scans.size(); ++k) {
    const Pose2 motion = log.scans[from].odometry.between(log.scans[k].odometry);
    if (motion.translation().norm() >= step || std::abs(motion.theta()) >= turn) return k;
  }
  return log.scans.size();
}

void check_measurements(const ScanLog& log) {
  if (log.scans.empty()) throw Error(ErrorCode::input, "the log has no scans");
  const bool sees = std::ranges::any_of(
      log.scans, [](const LoggedScan& logged) { return measured_beams(logged.scan) > 0; });
  if (!sees) {
    throw Error(ErrorCode::input,
                fmt::format("no range of the {} scans of the log is a measurement: they are "
                            "missing, not above zero, or so long that they count as none",
                            log.scans.size()));
  }
}

}  // namespace cairn
