// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <memory>
#include <string_view>

#include "cairn/graph/graph.hpp"
#include "cairn/io/format.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/optimizer.hpp"

/// Short forms for one's own program: what comes from plugins comes from `default_registry()`
/// unless another registry is given.
namespace cairn {

/// A component by name: make<Optimizer>("dogleg:linear_solver=cholmod"),
/// make<Estimator>("incremental_cholesky"), make<Loss>("cauchy:scale=2").
template <class Interface>
std::unique_ptr<Interface> make(std::string_view spec, Registry& registry = default_registry()) {
  return registry.make<Interface>(spec);
}

/// Minimises chi2 from the graph's states, and leaves the best states found in it. How it ended is
/// `Summary::status`; not converging is no exception.
inline Summary optimize(Graph& graph, std::string_view optimizer = "levenberg_marquardt",
                        const Stop& stop = {}, Registry& registry = default_registry()) {
  return registry.make<Optimizer>(optimizer)->optimize(graph, stop);
}

/// Reads a graph, as `read_graph`: the format is known by content.
inline Graph read(const std::filesystem::path& file, Registry& registry = default_registry()) {
  return read_graph(file, registry);
}

/// Writes a graph, as `write_graph`: the format is known by the file's ending.
inline void write(const Graph& graph, const std::filesystem::path& file,
                  Registry& registry = default_registry()) {
  write_graph(graph, file, registry);
}

}  // namespace cairn
