// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <boost/json/object.hpp>

#include "cairn/exploration/exploration.hpp"
#include "cairn/exploration/exploration_measures.hpp"

namespace cairn::app {

/// The components of a run, as they are named on the command line.
struct ExploreParts {
  std::string world, policy, registration, mapper, explorer, loss;
  std::uint64_t seed = 1;
};

/// What `cairn explore` prints and writes.
struct ExploreOutcome {
  std::string floor;  ///< empty: none is known
  GridFrame frame;    ///< of the floor, or else of the map
  ExploreParts parts;
  bool repeatable = true;  ///< no clock decides
  ExplorationResult result;
  ScanLog log = {};  ///< if it is to be written
};

/// Adds "measures", {name: number}, and "measured_seconds", those of them that are times.
void put_measures(boost::json::object& report, const ExplorationMeasures& measures);
boost::json::object report_json(const ExploreOutcome& outcome);
/// A row for each motion.
std::string steps_csv(const ExplorationResult& result);
/// Five lines.
std::string summary_text(const ExploreOutcome& outcome);

}  // namespace cairn::app
