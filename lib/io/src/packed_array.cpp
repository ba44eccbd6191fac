// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/io/packed_array.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <new>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

static_assert(std::endian::native == std::endian::little, "packed arrays are little endian");

constexpr std::string_view kAlphabet =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
constexpr std::uint16_t kMissing = 65535;
constexpr double kSteps = 65534.0;

std::string base64(std::string_view bytes) {
  std::string text;
  text.resize((bytes.size() + 2) / 3 * 4);
  const auto byte = [&](std::size_t k) {
    return k < bytes.size() ? static_cast<unsigned char>(bytes[k]) : 0U;
  };
  std::size_t out = 0;
  for (std::size_t k = 0; k < bytes.size(); k += 3) {
    const unsigned group = byte(k) << 16 | byte(k + 1) << 8 | byte(k + 2);
    for (int shift = 18; shift >= 0; shift -= 6) text[out++] = kAlphabet[group >> shift & 63U];
  }
  for (std::size_t pad = 0; pad < (3 - bytes.size() % 3) % 3; ++pad)
    text[text.size() - 1 - pad] = '=';
  return text;
}

Error damaged(std::string_view where, std::string_view what) {
  return {ErrorCode::input, fmt::format("{}: {}", where, what)};
}

std::array<std::int8_t, 256> base64_values() {
  std::array<std::int8_t, 256> values{};
  values.fill(-1);
  for (std::size_t k = 0; k < kAlphabet.size(); ++k) {
    values[static_cast<unsigned char>(kAlphabet[k])] = static_cast<std::int8_t>(k);
  }
  return values;
}

std::string from_base64(std::string_view text, std::string_view where) {
  static const std::array<std::int8_t, 256> values = base64_values();
  if (text.size() % 4 != 0) throw damaged(where, "base64 text whose length is not a multiple of 4");
  std::string bytes;
  bytes.reserve(text.size() / 4 * 3);
  std::size_t padding = 0;
  while (padding < 2 && padding < text.size() && text[text.size() - 1 - padding] == '=') ++padding;
  for (std::size_t k = 0; k < text.size(); k += 4) {
    std::uint32_t group = 0;
    for (std::size_t j = k; j < k + 4; ++j) {
      const bool pad = j >= text.size() - padding;
      const std::int8_t value = pad ? std::int8_t{0} : values[static_cast<unsigned char>(text[j])];
      if (value < 0) throw damaged(where, fmt::format("character {} is not base64", j));
      group = group << 6 | static_cast<std::uint32_t>(value);
    }
    for (int shift = 16; shift >= 0; shift -= 8) bytes += static_cast<char>(group >> shift & 255U);
  }
  bytes.resize(bytes.size() - padding);
  return bytes;
}

std::string deflated(std::string_view bytes) {
  uLongf size = compressBound(bytes.size());
  std::string packed(size, '\0');
  const int status =
      compress2(reinterpret_cast<Bytef*>(packed.data()), &size,
                reinterpret_cast<const Bytef*>(bytes.data()), bytes.size(), Z_DEFAULT_COMPRESSION);
  if (status != Z_OK) throw std::bad_alloc();  // there is room for the result
  packed.resize(size);
  return packed;
}

/// `size`: what must come out, so that a small stream cannot fill the memory.
std::string inflated(std::string_view packed, std::size_t size, std::string_view where) {
  // zlib packs 1 : 1032 at best.
  if (size / 1100 > packed.size()) throw damaged(where, "the packed numbers are too short");
  std::string bytes(size, '\0');
  uLongf got = size;
  const int result = uncompress(reinterpret_cast<Bytef*>(bytes.data()), &got,
                                reinterpret_cast<const Bytef*>(packed.data()), packed.size());
  if (result == Z_MEM_ERROR) throw std::bad_alloc();
  if (result != Z_OK || got != size) throw damaged(where, "the packed numbers are damaged");
  return bytes;
}

template <class Number>
std::string packed(std::span<const Number> numbers, std::string_view type, Packing packing,
                   std::string_view more = "") {
  const std::string_view bytes(reinterpret_cast<const char*>(numbers.data()), numbers.size_bytes());
  const bool deflate = packing == Packing::deflate;
  return fmt::format(R"({{"type":"{}","count":{},"{}":"{}"{}}})", type, numbers.size(),
                     deflate ? "deflate" : "base64", base64(deflate ? deflated(bytes) : bytes),
                     more);
}

template <class Number>
std::vector<double> numbers_of(std::string_view bytes) {
  std::vector<double> numbers(bytes.size() / sizeof(Number));
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    Number number;
    std::memcpy(&number, bytes.data() + k * sizeof(Number), sizeof(Number));
    numbers[k] = static_cast<double>(number);
  }
  return numbers;
}

struct NumberType {
  std::string_view name;
  std::size_t size;
  std::vector<double> (*read)(std::string_view);
};
constexpr std::array<NumberType, 6> kTypes{{{"f32", 4, numbers_of<float>},
                                            {"f64", 8, numbers_of<double>},
                                            {"i32", 4, numbers_of<std::int32_t>},
                                            {"i64", 8, numbers_of<std::int64_t>},
                                            {"u8", 1, numbers_of<std::uint8_t>},
                                            {"u16", 2, numbers_of<std::uint16_t>}}};

/// Bytes of the UTF-8 sequence that `text` begins with; 0 if it is none.
std::size_t utf8_length(std::string_view text) {
  const auto byte = [&](std::size_t k) {
    return k < text.size() ? static_cast<unsigned char>(text[k]) : 0U;
  };
  const unsigned lead = byte(0);
  const auto continued = [&](std::size_t from, std::size_t to) {
    for (std::size_t k = from; k < to; ++k) {
      if ((byte(k) & 0xc0U) != 0x80U) return false;
    }
    return true;
  };
  if (lead < 0x80) return 1;
  if (lead >= 0xc2 && lead <= 0xdf && continued(1, 2)) return 2;
  if (lead >= 0xe0 && lead <= 0xef && continued(1, 3)) {
    const bool overlong = lead == 0xe0 && byte(1) < 0xa0;
    const bool surrogate = lead == 0xed && byte(1) >= 0xa0;
    return overlong || surrogate ? 0 : 3;
  }
  if (lead >= 0xf0 && lead <= 0xf4 && continued(1, 4)) {
    const bool overlong = lead == 0xf0 && byte(1) < 0x90;
    const bool too_large = lead == 0xf4 && byte(1) >= 0x90;
    return overlong || too_large ? 0 : 4;
  }
  return 0;
}

}  // namespace

std::string packed_json(std::span<const float> numbers, Packing packing) {
  return packed(numbers, "f32", packing);
}
std::string packed_json(std::span<const std::int32_t> numbers, Packing packing) {
  return packed(numbers, "i32", packing);
}
std::string packed_json(std::span<const std::int64_t> numbers, Packing packing) {
  return packed(numbers, "i64", packing);
}
std::string packed_json(std::span<const std::uint8_t> numbers, Packing packing) {
  return packed(numbers, "u8", packing);
}

std::string packed_points_json(std::span<const float> points, int dimension) {
  const auto d = static_cast<std::size_t>(dimension);
  std::vector<double> low(d, std::numeric_limits<double>::infinity());
  std::vector<double> high(d, -std::numeric_limits<double>::infinity());
  for (std::size_t k = 0; k < points.size(); ++k) {
    if (!std::isfinite(points[k])) continue;
    low[k % d] = std::min<double>(low[k % d], points[k]);
    high[k % d] = std::max<double>(high[k % d], points[k]);
  }
  for (std::size_t k = 0; k < d; ++k) {
    if (low[k] > high[k]) low[k] = high[k] = 0.0;
  }
  std::vector<std::uint16_t> steps(points.size());
  for (std::size_t k = 0; k < points.size(); ++k) {
    const double width = high[k % d] - low[k % d];
    if (!std::isfinite(points[k])) {
      steps[k] = kMissing;
    } else if (width > 0) {
      steps[k] = static_cast<std::uint16_t>(std::lround((points[k] - low[k % d]) / width * kSteps));
    }
  }
  const auto list = [](const std::vector<double>& numbers) {
    std::string text;
    for (const double number : numbers) text += (text.empty() ? "" : ",") + json_number(number);
    return text;
  };
  return packed(std::span<const std::uint16_t>(steps), "u16", Packing::base64,
                fmt::format(R"(,"min":[{}],"max":[{}])", list(low), list(high)));
}

std::vector<double> unpack_numbers(std::string_view type, std::string_view text, Packing packing,
                                   std::size_t count, std::string_view where) {
  const auto* const known = std::find_if(kTypes.begin(), kTypes.end(),
                                         [&](const NumberType& t) { return t.name == type; });
  if (known == kTypes.end()) {
    throw damaged(where, fmt::format("no type of numbers is called '{}'", type));
  }
  if (count > std::numeric_limits<std::size_t>::max() / 16)
    throw damaged(where, "too many numbers");
  std::string bytes = from_base64(text, where);
  if (packing == Packing::deflate) bytes = inflated(bytes, count * known->size, where);
  if (bytes.size() != count * known->size) {
    throw damaged(where,
                  fmt::format("{} bytes, but {} numbers of type {}", bytes.size(), count, type));
  }
  return known->read(bytes);
}

std::string valid_utf8(std::string_view text) {
  std::string valid;
  valid.reserve(text.size());
  for (std::size_t k = 0; k < text.size();) {
    const std::size_t length = utf8_length(text.substr(k));
    valid += length == 0 ? std::string_view("\xef\xbf\xbd") : text.substr(k, length);
    k += std::max<std::size_t>(length, 1);
  }
  return valid;
}

std::string embeddable_json(std::string_view json) {
  std::string text;
  for (const char c : valid_utf8(json)) {
    if (c == '<') {
      text += "\\u003c";
    } else {
      text += c;
    }
  }
  return text;
}

std::string json_string(std::string_view text) {
  std::string literal = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      literal += '\\';
      literal += c;
    } else if (byte < 0x20 || byte == 0x7f) {
      literal += fmt::format("\\u{:04x}", byte);
    } else {
      literal += c;
    }
  }
  return embeddable_json(literal + '"');
}

std::string json_number(double number) {
  if (!std::isfinite(number)) return "null";
  std::array<char, 32> buffer{};
  const auto [end, error] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), number);
  return {buffer.data(), end};
}

}  // namespace cairn
