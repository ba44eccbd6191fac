// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "blanket_matrices.hpp"
#include "cairn/plugin/registry.hpp"
#include "sparsify/sparsifier/problems.hpp"

namespace cairn::sparsify {

Graph simulate(Registry& registry, const std::string& world, std::uint64_t seed = 5);
/// At its minimum.
Graph solved(Registry& registry, const std::string& world, std::uint64_t seed = 5);

/// What taking `group` successive nodes out leaves, every `step` nodes along the way, where that is
/// a blanket of `least` to `most` nodes.
std::vector<DenseBlanket> blankets(const Graph& graph, int group, int step, int least, int most);

/// Poses in 2 or 3 dimensions at random, all seen from one that then leaves, with some seen from
/// each other. Every pair has a model.
DenseBlanket random_blanket(Registry& registry, int dimension, int nodes, Draw& draw,
                            int more_edges = 0);

/// Λ = Σ J_kᵀ Ω_k J_k of a topology.
void set_information(DenseBlanket& blanket, const std::vector<FactorChoice>& topology,
                     const std::vector<Matrix>& Omega);

std::vector<FactorChoice> every_model(const DenseBlanket& blanket);

/// Whether the factors of a topology connect all nodes.
bool connects(const DenseBlanket& blanket, const std::vector<FactorChoice>& topology);

}  // namespace cairn::sparsify
