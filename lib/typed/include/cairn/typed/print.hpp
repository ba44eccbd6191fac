// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <iostream>
#include <ostream>
#include <string>

#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/solve/optimizer.hpp"

/// Graphs and summaries as text for people. The form may change; files are for programs.
namespace cairn {

/// How many variables and factors of which types there are, then the first `lines` of each: tag, id
/// (symbols as x3), state or measurement.
CAIRN_API std::string to_string(const Graph& graph, int lines = 20);

/// One line: "converged: chi2 2.85 -> 0.015 in 4 iterations (0.0003 s)", then each note.
CAIRN_API std::string to_string(const Summary& summary);

inline std::ostream& operator<<(std::ostream& stream, const Graph& graph) {
  return stream << to_string(graph);
}
inline std::ostream& operator<<(std::ostream& stream, const Summary& summary) {
  return stream << to_string(summary);
}

/// All variables and factors of a graph, to standard output unless another stream is given.
inline void print(const Graph& graph, std::ostream& stream = std::cout) {
  stream << to_string(graph, graph.variable_count() + graph.factor_count());
}

}  // namespace cairn
