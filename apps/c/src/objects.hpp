// SPDX-License-Identifier: BSD-3-Clause
// What the opaque objects of cairn.h are.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cairn.h"
#include "cairn/graph/graph.hpp"
#include "cairn/plugin/registry.hpp"

/// Shared by all that was made from it, which C frees in any order.
struct cairn_registry {
  std::shared_ptr<cairn::Registry> registry;
  std::string text;  ///< handed out last
};

struct cairn_graph {
  std::shared_ptr<cairn::Registry> registry;
  cairn::Graph graph;
  std::string notes = {};
  std::string doubts = {};  ///< those of the notes of the last optimisation
  std::string text = {};    ///< handed out last
};

namespace cairn::c {

/// A variable or factor from what C gives. Throws `Error` for NULL, and tags that there are not.
Variable variable_of(Registry& registry, const char* tag, Id id, std::span<const double> state,
                     bool fixed);
Factor factor_of(Registry& registry, const char* tag, std::span<const Id> ids,
                 std::span<const double> measurement, std::span<const double> information);

/// The indices of variables by id; of all where no array is given. Throws `Error` (usage) for an id
/// that is not there.
std::vector<int> variables_of(const Graph& graph, const Id* ids, std::size_t count);

}  // namespace cairn::c
