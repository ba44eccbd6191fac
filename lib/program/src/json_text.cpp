// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/json_text.hpp"

#include <charconv>
#include <cmath>

#include <boost/json/serialize.hpp>

#include "cairn/io/packed_array.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

constexpr std::size_t kLineWidth = 100;

std::string number_text(double number) {
  if (!std::isfinite(number)) return "null";
  char buffer[32];
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof buffer, number);
  std::string text(buffer, end);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

/// Text of `value` whose first line begins at column `indent` (what it is nested in).
std::string layout(const json::value& value, std::size_t indent);

/// The parts on one line if they fit, else one a line.
std::string enclose(const std::vector<std::string>& parts, char open, char close,
                    std::size_t indent) {
  std::size_t width = indent + 2;
  bool one_line = true;
  for (const std::string& part : parts) {
    width += part.size() + 2;
    one_line = one_line && part.find('\n') == std::string::npos;
  }
  one_line = one_line && width <= kLineWidth;
  const std::string margin = one_line ? "" : "\n" + std::string(indent + 1, ' ');
  std::string text(1, open);
  for (std::size_t k = 0; k < parts.size(); ++k) {
    if (k > 0) text += one_line ? ", " : ",";
    text += margin + parts[k];
  }
  if (!one_line && !parts.empty()) text += "\n" + std::string(indent, ' ');
  return text + close;
}

std::string layout(const json::object& object, std::size_t indent) {
  std::vector<std::string> parts;
  for (const auto& [key, item] : object)
    parts.push_back(json::serialize(json::string(key)) + ": " + layout(item, indent + 1));
  return enclose(parts, '{', '}', indent);
}

std::string layout(const json::value& value, std::size_t indent) {
  if (value.is_double()) return number_text(value.get_double());
  if (value.is_object()) return layout(value.get_object(), indent);
  if (value.is_array()) {
    std::vector<std::string> parts;
    for (const json::value& item : value.get_array()) parts.push_back(layout(item, indent + 1));
    return enclose(parts, '[', ']', indent);
  }
  return json::serialize(value);
}

}  // namespace

std::string json_text(const json::object& object) { return valid_utf8(layout(object, 0)); }

}  // namespace cairn::app
