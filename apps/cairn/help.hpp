// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "program.hpp"

namespace cairn::app {

/// "cairn generate [OPTIONS] KIND -o OUT": the arguments and options that a command must be given.
std::string usage_line(const CommandEntry& command);

/// Help that fits a screen: at most 40 lines of 100 columns. One line per option, with its default
/// in brackets; a command's help also names the options that every command takes.
std::string help_text(const Program& program, const CommandEntry& command);

}  // namespace cairn::app
