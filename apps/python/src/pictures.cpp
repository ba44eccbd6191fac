// SPDX-License-Identifier: BSD-3-Clause
// Pictures of graphs by the plugins that draw them.
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <pybind11/pybind11.h>

#include "bindings.hpp"
#include "bound_graph.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/report/album_builder.hpp"
#include "cairn/report/scene.hpp"
#include "component_names.hpp"

namespace cairn::python {
namespace {

py::bytes draw(const py::dict& graphs, const std::string& picture, const py::kwargs& options) {
  std::vector<std::pair<std::string, Graph>> named;
  for (const auto& [name, graph] : graphs)
    named.emplace_back(py::str(name), graph.cast<BoundGraph&>().get().clone());
  const ComponentSpec spec = component_spec(picture, options);
  std::string bytes;
  {
    const py::gil_scoped_release unlocked;
    const auto drawing = default_registry().make<Picture>(spec);
    AlbumBuilder builder([](const std::string&) { return std::optional<Graph>(); });
    for (auto& [name, graph] : named) builder.add_graph(name, name, std::move(graph));
    Album album;
    album.title = named.empty() ? "" : named.front().first;
    builder.finish(album);
    bytes = drawing->draw(album);
  }
  return bytes;
}

}  // namespace

void bind_pictures(py::module_& module) {
  module.def("draw", &draw, py::arg("graphs"), py::arg("picture") = "svg",
             R"(Graphs drawn by a plugin: the bytes of a file.

graphs: a Graph for each name, {"estimate": graph, "truth": other}; those with the same ids are laid over each other, the
    first of those without factors as the truth.
picture: a name of `cairn.components("picture")`, such as "svg", "png", "pdf" or "html" (the page of cairn view), whose
    options are further keyword arguments.)");
}

}  // namespace cairn::python
