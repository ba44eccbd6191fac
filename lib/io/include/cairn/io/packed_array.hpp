// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// How bulk numbers stand in JSON: {"type": "f32", "count": 3, "base64": "…"}, the numbers in
/// little endian one after another (docs/report.md, Arrays of numbers).
enum class Packing {
  base64,   ///< as they are: right for positions, which hardly compress
  deflate,  ///< a zlib stream first: pays for indices, classes and ids
};

/// The JSON object of an array.
CAIRN_API std::string packed_json(std::span<const float> numbers, Packing packing);
CAIRN_API std::string packed_json(std::span<const std::int32_t> numbers, Packing packing);
CAIRN_API std::string packed_json(std::span<const std::int64_t> numbers, Packing packing);
CAIRN_API std::string packed_json(std::span<const std::uint8_t> numbers, Packing packing);

/// Points as 16-bit steps within their bounding box, with "min" and "max" beside the numbers: half
/// the size of f32, to 1/65534 of the box. `dimension` numbers per point; a point with a number
/// that is not finite becomes one that is not there.
CAIRN_API std::string packed_points_json(std::span<const float> points, int dimension);

/// What packed text holds, by the array's "type". Throws `Error` (input), naming `where`, for text
/// that is not base64, a stream that is damaged, or a size that is not `count` numbers.
CAIRN_API std::vector<double> unpack_numbers(std::string_view type, std::string_view text,
                                             Packing packing, std::size_t count,
                                             std::string_view where);

/// The text with bytes that are not UTF-8 replaced by U+FFFD.
CAIRN_API std::string valid_utf8(std::string_view text);

/// JSON text that may stand within <script type="application/json">: each '<' as \u003c, and bytes
/// that are not UTF-8 replaced by U+FFFD. `json` must be valid JSON but for such bytes, so that '<'
/// stands within strings only.
CAIRN_API std::string embeddable_json(std::string_view json);

/// A JSON string literal, quotes included, that `embeddable_json` has nothing to change in.
CAIRN_API std::string json_string(std::string_view text);

/// The shortest text that reads back as the same double; null for what is not finite.
CAIRN_API std::string json_number(double number);

}  // namespace cairn
