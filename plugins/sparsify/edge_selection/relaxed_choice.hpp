// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "budget.hpp"
#include "edge_selections.hpp"

namespace cairn::edges {

/// The choice of these of the candidates, by number.
EdgeChoice choice_of(std::span<const int> candidates, const std::vector<int>& numbers);
/// What a selection returns that `step` has ended.
EdgeChoice interrupted_choice();

struct RelaxedChoice {
  EdgeChoice choice;
  double bound = 0.0;  ///< `Relaxed::bound`
};

/// `count` of the candidates: the best rounding of the weights with which `f` is largest.
RelaxedChoice relaxed_choice(std::span<const int> candidates, int count,
                             const RelaxationOptions& options, const ConcaveFunction& f,
                             const EdgeSelection::Step& step);

}  // namespace cairn::edges
