// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <span>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/enum_names.hpp"

namespace cairn {

/// How the factors of a graph are divided where loop closures leave and all variables stay.
struct LoopClosures {
  std::vector<int> backbone;    ///< a spanning forest of relative factors, by position, rising
  std::vector<int> candidates;  ///< the relative factors that may leave, by position, rising
  int odometry = 0;             ///< of the backbone: between poses whose ids follow each other
  int components = 0;           ///< of variables that relative factors join
};

/// Divides the factors of `graph`. Whatever leaves of `candidates`, the rest determines all that
/// the whole graph does.
///
/// The backbone is a spanning forest of the relative factors whose information has full rank: the
/// odometry as far as there is one, and else the factors with the largest ln |Ω| (Kruskal). Those
/// of them that are left over are the candidates. All other factors stay: priors, observations of
/// landmarks, relative factors that measure a part of the relative pose only, and those between two
/// fixed variables.
CAIRN_API LoopClosures find_loop_closures(const Graph& graph);

/// Which part of a relative pose weighs an edge.
enum class EdgeWeight { rotation, translation };
constexpr auto enum_names(EdgeWeight) {
  return std::to_array<EnumName<EdgeWeight>>(
      {{EdgeWeight::rotation, "rotation"}, {EdgeWeight::translation, "translation"}});
}

/// A relative factor as an edge of a graph: between which variables, and the isotropic information
/// of its two parts, n / tr(Ω_part⁻¹) with n coordinates, as SE-Sync (Rosen et al.,
/// IJRR 2019) has it up to a factor. Ω is that of the relative pose in the frame of the second
/// variable, at the graph's states and with the weight of the factor's loss; 0: there is no such
/// part.
struct RelativeEdge {
  std::array<int, 2> variables{};
  double rotation = 0.0;     ///< [1/rad²]; types without a position are all rotation
  double translation = 0.0;  ///< [1/m²]

  double weight(EdgeWeight by) const { return by == EdgeWeight::rotation ? rotation : translation; }
};

/// Those of these relative factors, by position.
CAIRN_API std::vector<RelativeEdge> relative_edges(const Graph& graph,
                                                   std::span<const int> factors);

}  // namespace cairn
