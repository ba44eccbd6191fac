// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

namespace cairn::test {

/// JSON with blanks wherever there may be some, as another program may write it.
inline std::string spaced_json(std::string_view text) {
  std::string spaced;
  bool in_string = false, escaped = false;
  for (const char c : text) {
    const bool mark = !in_string && std::string_view("{}[]:,").find(c) != std::string_view::npos;
    spaced += mark ? std::string(" ") + c + " " : std::string(1, c);
    if (c == '"' && !escaped) in_string = !in_string;
    escaped = in_string && c == '\\' && !escaped;
  }
  return spaced;
}

}  // namespace cairn::test
