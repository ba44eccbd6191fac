// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/scan_log.hpp"

#include "cairn/io/format_by_ending.hpp"

namespace cairn {

ScanLogFormat::~ScanLogFormat() = default;

ScanLog read_scan_log(std::string_view name, Registry& registry) {
  return with_format<ScanLogFormat>(name, "scan logs", registry,
                                    [](ScanLogFormat& format, const std::filesystem::path& file) {
                                      return format.read(read_file(file), file.string());
                                    });
}

}  // namespace cairn
