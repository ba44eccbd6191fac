// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

namespace cairn::app {

/// The help of `--latex FILE`, of a command whose results are a `Table`; see `Table::latex`.
inline constexpr const char* kLatexHelp = "the table as a tabular of LaTeX (- is standard output)";

/// Text for LaTeX: what has a meaning there is escaped, and what only some engines can set (Greek
/// letters, "±", "²") becomes a command of plain LaTeX.
std::string latex_text(std::string_view text);

}  // namespace cairn::app
