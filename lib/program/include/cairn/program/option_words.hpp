// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace cairn::app {

/// A message of a library in the words of the command line. Libraries name an option by the C++
/// member that it is ("ReadOptions::skip_unknown"); each of those stands behind an option of the
/// program, which is put in its place ("--skip-unknown").
std::string in_command_line_words(std::string message);

/// The message about an option that a component does not have ("gauss_newton has no option
/// 'iterations'"), and the option of that name of the command, where there is one among `options`
/// ("--iterations"). Other messages stay as they are.
std::string with_option_of_command(std::string message, std::string_view command,
                                   std::span<const std::string> options);

}  // namespace cairn::app
