// SPDX-License-Identifier: BSD-3-Clause
#include "json_members.hpp"

#include <limits>

namespace cairn::plot {

namespace json = boost::json;

const json::value* member(const json::value& value, const char* name) {
  return value.is_object() ? value.get_object().if_contains(name) : nullptr;
}

double number(const json::value& value) {
  return value.is_number() ? value.to_number<double>() : std::numeric_limits<double>::quiet_NaN();
}

double number(const json::value& value, const char* name) {
  const json::value* found = member(value, name);
  return found ? number(*found) : std::numeric_limits<double>::quiet_NaN();
}

std::string text(const json::value& value, const char* name) {
  const json::value* found = member(value, name);
  return found && found->is_string() ? std::string(found->get_string()) : std::string();
}

const json::array& list(const json::value& value) {
  static const json::array empty;
  return value.is_array() ? value.get_array() : empty;
}

const json::array& list(const json::value& value, const char* name) {
  static const json::value nothing;
  const json::value* found = member(value, name);
  return list(found ? *found : nothing);
}

}  // namespace cairn::plot
