// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace cairn::performance {

/// A graph to measure on, as the command line of `cairn` takes it.
struct DataSet {
  std::string name;
  std::string graph;                   ///< a file, or @KIND:options
  std::vector<std::string> arguments;  ///< what reading it needs
  bool generated() const { return graph.starts_with('@'); }
};

// The graphs of each study: the published ones that lie in the folder `data` (empty: none do), then
// generated ones, which everybody has. `quick`: few and small.
std::vector<DataSet> pose_graphs(const std::string& data, bool quick);

std::vector<DataSet> rate_sets(const std::string& data, bool quick);
std::vector<DataSet> thread_sets(const std::string& data, bool quick);
std::vector<DataSet> marginals_sets(const std::string& data, bool quick);
std::vector<DataSet> solver_sets(const std::string& data, bool quick);
// For `cairn replay`:
std::vector<DataSet> online_sets(const std::string& data, bool quick);
std::vector<DataSet> budget_sets(const std::string& data, bool quick);

}  // namespace cairn::performance
