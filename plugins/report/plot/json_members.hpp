// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <boost/json/array.hpp>
#include <boost/json/value.hpp>

namespace cairn::plot {

// Members of JSON that may be anything: what is missing, or of another type, is nothing.

/// Null where it is not there, or `value` is no object.
const boost::json::value* member(const boost::json::value& value, const char* name);
/// NaN for what is no number.
double number(const boost::json::value& value);
double number(const boost::json::value& value, const char* name);
std::string text(const boost::json::value& value, const char* name);
/// Empty for what is no list.
const boost::json::array& list(const boost::json::value& value);
const boost::json::array& list(const boost::json::value& value, const char* name);

}  // namespace cairn::plot
