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
// For `cairn sparsify`; without published graphs, generated ones:
/// M3500, Intel, FR079 and MITb, those of the thesis.
std::vector<DataSet> thesis_sets(const std::string& data, bool quick);
std::vector<DataSet> space_sets(const std::string& data, bool quick);
std::vector<DataSet> large_sets(const std::string& data, bool quick);
std::vector<DataSet> sparsify_online_sets(const std::string& data, bool quick);
std::vector<DataSet> edge_sets(const std::string& data, bool quick);

}  // namespace cairn::performance
