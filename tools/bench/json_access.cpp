// SPDX-License-Identifier: BSD-3-Clause
#include "json_access.hpp"

#include <limits>

namespace cairn::performance {

namespace json = boost::json;

const json::value* member(const json::value& value, std::string_view path) {
  const json::value* at = &value;
  while (!path.empty() && at) {
    const std::size_t dot = path.find('.');
    const std::string_view name = path.substr(0, dot);
    path = dot == std::string_view::npos ? std::string_view() : path.substr(dot + 1);
    at = at->is_object() ? at->get_object().if_contains(name) : nullptr;
  }
  return at;
}

double number(const json::value& value, std::string_view path) {
  const json::value* found = member(value, path);
  return found && found->is_number() ? found->to_number<double>()
                                     : std::numeric_limits<double>::quiet_NaN();
}

std::string text(const json::value& value, std::string_view path) {
  const json::value* found = member(value, path);
  return found && found->is_string() ? std::string(found->get_string()) : std::string();
}

const json::array& list(const json::value& value, std::string_view path) {
  static const json::array empty;
  const json::value* found = member(value, path);
  return found && found->is_array() ? found->get_array() : empty;
}

}  // namespace cairn::performance
