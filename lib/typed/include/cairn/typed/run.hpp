// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "cairn/graph/graph.hpp"
#include "cairn/io/format.hpp"
#include "cairn/io/losses_not_written.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/api.hpp"
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

/// Minimises chi2, and leaves the best states found in the graph. The start is chosen by the
/// initial guess `auto`, as `cairn optimize` does: the graph's states if they are good, else the
/// best of others by chi2, and lower minima are looked for where that went far (`look_again`); a
/// note says what was chosen where it is not the graph's states. Notes say as well what is to be
/// said of the result (`notes_on_estimate`). How it ended is `Summary::status`; not converging is
/// no exception. Without the plugin of initial guesses it starts from the graph's states.
CAIRN_API Summary optimize(Graph& graph, std::string_view optimizer = "levenberg_marquardt",
                           const Stop& stop = {}, Registry& registry = default_registry());

/// The same from the graph's states, without a choice: for states that are known to be good, as
/// those of a graph that was optimised and has a few new factors. Takes less time, and ends in a
/// local minimum where the states lie near one.
CAIRN_API Summary optimize_from_states(Graph& graph,
                                       std::string_view optimizer = "levenberg_marquardt",
                                       const Stop& stop = {},
                                       Registry& registry = default_registry());

/// Reads a graph, as `read_graph`: the format is known by content.
inline Graph read(const std::filesystem::path& file, Registry& registry = default_registry()) {
  return read_graph(file, registry);
}

/// Writes a graph, as `write_graph`: the format is known by the file's ending. Returns what of the
/// graph is not in the file (`losses_not_written`), or an empty text.
inline std::string write(const Graph& graph, const std::filesystem::path& file,
                         Registry& registry = default_registry()) {
  write_graph(graph, file, registry);
  return losses_not_written(graph);
}

}  // namespace cairn
