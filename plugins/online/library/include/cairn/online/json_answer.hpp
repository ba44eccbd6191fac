// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// Whether a word is the tag of a type of variables, such as VERTEX_SE2.
using IsVariableType = std::function<bool(std::string_view)>;

/// An answer of a `LineSession`, or an update of a `LineServer`, as a JSON object on one line;
/// empty for an empty answer. Its members are listed in docs/online.md, "JSON". Numbers are those
/// of the answer, digit by digit; those that JSON lacks (nan, inf) are null, and bytes that are no
/// UTF-8 are escaped. A line is an estimate only if its first word is the type of a variable; one
/// that begins with any other word than those of docs/online.md is among the results.
CAIRN_API std::string json_answer(std::string_view text, const IsVariableType& is_variable_type);

}  // namespace cairn
