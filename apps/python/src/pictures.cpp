// SPDX-License-Identifier: BSD-3-Clause
// Pictures of graphs by the plugins that draw them.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <pybind11/pybind11.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "bound_graph.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/report/album_builder.hpp"
#include "cairn/report/run_report.hpp"
#include "cairn/report/scene.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/typed/symbol.hpp"
#include "component_names.hpp"
#include "missing.hpp"

namespace cairn::python {
namespace {

/// The graph that `what` is. Throws a `TypeError` for anything else.
BoundGraph& bound_graph_of(const py::handle& given, const std::string& what) {
  if (py::isinstance<BoundGraph>(given)) return given.cast<BoundGraph&>();
  throw py::type_error(what + ": expected a cairn.Graph, not a value of type " +
                       Py_TYPE(given.ptr())->tp_name);
}

/// Throws `Error` (usage) for a block with a number that no covariance has.
void check_covariance(std::span<const double> block, int size, const std::string& what, Id id) {
  if (!std::ranges::all_of(block, [](double number) { return std::isfinite(number); })) {
    throw Error(ErrorCode::usage,
                fmt::format("{}: the covariance of variable {} has a number that is not finite",
                            what, id_text(id)));
  }
  for (std::size_t k = 0; k < block.size(); k += static_cast<std::size_t>(size) + 1) {
    if (block[k] >= 0.0) continue;
    throw Error(ErrorCode::usage, fmt::format("{}: the covariance of variable {} has the negative "
                                              "variance {:g} on its diagonal",
                                              what, id_text(id), block[k]));
  }
}

/// What `covariances` has for a graph: ids, and a block (d, d) for each.
std::vector<ReportedCovariance> covariances_of(const py::object& given, const std::string& name,
                                               const Graph& graph) {
  const std::string what = fmt::format("covariances['{}']", name);
  if (!py::isinstance<py::tuple>(given) || py::len(given) != 2) {
    throw Error(ErrorCode::usage,
                what + ": expected ids and their covariances (n, d, d), as cairn.marginals gives");
  }
  const Ids ids = ids_of(given[py::int_(0)], what);
  const Doubles blocks = doubles_of(given[py::int_(1)], what);
  if (blocks.ndim() != 3 || blocks.shape(0) != ids.size() || blocks.shape(1) != blocks.shape(2)) {
    throw Error(ErrorCode::usage, fmt::format("{}: the shape is {}, expected ({}, d, d)", what,
                                              shape_text(blocks), ids.size()));
  }
  const std::span<const double> numbers = span_of(blocks);
  const std::size_t size = ids.size() == 0 ? 0 : numbers.size() / span_of(ids).size();
  std::vector<ReportedCovariance> all;
  for (const Id id : span_of(ids)) {
    const std::optional<int> variable = graph.find(id);
    if (!variable) {
      throw MissingKey(fmt::format("{}: there is no variable {}", what, id_text(id)));
    }
    const std::span<const double> block = numbers.subspan(all.size() * size, size);
    const int d = graph.type(*variable).tangent_size();
    if (blocks.shape(1) != d) {
      throw Error(ErrorCode::usage,
                  fmt::format("{}: blocks of {} x {} for variable {}, whose covariance is {} x {}",
                              what, blocks.shape(1), blocks.shape(1), id_text(id), d, d));
    }
    check_covariance(block, d, what, id);
    all.push_back({id, {block.begin(), block.end()}});
  }
  return all;
}

struct NamedGraph {
  std::string name;
  Graph graph;
  std::vector<ReportedCovariance> covariances;
};

std::vector<NamedGraph> named_graphs(const py::dict& graphs, const py::object& covariances) {
  if (graphs.empty()) {
    throw Error(ErrorCode::usage,
                "draw: there is no graph to draw; expected a cairn.Graph for each name, "
                "{\"estimate\": graph}");
  }
  if (!covariances.is_none() && !py::isinstance<py::dict>(covariances)) {
    throw py::type_error(
        std::string("covariances: expected ids and covariances for each name, {\"estimate\": "
                    "(ids, cairn.marginals(graph, ids))}, not a value of type ") +
        Py_TYPE(covariances.ptr())->tp_name);
  }
  const py::dict given = covariances.is_none() ? py::dict() : py::dict(covariances);
  for (const auto& [name, ignored] : given) {
    if (!graphs.contains(name)) {
      throw Error(ErrorCode::usage, fmt::format("covariances: there is no graph of the name '{}'",
                                                std::string(py::str(name))));
    }
  }
  std::vector<NamedGraph> named;
  for (const auto& [name, graph] : graphs) {
    const Graph& own =
        bound_graph_of(graph, fmt::format("graphs['{}']", std::string(py::str(name)))).get();
    NamedGraph& one = named.emplace_back(NamedGraph{py::str(name), own.clone(), {}});
    if (given.contains(name)) one.covariances = covariances_of(given[name], one.name, own);
  }
  return named;
}

py::bytes draw(const py::dict& graphs, const std::string& picture, const py::object& truth,
               const py::object& covariances, const py::kwargs& options) {
  constexpr const char *kEllipses = "ellipses", *kThreeSigma = "3";
  std::vector<NamedGraph> named = named_graphs(graphs, covariances);
  std::optional<Graph> true_graph;
  if (!truth.is_none()) true_graph = bound_graph_of(truth, "truth").get().clone();
  ComponentSpec spec = component_spec(picture, options, Picture::kKind, "draw");
  std::string bytes;
  {
    const py::gil_scoped_release unlocked;
    if (!covariances.is_none() &&
        default_registry().options(Picture::kKind, spec.name).find(kEllipses))
      spec.values.emplace(kEllipses, kThreeSigma);
    const auto drawing = default_registry().make<Picture>(spec);
    AlbumBuilder builder([](const std::string&) { return std::optional<Graph>(); });
    for (NamedGraph& one : named)
      builder.add_graph(one.name, one.name, std::move(one.graph), one.covariances);
    if (true_graph) {
      builder.set_truth("truth", std::move(*true_graph));
      builder.align_to_truth();
    }
    Album album;
    album.title = named.empty() ? "" : named.front().name;
    builder.finish(album);
    bytes = drawing->draw(album);
  }
  return bytes;
}

}  // namespace

void bind_pictures(py::module_& module) {
  module.def("draw", &draw, py::arg("graphs"), py::arg("picture") = "svg", py::kw_only(),
             py::arg("truth") = py::none(), py::arg("covariances") = py::none(),
             "Graphs drawn by a plugin: the bytes of a file.");
}

}  // namespace cairn::python
