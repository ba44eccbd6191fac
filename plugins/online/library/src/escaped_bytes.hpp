// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

namespace cairn {

/// What a client has sent, fit for an answer: bytes that are no UTF-8 and control characters but
/// tabs as \xd3.
std::string escaped_bytes(std::string_view text);

}  // namespace cairn
