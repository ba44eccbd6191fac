// SPDX-License-Identifier: BSD-3-Clause
#include "escaped_bytes.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include <fmt/core.h>

namespace cairn {
namespace {

/// Bytes of the character that a text begins with, by table 3-7 of the Unicode standard; 0: none.
std::size_t length_of_character(std::string_view text) {
  const auto byte = [&](std::size_t k) {
    return k < text.size() ? static_cast<unsigned char>(text[k]) : std::uint8_t{0};
  };
  const auto within = [&](std::size_t k, int low, int high) {
    return byte(k) >= low && byte(k) <= high;
  };
  const int lead = byte(0);
  if (lead < 0x80) return 1;
  const std::size_t length = lead < 0xc2 ? 0 : lead < 0xe0 ? 2 : lead < 0xf0 ? 3 : 4;
  if (length == 0 || lead > 0xf4) return 0;
  // The second byte excludes longer forms than needed, surrogates, and what is beyond U+10FFFF.
  const int low = lead == 0xe0 ? 0xa0 : lead == 0xf0 ? 0x90 : 0x80;
  const int high = lead == 0xed ? 0x9f : lead == 0xf4 ? 0x8f : 0xbf;
  if (!within(1, low, high)) return 0;
  for (std::size_t k = 2; k < length; ++k) {
    if (!within(k, 0x80, 0xbf)) return 0;
  }
  return length;
}

}  // namespace

std::string escaped_bytes(std::string_view text) {
  std::string shown;
  for (std::size_t k = 0; k < text.size();) {
    const std::size_t length = length_of_character(text.substr(k));
    const auto byte = static_cast<unsigned char>(text[k]);
    const bool control = (byte < 0x20 && byte != '\t') || byte == 0x7f;
    if (length == 0 || control) {
      shown += fmt::format("\\x{:02x}", byte);
    } else {
      shown += text.substr(k, length);
    }
    k += std::max<std::size_t>(length, 1);
  }
  return shown;
}

}  // namespace cairn
