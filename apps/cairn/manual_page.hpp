// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "program.hpp"

namespace cairn::app {

/// "cairn-study-compact": the name of a command's page.
std::string manual_page_name(const CommandEntry& command);

/// The manual page of a command, or of the program: its help with what every command takes, exit
/// codes and environment, in the language of man (roff).
std::string manual_page(const Program& program, const CommandEntry& command);

}  // namespace cairn::app
