// SPDX-License-Identifier: BSD-3-Clause
#include "json_reading.hpp"

#include <cmath>
#include <utility>

#include <fmt/core.h>
#include <boost/json/parse.hpp>
#include <boost/json/serialize.hpp>

#include "cairn/io/packed_array.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

namespace json = boost::json;

double number_of(const json::value& value) {
  return value.is_number() ? value.to_number<double>() : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

JsonReader::JsonReader(std::string_view text, std::string_view where) : where_(where) {
  // File names of an odd file system must not keep a report from being read.
  json::parse_options options;
  options.allow_invalid_utf8 = true;
  json::error_code error;
  json::value value = json::parse(text, error, {}, options);
  if (error) fail("is not JSON: " + error.message());
  if (!value.is_object()) fail("is not a JSON object");
  object_ = std::move(value.get_object());
}

const json::value* JsonReader::find(const char* member) const {
  const json::value* value = object_.if_contains(member);
  return value && !value->is_null() ? value : nullptr;
}

void JsonReader::fail(std::string_view what) const {
  throw Error(ErrorCode::input, fmt::format("{}: {}", where_, what));
}

double JsonReader::number(const char* member, double otherwise) const {
  const json::value* value = find(member);
  if (!value) return otherwise;
  if (!value->is_number()) fail(fmt::format("'{}' is not a number", member));
  return number_of(*value);
}

std::int64_t JsonReader::whole(const char* member, std::int64_t otherwise, std::int64_t low,
                               std::int64_t high) const {
  const double value = number(member, static_cast<double>(otherwise));
  if (!(value >= static_cast<double>(low) && value <= static_cast<double>(high)) ||
      value != std::floor(value)) {
    fail(fmt::format("'{}' is {}, expected an integer from {} to {}", member, value, low, high));
  }
  return static_cast<std::int64_t>(value);
}

std::string JsonReader::text(const char* member) const {
  const json::value* value = find(member);
  if (!value) return {};
  if (!value->is_string()) fail(fmt::format("'{}' is not a text", member));
  return {value->get_string().data(), value->get_string().size()};
}

bool JsonReader::boolean(const char* member, bool otherwise) const {
  const json::value* value = find(member);
  if (!value) return otherwise;
  if (!value->is_bool()) fail(fmt::format("'{}' is neither true nor false", member));
  return value->get_bool();
}

JsonReader JsonReader::object(const char* member) const {
  const json::value* value = find(member);
  const std::string where = fmt::format("{}, {}", where_, member);
  if (!value) return {json::object{}, where};
  if (!value->is_object()) fail(fmt::format("'{}' is not an object", member));
  return {value->get_object(), where};
}

std::vector<JsonReader> JsonReader::objects(const char* member) const {
  std::vector<JsonReader> all;
  const json::value* value = find(member);
  if (!value) return all;
  if (!value->is_array()) fail(fmt::format("'{}' is not a list", member));
  for (const json::value& item : value->get_array()) {
    const std::string where = fmt::format("{}, {} {}", where_, member, all.size());
    if (!item.is_object()) fail(fmt::format("'{}' holds what is not an object", member));
    all.push_back(JsonReader(item.get_object(), where));
  }
  return all;
}

std::vector<std::string> JsonReader::texts(const char* member) const {
  std::vector<std::string> all;
  const json::value* value = find(member);
  if (!value) return all;
  if (!value->is_array()) fail(fmt::format("'{}' is not a list", member));
  for (const json::value& item : value->get_array()) {
    if (!item.is_string()) fail(fmt::format("'{}' holds what is not a text", member));
    all.emplace_back(item.get_string().data(), item.get_string().size());
  }
  return all;
}

std::vector<double> JsonReader::numbers(const char* member, std::size_t count) const {
  const json::value* value = find(member);
  if (!value) fail(fmt::format("'{}' is missing", member));
  std::vector<double> numbers;
  if (value->is_array()) {
    for (const json::value& item : value->get_array()) numbers.push_back(number_of(item));
  } else {
    const JsonReader array = object(member);
    const bool deflate = array.has("deflate");
    if (array.whole("count", -1, -1, std::numeric_limits<std::int32_t>::max()) ==
        static_cast<std::int64_t>(count)) {
      return unpack_numbers(array.text("type"), array.text(deflate ? "deflate" : "base64"),
                            deflate ? Packing::deflate : Packing::base64, count,
                            fmt::format("{}, {}", where_, member));
    }
  }
  if (numbers.size() != count) fail(fmt::format("'{}' does not have {} numbers", member, count));
  return numbers;
}

std::vector<std::int32_t> JsonReader::indices(const char* member, std::int64_t high) const {
  std::vector<std::int32_t> all;
  const json::value* value = find(member);
  if (!value) return all;
  if (!value->is_array()) fail(fmt::format("'{}' is not a list", member));
  for (const json::value& item : value->get_array()) {
    const double number = number_of(item);
    if (!(number >= 0 && number <= static_cast<double>(high)) || number != std::floor(number)) {
      fail(fmt::format("'{}' holds what is not an integer from 0 to {}", member, high));
    }
    all.push_back(static_cast<std::int32_t>(number));
  }
  return all;
}

std::string JsonReader::serialized() const { return json::serialize(object_); }

}  // namespace cairn
