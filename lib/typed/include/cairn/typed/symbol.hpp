// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <charconv>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

#include "cairn/graph/elements.hpp"
#include "cairn/graph/id_text.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {

/// The id of variable `index` of a kind that a letter stands for, such as symbol('x', 3): poses and
/// landmarks count from 0 each by themselves, and one kind's ids follow each other. Throws `Error`
/// (usage) unless the letter is one of a–z, A–Z and 0 ≤ index < 2^45.
constexpr Id symbol(char letter, std::int64_t index) {
  if (!detail::is_letter(letter) || index < 0 || (index >> detail::kSymbolBits) != 0) {
    throw Error(ErrorCode::usage, "a symbol is a letter and an index of 0 to 2^45 - 1, not '" +
                                      std::string(1, letter) + "' and " + std::to_string(index));
  }
  return (static_cast<Id>(letter) << detail::kSymbolBits) | index;
}

/// The inverse of `id_text`: the id that "x3" or "17" stands for, and nothing for any other text.
inline std::optional<Id> id_from_text(std::string_view text) {
  const bool named = !text.empty() && detail::is_letter(text.front());
  const std::string_view digits = text.substr(named ? 1 : 0);
  Id number = 0;
  const char* end = digits.data() + digits.size();
  const auto [stop, error] = std::from_chars(digits.data(), end, number);
  if (error != std::errc() || stop != end) return std::nullopt;
  if (!named) return number;
  if (number < 0 || (number >> detail::kSymbolBits) != 0) return std::nullopt;
  return symbol(text.front(), number);
}

/// Short names: `using namespace cairn::symbols;` and then X(3), L(2).
namespace symbols {

/// Pose `index`.
constexpr Id X(std::int64_t index) { return symbol('x', index); }
/// Landmark `index`.
constexpr Id L(std::int64_t index) { return symbol('l', index); }

}  // namespace symbols
}  // namespace cairn
