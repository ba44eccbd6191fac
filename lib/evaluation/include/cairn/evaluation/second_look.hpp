// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/solve/optimizer.hpp"

namespace cairn {

/// Ability of an initial guess to judge its choice by where it has led: chi2 has several minima,
/// and how an optimisation went shows whether a lower one is likely.
class CAIRN_API SecondLook {
 public:
  static constexpr std::string_view kAbility = "second_look";

  struct Result {
    bool lower = false;              ///< the graph has states from which a lower minimum is reached
    std::vector<std::string> notes;  ///< for the user: what was found
    std::string doubt;  ///< why a lower minimum is likely all the same; empty: it is not
  };

  /// `graph` is where an optimisation has converged from the states that `compute` had left;
  /// `summary` is its own. Where that gives reason to, other starts are optimised. The graph gets
  /// the best states found, and keeps its own where none are better.
  virtual Result look_again(Graph& graph, const Summary& summary) = 0;

 protected:
  ~SecondLook() = default;
};

}  // namespace cairn
