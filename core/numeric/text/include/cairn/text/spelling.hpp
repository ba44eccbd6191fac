// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace cairn {

// libcairn has these.
#define CAIRN_TEXT_API __attribute__((visibility("default")))

/// The candidate nearest to `word` by edit distance (insert, delete, replace, swap), else the
/// first that `word` is a part of or has the initials of, or an empty string if there is none.
CAIRN_TEXT_API std::string nearest_spelling(std::string_view word,
                                            std::span<const std::string> candidates);

/// "; did you mean 'x'?" or, with nothing near, "; on offer: a, b, c": the end of an error message.
CAIRN_TEXT_API std::string what_is_on_offer(std::string_view word,
                                            std::span<const std::string> candidates);

#undef CAIRN_TEXT_API

}  // namespace cairn
