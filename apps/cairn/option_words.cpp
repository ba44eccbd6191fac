// SPDX-License-Identifier: BSD-3-Clause
#include "option_words.hpp"

#include <array>
#include <string_view>
#include <utility>

namespace cairn::app {
namespace {

constexpr std::array<std::pair<std::string_view, std::string_view>, 5> kWords{{
    {"ReadOptions::skip_unknown", "--skip-unknown"},
    {"ReadOptions::repair_information", "--repair-information"},
    {"StampMatching::offset", "--offset"},
    {"StampMatching::max_difference", "--max-time-difference"},
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

}  // namespace cairn::app
