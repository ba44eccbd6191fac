// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "exclusive.hpp"

namespace cairn::python {

/// A graph as Python holds it.
class BoundGraph {
 public:
  BoundGraph() = default;
  explicit BoundGraph(Graph graph) : graph_(std::move(graph)) {}

  /// For a call that keeps the interpreter's lock. Throws `Error` (usage) while it is in use.
  Graph& get() {
    exclusive_.refuse_if_used();
    return graph_;
  }

  std::vector<double> stamps;         ///< time [s] of each pose, by rising id, if its file has them
  bool row_ids = false;               ///< its file has no ids: they are the numbers of its rows
  std::vector<std::string> notes;     ///< what reading it skipped or changed
  std::unique_ptr<BoundGraph> truth;  ///< at the true states, if its file has them beside

 private:
  friend class GraphUse;
  Graph graph_;
  Exclusive exclusive_{
      "the graph is in use by a call that has not returned, such as optimize: in a callback ask "
      "the "
      "iteration for its states, and in another thread work on graph.copy()"};
};

/// For a call that releases the interpreter's lock while it works on the graph. Throws `Error`
/// (usage) if it is in use already.
class GraphUse {
 public:
  explicit GraphUse(BoundGraph& bound) : use_(bound.exclusive_), graph_(&bound.graph_) {}
  Graph& graph() const { return *graph_; }

 private:
  Use use_;
  Graph* graph_;
};

}  // namespace cairn::python
