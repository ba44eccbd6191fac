// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <boost/json/value.hpp>

namespace cairn::performance {

// What tables ask of the contestants of an entry, {"contestants": [{"name", "runs": […]}, …]}.
// Whom there is not gives NaN, or "-".

/// Null if it is not there.
const boost::json::value* contestant(const boost::json::value& entry, const std::string& name);

/// Median over the runs.
double median_of(const boost::json::value* contestant, const std::string& path);

/// Median of the ratios of total times within the rounds that both were in.
double paired_ratio(const boost::json::value* peer, const boost::json::value* mine);

/// Seconds in all; "> 60" of one that was not finished.
std::string total(const boost::json::value* contestant);

/// Whether one run took too long.
bool was_late(const boost::json::value* contestant);

}  // namespace cairn::performance
