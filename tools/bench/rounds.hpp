// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <boost/json/array.hpp>
#include <boost/json/object.hpp>

#include "measure.hpp"

namespace cairn::performance {

/// One of those that are compared on a graph, and how it went.
struct Contestant {
  std::string name;
  std::vector<std::string> arguments;
  double limit = 0.0;    ///< a run is given up after so many seconds; 0: never
  double enough = 20.0;  ///< no more runs that would take longer than so many seconds together
  boost::json::array runs{};
  double spent = 0.0;  ///< [s]
  bool in_time = true;

  bool runs_again() const;
  boost::json::object entry() const;
};

using RunContestant = std::function<Run(const Contestant& contestant)>;
using Summarize = std::function<boost::json::object(const boost::json::value& report)>;

/// Each in turn, each round beginning with another one: a machine that slows down for a while slows
/// all of them. Of every report the summary is kept.
void run_rounds(int rounds, std::vector<Contestant>& contestants, const RunContestant& run,
                const Summarize& summarize);

boost::json::array entries_of(const std::vector<Contestant>& contestants);

}  // namespace cairn::performance
