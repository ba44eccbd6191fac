// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// An answer of a `LineSession`, or an update of a `LineServer`, as a JSON object on one line;
/// empty for an empty answer. Its members are listed in docs/online.md, "JSON". Numbers are those
/// of the answer, digit by digit; those that JSON lacks (nan, inf) are null.
CAIRN_API std::string json_answer(std::string_view text);

}  // namespace cairn
