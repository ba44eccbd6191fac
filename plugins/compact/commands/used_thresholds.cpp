// SPDX-License-Identifier: BSD-3-Clause
#include "used_thresholds.hpp"

#include <array>
#include <string_view>
#include <vector>

#include <fmt/core.h>

namespace cairn::app {
namespace {

/// That are options of the command line.
constexpr std::array<std::string_view, 5> kNames{"range", "angle", "loop_gain", "pose_gain",
                                                 "gate"};

bool found_by_search(std::string_view name, const std::string& strategy) {
  if (name == "loop_gain") return strategy != "apal";
  if (name == "pose_gain") return strategy != "apal" && strategy != "apfl";
  return name != "gate";
}

}  // namespace

UsedThresholds used_thresholds(const OptionValues& given, const OptionValues& found,
                               const OptionTable& table) {
  UsedThresholds used{.options = found, .given = {}, .defaults = {}};
  for (const auto& [name, value] : given) {
    const OptionSpec* spec = table.find(name);
    if (!found.contains(name) && !(spec && spec->type == OptionType::real)) continue;
    used.options.insert_or_assign(name, value);
    used.given.insert(name);
  }
  for (const std::string_view name : kNames) {
    const OptionSpec* spec = table.find(name);
    if (spec && !used.options.contains(name)) used.defaults[spec->name] = spec->default_value;
  }
  return used;
}

std::string thresholds_line(const UsedThresholds& thresholds) {
  OptionValues all = thresholds.options;
  all.insert(thresholds.defaults.begin(), thresholds.defaults.end());
  std::string text;
  for (const auto& [name, value] : all) {
    if (name == "sensor") continue;
    text += fmt::format("{}{} {}{}", text.empty() ? "" : ", ", name, value,
                        thresholds.given.contains(name)      ? " (given)"
                        : thresholds.defaults.contains(name) ? " (default)"
                                                             : "");
  }
  return text;
}

std::string replaceable_defaults(const UsedThresholds& thresholds, const std::string& strategy) {
  std::vector<std::string_view> names;
  for (const std::string_view name : kNames) {
    if (thresholds.defaults.contains(name) && found_by_search(name, strategy))
      names.push_back(name);
  }
  std::string text;
  for (std::size_t k = 0; k < names.size(); ++k) {
    if (k > 0) text += k + 1 == names.size() ? " and " : ", ";
    text += names[k];
  }
  return text;
}

}  // namespace cairn::app
