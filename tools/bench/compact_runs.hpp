// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <boost/json/object.hpp>

#include "data_sets.hpp"
#include "rounds.hpp"
#include "studies.hpp"

namespace cairn::performance {

// What the studies of `cairn compact` share.

/// The graph, with the truth among its arguments, which may have to be made first.
DataSet with_truth(const Bench& bench, const TruthfulSet& set);

/// One run with one thread. Throws `std::runtime_error` with its complaint if it gave no report.
Run run_compact(const Bench& bench, const DataSet& set, const std::vector<std::string>& arguments,
                double limit = 0.0);

/// What the tables want of a run.
boost::json::object compact_summary(const boost::json::value& report);

/// Thresholds that a sample of a graph gave.
struct Thresholds {
  std::filesystem::path file;
  boost::json::object found;  ///< what the report says of them
};

/// By default, or with more arguments; `name` is that of the file.
Thresholds find_thresholds(const Bench& bench, const DataSet& set, const std::string& name,
                           const std::vector<std::string>& more = {});
/// Those of a graph in three ways.
struct CompactThresholds {
  Thresholds refined;  ///< as by default
  Thresholds plain;    ///< without relocation
  Thresholds by_rule;  ///< as published: without relocation, and by section 5.2 alone
};
CompactThresholds find_compact_thresholds(const Bench& bench, const DataSet& set);

/// Algorithm 1 of the paper, without relocation.
inline constexpr const char* kAsPublished = "compact_pose:reuse=false";
/// Policy of APAL: no pair of poses is tested for being near (s = 0), so that every loop closure of
/// a recording is found.
inline constexpr const char* kAllLoops = "compact_pose:search=recorded";

/// All poses, and all loops that the distance test finds ("tested"), then few of both with each of
/// these thresholds.
std::vector<Contestant> compact_contestants(const CompactThresholds& thresholds, double limit,
                                            double enough);

/// The same with another seed each time, from 1 on. `seeded` says which arguments that means.
Contestant run_seeds(const Bench& bench, const DataSet& set, Contestant contestant, int seeds,
                     const std::function<std::vector<std::string>(int seed)>& seeded);

}  // namespace cairn::performance
