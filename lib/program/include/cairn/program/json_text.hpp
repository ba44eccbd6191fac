// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <boost/json/fwd.hpp>

namespace cairn::app {

/// JSON laid out for people: what fits a line stays on one. Numbers are the shortest that read back
/// as the same bits; reals always have a point or an exponent; what is not finite is null. Bytes of
/// names that are not UTF-8 become U+FFFD.
std::string json_text(const boost::json::object& object);

}  // namespace cairn::app
