// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "cairn/graph/graph.hpp"

namespace cairn::formats {

/// Indices of all variables by rising id. Throws `Error` (input) if there is none, since an empty
/// file is not readable as a graph.
std::vector<int> variables_by_id(const Graph& graph);

/// Refuses to write: "format toro cannot express …; expected …". Throws `Error` (input).
[[noreturn]] void cannot_express(std::string_view format, const std::string& what,
                                 std::string_view expected);

}  // namespace cairn::formats
