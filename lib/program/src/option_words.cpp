// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/option_words.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/core.h>

namespace cairn::app {
namespace {

constexpr std::array<std::pair<std::string_view, std::string_view>, 8> kWords{{
    {"ReadOptions::skip_unknown", "--skip-unknown"},
    {"ReadOptions::repair_information", "--repair-information"},
    {"ReadOptions::unit_information", "--unit-information"},
    {"ReadOptions::skip_dangling", "--skip-dangling"},
    {"StampMatching::offset", "--offset"},
    {"StampMatching::max_difference", "--max-time-difference"},
    {"(begin=", "(--begin "},
    {"RecordingWriter", "cairn optimize --record"},
}};

}  // namespace

std::string in_command_line_words(std::string message) {
  for (const auto& [member, option] : kWords) {
    for (std::size_t at = 0; (at = message.find(member, at)) != std::string::npos;
         at += option.size()) {
      message.replace(at, member.size(), option);
    }
  }
  return message;
}

std::string with_option_of_command(std::string message, std::string_view command,
                                   std::span<const std::string> options) {
  constexpr std::string_view kBefore[] = {" has no option '", " takes no options, but '"};
  for (const std::string_view before : kBefore) {
    const std::size_t found = message.find(before);
    if (found == std::string::npos) continue;
    const std::size_t name = found + before.size(), end = message.find('\'', name);
    if (end == std::string::npos) continue;
    std::string option = "--" + message.substr(name, end - name);
    std::ranges::replace(option, '_', '-');
    if (std::ranges::find(options, option) == options.end()) continue;
    const std::string remedy = fmt::format("{} has {}", command, option);
    const bool in_middle = before == kBefore[0];
    return message.insert(in_middle ? end + 1 : message.size(),
                          (in_middle ? ", but " : "; ") + remedy);
  }
  return message;
}

}  // namespace cairn::app
