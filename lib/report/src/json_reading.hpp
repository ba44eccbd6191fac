// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include <boost/json/object.hpp>
#include <boost/json/value.hpp>

namespace cairn {

/// Reads members of JSON from any source, each with a default for what is not there and an `Error`
/// (input) that names `where` and the member for what is of another type.
class JsonReader {
 public:
  /// Parses text that must be one object.
  JsonReader(std::string_view text, std::string_view where);

  bool has(const char* member) const { return find(member) != nullptr; }
  double number(const char* member,
                double otherwise = std::numeric_limits<double>::quiet_NaN()) const;
  std::int64_t whole(const char* member, std::int64_t otherwise, std::int64_t low,
                     std::int64_t high) const;
  std::string text(const char* member) const;
  bool boolean(const char* member, bool otherwise) const;
  /// An object that is a member; empty where it is not there.
  JsonReader object(const char* member) const;
  /// The objects of a member that is a list.
  std::vector<JsonReader> objects(const char* member) const;
  std::vector<std::string> texts(const char* member) const;
  /// A list of numbers or a packed array of `count` of them.
  std::vector<double> numbers(const char* member, std::size_t count) const;

  /// A list of integers from 0 to `high`, however many there are.
  std::vector<std::int32_t> indices(const char* member, std::int64_t high) const;

  /// The object as JSON text.
  std::string serialized() const;

  [[noreturn]] void fail(std::string_view what) const;

 private:
  JsonReader(boost::json::object object, std::string where)
      : object_(std::move(object)), where_(std::move(where)) {}
  const boost::json::value* find(const char* member) const;

  boost::json::object object_;
  std::string where_;
};

}  // namespace cairn
