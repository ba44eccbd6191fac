// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "cairn/graph/elements.hpp"

namespace cairn {

/// What a variable's id says if it was made by `symbol` (cairn/typed/symbol.hpp): x3, l2.
struct Symbol {
  char letter = 'x';
  std::int64_t index = 0;

  friend bool operator==(const Symbol&, const Symbol&) = default;
};

namespace detail {
/// Bits of the index. With the seven of the letter an id stays below 2^53, so that it is exact
/// wherever numbers are read as doubles: JSON, tables, other tools.
inline constexpr int kSymbolBits = 45;

constexpr bool is_letter(std::int64_t c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}
}  // namespace detail

/// Letter and index of an id that `symbol` made; nothing for any other, such as those of files.
constexpr std::optional<Symbol> as_symbol(Id id) {
  const Id letter = id >> detail::kSymbolBits;
  if (!detail::is_letter(letter)) return std::nullopt;
  return Symbol{static_cast<char>(letter), id & ((Id{1} << detail::kSymbolBits) - 1)};
}

/// "x3" for a symbol, the number of any other id: how messages name variables.
inline std::string id_text(Id id) {
  const std::optional<Symbol> named = as_symbol(id);
  return named ? named->letter + std::to_string(named->index) : std::to_string(id);
}

}  // namespace cairn
