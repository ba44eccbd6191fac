// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

#include "arguments.hpp"

namespace cairn::app {

/// `--latex FILE` of a command whose results are a `Table`; see `Table::latex`.
void add_latex_option(ArgumentParser cli, std::string& file);

/// Text for LaTeX: what has a meaning there is escaped, and what only some engines can set (Greek
/// letters, "±", "²") becomes a command of plain LaTeX.
std::string latex_text(std::string_view text);

}  // namespace cairn::app
