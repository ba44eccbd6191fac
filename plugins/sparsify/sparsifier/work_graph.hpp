// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "cairn/graph/graph.hpp"

namespace cairn::sparsify {

/// A factor while nodes leave one after the other.
struct WorkFactor {
  std::shared_ptr<const FactorType> type;
  std::vector<int> variables;  ///< by index of the graph
  std::vector<double> measurement;
  std::vector<double> information;       ///< upper triangle, row by row
  std::vector<double> sqrt_information;  ///< U with UᵀU = information, likewise
  int position = -1;                     ///< in the graph; -1: came in place of others
  bool there = true;
};

/// What `Sparsifier::remove` works on: the graph's factors, which come and go, and its states,
/// which stay. A factor under a robust loss weighs what it does at these states.
class WorkGraph {
 public:
  explicit WorkGraph(const Graph& graph);

  const Graph& graph() const { return *graph_; }
  const WorkFactor& factor(int f) const { return factors_[f]; }
  int factor_count() const { return static_cast<int>(factors_.size()); }
  /// Those that are there, by rising number.
  const std::vector<int>& on(int variable) const { return on_[variable]; }
  bool gone(int variable) const { return gone_[variable]; }
  /// Variables that share a factor with these and are not among them, rising.
  std::vector<int> blanket(std::span<const int> variables) const;

  void remove_factor(int f);
  void remove_variable(int v) { gone_[v] = true; }
  /// Throws `Error` (numerical) unless the information is positive semidefinite.
  void add(std::shared_ptr<const FactorType> type, std::vector<int> variables,
           std::vector<double> measurement, std::vector<double> information);
  /// Adds a measurement of a whole state. It becomes one with those of its type that the variable
  /// has already, so that priors do not gather where nodes leave for ever: H = Σ JᵀJ at the graph's
  /// state is kept, and the minimum to first order.
  void add_prior(const std::shared_ptr<const FactorType>& type, int variable,
                 std::vector<double> measurement, std::vector<double> information);

 private:
  const Graph* graph_;
  std::vector<WorkFactor> factors_;
  std::vector<std::vector<int>> on_;
  std::vector<bool> gone_;
};

}  // namespace cairn::sparsify
