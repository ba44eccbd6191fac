// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <boost/json/object.hpp>

#include "cairn/exploration/explorer_comparison.hpp"
#include "cairn/program/session.hpp"
#include "cairn/report/number_table.hpp"
#include "explore_report.hpp"

namespace cairn::app {

/// What `cairn explore` prints and writes of a comparison.
struct ExploreComparison {
  std::string floor;
  GridFrame frame;
  ExploreParts parts;
  std::vector<std::string> explorers;  ///< as they were named
  int runs = 1;
  bool repeatable = true;  ///< no clock decides
  std::vector<ComparedRun> outcomes;

  double floor_area() const { return static_cast<double>(frame.size()) * frame.cell_area(); }
};

/// Means with their intervals, the paired differences from the first explorer, and how runs ended.
std::string comparison_text(const ExploreComparison& comparison, bool colour);
/// A row for each run; the columns are described in docs/explore.md.
std::string comparison_csv(const ExploreComparison& comparison);
/// Means, and differences from the first explorer, as tables of LaTeX.
std::string comparison_latex(const ExploreComparison& comparison);
boost::json::object comparison_json(const ExploreComparison& comparison);

/// Mean curves by explorer: entropies and coverage against the distance, and against the number of
/// motions, and errors of the map against its coverage. Columns are named "QUANTITY EXPLORER".
NumberTable curves_over_distance(const ExploreComparison& comparison);
NumberTable curves_over_motions(const ExploreComparison& comparison);
NumberTable curves_over_coverage(const ExploreComparison& comparison);
/// All of these side by side, as one file of CSV: row k of each has nothing to do with row k of the
/// others.
NumberTable all_curves(const ExploreComparison& comparison);

/// A page with tables and curves, which needs nothing else.
std::string comparison_page(const ExploreComparison& comparison, Session& session);

}  // namespace cairn::app
