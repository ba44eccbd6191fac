// SPDX-License-Identifier: BSD-3-Clause
#include "contestants.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include <fmt/format.h>
#include <boost/json/array.hpp>

#include "json_access.hpp"
#include "statistics.hpp"
#include "tables.hpp"

namespace cairn::performance {

namespace json = boost::json;

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

}  // namespace

const json::value* contestant(const json::value& entry, const std::string& name) {
  for (const json::value& c : list(entry, "contestants")) {
    if (text(c, "name") == name) return &c;
  }
  return nullptr;
}

double median_of(const json::value* contestant, const std::string& path) {
  if (!contestant) return kNone;
  std::vector<double> values;
  for (const json::value& run : list(*contestant, "runs")) {
    if (std::isfinite(number(run, path))) values.push_back(number(run, path));
  }
  return median(values);
}

double paired_ratio(const json::value* peer, const json::value* mine) {
  if (!peer || !mine) return kNone;
  const json::array &theirs = list(*peer, "runs"), &own = list(*mine, "runs");
  std::vector<double> ratios;
  for (std::size_t k = 0; k < std::min(theirs.size(), own.size()); ++k)
    ratios.push_back(number(theirs[k], "seconds.total") / number(own[k], "seconds.total"));
  return median(ratios);
}

bool was_late(const json::value* contestant) {
  const json::value* in_time = contestant ? member(*contestant, "in_time") : nullptr;
  return in_time && *in_time == false;
}

std::string total(const json::value* contestant) {
  if (was_late(contestant)) return fmt::format("> {:.0f}", number(*contestant, "limit"));
  return digits(median_of(contestant, "seconds.total"));
}

}  // namespace cairn::performance
