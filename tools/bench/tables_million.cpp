// SPDX-License-Identifier: BSD-3-Clause
// Tables of a million poses.
#include <numbers>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <boost/json/array.hpp>

#include "json_access.hpp"
#include "tables.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;

constexpr std::pair<std::string_view, std::string_view> kEstimates[] = {
    {"odometry", "odometry"},
    {"batch", "all poses and measurements, in batch"},
    {"live", "compact, each pose when it was the newest"},
    {"batch_at_kept", "all poses and measurements, in batch: of the poses kept"},
    {"kept", "compact: of the poses kept"}};

double degrees(double radians) { return radians * 180.0 / std::numbers::pi; }

}  // namespace

std::vector<Section> compact_million_sections(const json::array& entries) {
  MarkdownTable drive({"poses driven", "poses kept", "factors", "memory [MB]", "median step [ms]",
                       "99 %", "longest", "matches asked for, per pose", "poses that leave",
                       "ATE of the poses kept [m]"});
  MarkdownTable errors({"estimate", "poses", "ATE [m]", "[deg]"});
  for (const json::value& entry : entries) {
    if (text(entry, "part") == "drive") {
      drive.add({whole(number(entry, "poses")), whole(number(entry, "kept")),
                 whole(number(entry, "factors")), megabytes(number(entry, "memory")),
                 milliseconds(number(entry, "median")), milliseconds(number(entry, "p99")),
                 milliseconds(number(entry, "longest")), digits(number(entry, "asked")),
                 fmt::format("{:.2f} %", 100.0 * number(entry, "left")),
                 digits(number(entry, "ate"))});
      continue;
    }
    for (const auto& [name, title] : kEstimates) {
      if (text(entry, "name") != name) continue;
      errors.add({std::string(title), whole(number(entry, "poses")), digits(number(entry, "ate")),
                  digits(degrees(number(entry, "ate_rotation")))});
    }
  }
  return {{"compact-million", drive.text()}, {"compact-million-errors", errors.text()}};
}

}  // namespace cairn::performance
