// SPDX-License-Identifier: BSD-3-Clause
#include "study_report.hpp"

#include <stdexcept>

#include <boost/json/parse.hpp>

#include "tables.hpp"

namespace cairn::performance {

boost::json::value report(const std::string& study, const std::string& entries) {
  return boost::json::parse(R"({"study": ")" + study + R"(", "cairn": "0.1.0", "commit": "abc1234",
      "machine": {"cpu": "Some CPU", "cores": 2},
      "build": {"compiler": "gcc", "flags": "-O3", "simd": "avx2"}, "entries": [)" +
                            entries + "]}");
}

std::string section(const boost::json::value& report, const std::string& name) {
  for (const Section& section : sections(report)) {
    if (section.name == name) return section.markdown;
  }
  throw std::runtime_error("no section " + name);
}

}  // namespace cairn::performance
