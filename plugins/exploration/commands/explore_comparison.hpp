// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cairn/exploration/explorer_comparison.hpp"
#include "cairn/program/session.hpp"
#include "explore_report.hpp"

namespace cairn::app {

/// Options of `cairn explore` that compare explorers.
struct ComparisonOptions {
  int runs = 1;
  std::string csv, curves, latex;
  bool asked_for(const std::vector<std::string>& explorers) const {
    return explorers.size() > 1 || runs > 1 || !csv.empty() || !curves.empty() || !latex.empty();
  }

  static OptionFields<ComparisonOptions> fields();
};

/// Finds out before the work whether its files can be written.
void check_comparison(const ComparisonOptions& options, const std::string& page, Session& session);

/// Runs the explorers, which `parts` names as "A,B", and writes and prints what they did; `page` is
/// the file of the page, or empty. Returns the exit code.
int run_comparison(const ComparisonOptions& options, const std::string& page,
                   const ExplorationSetup& setup, const std::string& floor,
                   const ExploreParts& parts, Session& session);

}  // namespace cairn::app
