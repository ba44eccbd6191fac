// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace cairn::plot {

/// Throws `Error` (plugin), with what to install, where there is no Python, no matplotlib, or no
/// Python package cairn.
void check_python();

/// The bytes of a file in that format (svg, png, pdf) that `python3 -m cairn.plot` draws of the
/// numbers. Throws `Error` (usage or input) where it cannot draw them, (plugin) where Python fails.
///
/// The interpreter is $CAIRN_PYTHON; without it the one that the package cairn was built for, with
/// the package beside this plugin; without that python3.
std::string draw_by_python(const std::string& format, const std::string& numbers);

}  // namespace cairn::plot
