// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <boost/json/array.hpp>
#include <boost/json/object.hpp>

#include "data_sets.hpp"
#include "rounds.hpp"
#include "studies.hpp"

namespace cairn::performance {

// What the studies of `cairn sparsify` share.

/// Options of the experiment of section 4.6.4 of the thesis: a node of so many stays, the others
/// leave every hundred poses; its KLD is that of graphs each linearised at its own minimum.
std::vector<std::string> thesis_experiment(int keep_every, const std::string& scheme,
                                           const std::string& compared_at = "minima");

/// Interleaved runs with one thread.
void sparsify_rounds(const Bench& bench, const DataSet& set, std::vector<Contestant>& contestants,
                     int rounds);

/// One run that writes the problems that come up; returns the file's name.
std::filesystem::path record_problems(const Bench& bench, const DataSet& set,
                                      const std::string& name,
                                      const std::vector<std::string>& arguments);

/// What each topology and each recovery among the arguments makes of recorded problems.
boost::json::array solve_problems(const Bench& bench, const std::filesystem::path& problems,
                                  const std::vector<std::string>& arguments);

}  // namespace cairn::performance
