// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <boost/json/value.hpp>

namespace cairn::performance {

/// What a study leaves, with these entries, on some machine.
boost::json::value report(const std::string& study, const std::string& entries);

/// The section of that name that the report fills. Throws `std::runtime_error` if there is none.
std::string section(const boost::json::value& report, const std::string& name);

}  // namespace cairn::performance
