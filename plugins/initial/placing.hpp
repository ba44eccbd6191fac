// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "cairn/graph/factors_by_variable.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/graph/graph.hpp"

namespace cairn::initial {

/// Places variables one after another: each from a factor whose other variables are placed.
class Placing {
 public:
  explicit Placing(Graph& graph);

  const FactorsByVariable& factors() const { return factors_; }
  bool placed(int variable) const { return placed_[variable]; }
  /// Counts the state that a variable has as its place.
  void set_placed(int variable) { placed_[variable] = true; }

  /// Places `variable` by `factor` (a position in the graph). False, and nothing done, where
  /// another variable of the factor is not placed or the measurement does not determine the state:
  /// also where a component of it has no information.
  bool place(int variable, int factor);

  /// Initialises the roots: constant variables keep their states. In a component without a constant
  /// pose (a pose being a variable of the component's largest tangent space), the first pose with a
  /// prior that determines it takes its state from that. Returns the variables placed, by index.
  std::vector<int> place_roots(const Gauge& gauge);

  /// Breadth first from `start` (in that order) over whatever factors determine a place. Returns
  /// what is placed by then: `start` and all that it reached.
  std::vector<int> spread(std::vector<int> start);
  /// From all that is placed.
  void spread();

  /// Ends the placing. What is tied to what is placed by measurements without information in some
  /// directions alone stays in these beside the variable that it is seen from. What no factor ties
  /// to it keeps its state, and places others from there, so that each connected piece is in itself
  /// as measured. Poses before landmarks. Adds notes about it. Then each connected piece goes to
  /// where its absolute positions were measured (`align_with_positions`).
  void finish(std::vector<std::string>& notes);

 private:
  /// Makes `ends_` the states of a factor's variables, in its order. Returns which of them is
  /// `variable`; -1 if another is not placed.
  int find_ends(int variable, int factor);
  bool place_in_part(int variable, int factor);
  void place_the_rest(std::vector<std::string>& notes);
  /// From `start` by measurements in part, and by all that determine a place from there. Returns
  /// the variables that were placed in part.
  std::vector<int> spread_in_part(std::vector<int> start);
  std::vector<int> all_placed() const;

  Graph& graph_;
  FactorsByVariable factors_;
  std::vector<bool> placed_;
  // Kept from call to call, since there is one for each factor:
  std::vector<const double*> ends_;
  std::vector<double> place_;
};

/// "1 pose" or "3 poses".
std::string counted(std::int64_t count, const std::string& singular, const std::string& plural);

}  // namespace cairn::initial
