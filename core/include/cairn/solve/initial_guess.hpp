// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/runtime/component.hpp"

namespace cairn {

/// Computes an initial estimate of a graph from its factors, replacing the states that it has.
/// Constant variables (fixed by `FIX`, or anchored) keep theirs.
class CAIRN_API InitialGuess : public Component {
 public:
  static constexpr std::string_view kKind = "initial_guess";
  ~InitialGuess() override;

  /// Returns notes for the user (what could not be reached and what was done instead). Throws
  /// `Error` (input) where the graph lacks what the method needs, naming variable and factor.
  virtual std::vector<std::string> compute(Graph& graph) = 0;
};

}  // namespace cairn
