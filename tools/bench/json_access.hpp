// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

#include <boost/json/array.hpp>
#include <boost/json/value.hpp>

namespace cairn::performance {

// Members of JSON by a path such as "graph.variables". What is not there is NaN, empty, false.

double number(const boost::json::value& value, std::string_view path);
std::string text(const boost::json::value& value, std::string_view path);
const boost::json::array& list(const boost::json::value& value, std::string_view path);
/// nullptr where there is none.
const boost::json::value* member(const boost::json::value& value, std::string_view path);
// What they return lies in the value, which must live.
const boost::json::array& list(boost::json::value&& value, std::string_view path) = delete;
const boost::json::value* member(boost::json::value&& value, std::string_view path) = delete;

}  // namespace cairn::performance
