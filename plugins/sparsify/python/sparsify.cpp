// SPDX-License-Identifier: BSD-3-Clause
// cairn.sparsify and cairn.sparsify_edges.
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "bound_graph.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/enum_names.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/sparsification/sparsify_edges.hpp"
#include "cairn/sparsification/sparsify_graph.hpp"
#include "component_names.hpp"
#include "interrupt.hpp"
#include "named_guess.hpp"
#include "result_attributes.hpp"

namespace cairn::python {
namespace {

/// A sparsification, as Python reads it.
struct BoundSparsified {
  SparsifyResult result;  ///< its graph is moved away
  ResultRecord figures;   ///< read before
  std::unique_ptr<BoundGraph> graph;
  std::vector<Id> removed;
  std::optional<SparsifyEdgesResult> edges;  ///< of `sparsify_edges`
};

/// What both functions take: how the graph is optimised before and after.
struct Optimisation {
  NamedGuess initial;
  Stop stop;
  std::shared_ptr<const Loss> loss;
  FactorSelector loss_on;

  Optimisation(const py::object& guess, bool as_given, int max_iterations, double tolerance,
               const py::object& loss_name, const std::string& on)
      : initial(as_given ? py::object(py::none()) : guess), loss(loss_of(loss_name)) {
    stop.max_iterations = max_iterations;
    stop.tolerance = tolerance;
    check(stop);
    if (loss) loss_on = selector_of(on);
  }

  /// The graph's own losses stay unless one is given.
  SparsifySetting setting(const InterruptGuard& guard) {
    stop.interrupt = &guard.flag();
    return {.registry = default_registry(),
            .stop = stop,
            .loss = loss,
            .loss_on = loss_on,
            .initialise = [this, &guard](Graph& graph) {
              if (loss) graph.set_loss(loss, loss_on);
              return initial.compute(graph, guard.flag());
            }};
  }
};

ComponentSpec sparsifier_spec(const std::string& sparsifier, const py::kwargs& options) {
  ComponentSpec spec = component_spec(sparsifier, options, Sparsifier::kKind, "sparsify");
  choose_recovery(spec);
  return spec;
}

std::unique_ptr<BoundSparsified> sparsify(
    BoundGraph& bound, std::optional<int> keep_every, std::optional<std::string> select,
    const std::string& nodes, int online, const std::string& sparsifier,
    const std::string& optimizer, const std::string& linear_solver, const std::string& estimator,
    const py::object& initial, bool as_given, bool measure, int max_iterations, double tolerance,
    const py::object& loss, const std::string& loss_on, const py::kwargs& options) {
  if (keep_every && select)
    throw Error(ErrorCode::usage, "keep_every and select both say which nodes leave: give one");
  SparsifyJob job;
  job.sparsifier = sparsifier_spec(sparsifier, options);
  job.selection = parse_component(keep_every ? fmt::format("keep_every:every={}", *keep_every)
                                             : select.value_or(SparsifyJob::kDefaultSelection));
  job.nodes = parse_enum<NodeKind>(nodes, "nodes");
  job.optimizer = parse_component(optimizer);
  job.linear_solver = linear_solver;
  job.estimator = estimator;
  if (online < 0)
    throw Error(ErrorCode::usage, "online: expected a number of poses, or 0 for all at once");
  job.online = online;
  job.as_given = as_given;
  job.measure = measure;
  Optimisation optimisation(initial, as_given, max_iterations, tolerance, loss, loss_on);
  auto out = std::make_unique<BoundSparsified>();
  const GraphUse use(bound);
  const InterruptGuard guard;
  {
    const py::gil_scoped_release unlocked;
    const SparsifySetting setting = optimisation.setting(guard);
    out->result = online > 0 ? sparsify_online(use.graph(), job, setting)
                             : sparsify_whole(use.graph(), job, setting);
  }
  guard.absorb();
  for (int v = 0; v < use.graph().variable_count(); ++v) {
    if (!out->result.sparse.find(use.graph().id(v))) out->removed.push_back(use.graph().id(v));
  }
  out->figures = result_record(out->result);
  out->graph = std::make_unique<BoundGraph>(std::move(out->result.sparse));
  return out;
}

std::unique_ptr<BoundSparsified> sparsify_loop_closures(
    BoundGraph& bound, const std::string& selection, const std::string& optimizer,
    const std::string& linear_solver, const py::object& initial, bool as_given, bool measure,
    int max_iterations, double tolerance, const py::object& loss, const std::string& loss_on,
    const py::kwargs& options) {
  const SparsifyEdgesJob job{
      .selection = component_spec(selection, options, EdgeSelection::kKind, "sparsify_edges"),
      .optimizer = parse_component(optimizer),
      .linear_solver = linear_solver,
      .as_given = as_given,
      .measure = measure};
  Optimisation optimisation(initial, as_given, max_iterations, tolerance, loss, loss_on);
  auto out = std::make_unique<BoundSparsified>();
  const GraphUse use(bound);
  const InterruptGuard guard;
  {
    const py::gil_scoped_release unlocked;
    out->edges = sparsify_edges(use.graph(), job, optimisation.setting(guard));
  }
  guard.absorb();
  out->result = std::move(out->edges->whole);
  out->figures = result_record(out->result);
  out->graph = std::make_unique<BoundGraph>(std::move(out->result.sparse));
  return out;
}

// The result --------------------------------------------------------------------------------------

py::list refused_of(const BoundSparsified& bound) {
  py::list refused;
  for (const RefusedNode& node : bound.result.change.refused)
    refused.append(py::make_tuple(node.node, node.reason));
  return refused;
}

py::object connectivity_of(const BoundSparsified& bound) {
  if (!bound.edges) return py::none();
  py::dict all;
  for (const EdgeWeight weight : {EdgeWeight::rotation, EdgeWeight::translation}) {
    const Connectivity& of = bound.edges->connectivity[static_cast<std::size_t>(weight)];
    all[py::str(std::string(to_string(weight)))] = dict_of(result_record(of));
  }
  return all;
}

std::vector<std::string> notes_of(const BoundSparsified& bound) {
  std::vector<std::string> notes = bound.result.notes;
  for (std::string& line : bound.result.change.note_lines()) notes.push_back(std::move(line));
  return notes;
}

void bind_sparsified(py::module_& module) {
  py::class_<BoundSparsified> type(module, "SparsifyResult", "A sparse graph, and what was lost.");
  type.def_property_readonly(
          "graph", [](const BoundSparsified& bound) { return bound.graph.get(); },
          py::return_value_policy::reference_internal, "The sparse graph at its minimum.")
      .def_property_readonly(
          "removed", [](const BoundSparsified& bound) { return array_of_ids(bound.removed); },
          "Ids of the variables that have left: (n,) integers.")
      .def_property_readonly("refused", &refused_of,
                             "Chosen variables that could not leave: (id, reason) each.")
      .def_property_readonly(
          "connectivity", &connectivity_of,
          "Of `sparsify_edges`: the algebraic connectivity by 'rotation' and "
          "'translation': 'full', 'sparse', and an upper 'bound' of any choice of "
          "as many edges (NaN: not known). Else None.")
      .def_property_readonly("notes", &notes_of, "Sentences for the user.")
      .def("__repr__", [](const BoundSparsified& bound) {
        const auto& result = bound.result;
        return fmt::format("<cairn.SparsifyResult {}: {} removed, KLD {:.4g} nats>",
                           to_string(result.interrupted ? Status::interrupted : result.status),
                           bound.removed.size(), result.error ? result.error->kld : std::nan(""));
      });
  bind_fields<SparsifyResult>(type, &BoundSparsified::figures);
}

}  // namespace

void bind_sparsify(py::module_& module) {
  bind_sparsified(module);
  module.def(
      "sparsify", &sparsify, py::arg("graph"), py::kw_only(), py::arg("keep_every") = py::none(),
      py::arg("select") = py::none(), py::arg("nodes") = "poses", py::arg("online") = 0,
      py::arg("sparsifier") = "sparsify", py::arg("optimizer") = "levenberg_marquardt",
      py::arg("linear_solver") = "block_cholesky", py::arg("estimator") = "incremental_cholesky",
      py::arg("initial") = "auto", py::arg("as_given") = false, py::arg("measure") = true,
      py::arg("max_iterations") = Stop().max_iterations, py::arg("tolerance") = Stop().tolerance,
      py::arg("loss") = py::none(), py::arg("loss_on") = "all",
      R"(Takes variables out of a graph and keeps their information in a few factors (docs/sparsify.md); returns a SparsifyResult.

graph: is optimised in a copy, and stays as it is.
keep_every: one of so many poses stays. Or
select: which leave, a name of `cairn.components("node_selection")`; by default half of them, those with the fewest
    neighbours first.
nodes: what may leave: "poses", "landmarks" or "all".
online: feeds the graph to an estimator pose by pose, and takes poses out after every so many; 0: the whole graph at once.
sparsifier: a name of `cairn.components("sparsifier")`; its options are further keyword arguments, such as topology="clt",
    population="tree:1.5", recovery="ip" or scheme="runs".
linear_solver: of the divergence. estimator: of `online`.
as_given: the graph is at its minimum, and is not optimised before.
measure: whether to compute what was lost: kld, rmse and conservative_margin.
optimizer, initial, max_iterations, tolerance, loss, loss_on: as of `cairn.optimize`.

Ctrl-C ends it, with what was done so far. The interpreter's lock is released meanwhile.)");
  module.def("sparsify_edges", &sparsify_loop_closures, py::arg("graph"), py::arg("selection"),
             py::kw_only(), py::arg("optimizer") = "levenberg_marquardt",
             py::arg("linear_solver") = "block_cholesky", py::arg("initial") = "auto",
             py::arg("as_given") = false, py::arg("measure") = true,
             py::arg("max_iterations") = Stop().max_iterations,
             py::arg("tolerance") = Stop().tolerance, py::arg("loss") = py::none(),
             py::arg("loss_on") = "all",
             R"(Takes loop closures out of a graph; all variables stay. Returns a SparsifyResult.

selection: which stay, a name of `cairn.components("edge_selection")`; its options are further keyword arguments, such as
    part=0.25. All others are as of `sparsify`.)");
}

}  // namespace cairn::python
