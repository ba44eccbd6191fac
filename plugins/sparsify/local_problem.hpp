// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "approximation.hpp"
#include "cairn/sparsification/sparsification.hpp"
#include "work_graph.hpp"

namespace cairn::sparsify {

/// Nodes that leave together, the Markov blanket around them, and the factors that are cropped with
/// them: all on the nodes that leave, and those within the blanket (T 4.2).
struct LocalProblem {
  std::vector<int> removed, blanket;       ///< variables of the graph
  std::vector<int> factors;                ///< of the work graph
  std::string refusal;                     ///< why these nodes cannot leave; empty: they can
  std::shared_ptr<const FactorType> type;  ///< of the factors to come
};

/// Crops it. `removed` must be connected, or alone.
LocalProblem crop(const WorkGraph& work, std::vector<int> removed);

/// What is left of it on the blanket.
struct Marginal {
  DenseBlanket dense;                         ///< models: a relative factor for each pair of nodes
  std::vector<std::vector<double>> states;    ///< of the blanket, where it was linearised
  std::vector<std::vector<double>> relative;  ///< by model: x_a⁻¹ x_b there
};

/// Solves the cropped problem by itself (`resolve`; else the graph's states stand), linearises it
/// and takes the removed nodes out by the Schur complement. By itself it says only what its own
/// factors do: so the new ones do not repeat what the rest of the graph says, and the minimum of
/// the whole stays where it is. Throws `Error` (numerical) where its factors leave a removed node
/// open.
Marginal marginalize(const WorkGraph& work, const LocalProblem& local, bool resolve);

}  // namespace cairn::sparsify
