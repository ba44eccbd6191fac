// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <boost/json/object.hpp>

#include "measure.hpp"

namespace cairn::performance {

/// What every study is given.
struct Bench {
  Cairn cairn;
  std::string data;  ///< folder of the real graphs, or empty
  bool quick = false;
  std::string ours = "block_cholesky";  ///< cairn's own linear solver, with options
  int rounds = 5;
};

/// Takes what was measured, one entry at a time, and keeps it at once: a study may take an hour.
using Keep = std::function<void(boost::json::object entry)>;

// `cairn sparsify`, whose studies are called sparsify_…; docs/sparsify_results.md has their tables.

/// The graphs of Vallvé's thesis, with several parts of the nodes left and each recovery.
void study_sparsify_sets(const Bench& bench, const Keep& keep);

/// Two of them with each topology and several numbers of factors.
void study_sparsify_topology(const Bench& bench, const Keep& keep);

/// The problems of one of them, one by one.
void study_sparsify_problems(const Bench& bench, const Keep& keep);

/// Poses in space, and larger graphs.
void study_sparsify_whole(const Bench& bench, const Keep& keep);

/// Pose by pose, beside the same without taking anything out.
void study_sparsify_online(const Bench& bench, const Keep& keep);

/// Half of the nodes, chosen in several ways.
void study_sparsify_selection(const Bench& bench, const Keep& keep);

/// A part of the loop closures, chosen in several ways, and all nodes.
void study_sparsify_edges(const Bench& bench, const Keep& keep);

// `cairn explore`, whose studies are called explore_…; docs/explore_results.md has their tables.

/// Tables 5.4 and 5.5 of the thesis: search in configuration space.
void study_explore_cave(const Bench& bench, const Keep& keep);
void study_explore_freiburg(const Bench& bench, const Keep& keep);

/// Table 5.6: search in action space; and the same at the scale that the thesis's floor likely had.
void study_explore_action(const Bench& bench, const Keep& keep);
void study_explore_scale(const Bench& bench, const Keep& keep);

/// Every explorer on every floor.
void study_explore_floors(const Bench& bench, const Keep& keep);

/// What the thesis is silent about, changed one by one.
void study_explore_sensitivity(const Bench& bench, const Keep& keep);

// Progress
// ------------------------------------------------------------------------------------------------
/// A line on standard error.
void tell(const std::string& sentence);
/// Calls `work`; what cannot be measured is told of and left out.
void attempt(const std::string& what, const std::function<void()>& work);
/// The same for each.
void for_each_set(const std::string& study, const std::vector<DataSet>& sets,
                  const std::function<void(const DataSet&)>& work);

}  // namespace cairn::performance
