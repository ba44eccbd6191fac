// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace cairn::app {

/// A message of a library in the words of the command line. Libraries name an option by the C++
/// member that it is ("ReadOptions::skip_unknown"); each of those stands behind an option of the
/// program, which is put in its place ("--skip-unknown").
std::string in_command_line_words(std::string message);

}  // namespace cairn::app
