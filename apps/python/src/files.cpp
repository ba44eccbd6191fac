// SPDX-License-Identifier: BSD-3-Clause
// Reading, writing and generating graphs.
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl/filesystem.h>

#include "bindings.hpp"
#include "bound_graph.hpp"
#include "cairn/evaluation/trajectory.hpp"
#include "cairn/io/format.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/io/losses_not_written.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "component_names.hpp"
#include "missing.hpp"

namespace cairn::python {
namespace {

std::vector<std::string> notes_of(const ReadReport& report) {
  std::vector<std::string> notes = report.notes;
  for (const auto& [tag, lines] : report.skipped)
    notes.push_back(fmt::format("skipped {} line{} with the unknown tag {}", lines,
                                lines == 1 ? "" : "s", tag));
  if (report.repaired > 0)
    notes.push_back(fmt::format("repaired {} information matrices", report.repaired));
  return notes;
}

std::unique_ptr<BoundGraph> read(const std::filesystem::path& path, const std::string& format,
                                 bool skip_unknown, bool repair_information, bool unit_information,
                                 bool skip_dangling, const std::string& axes) {
  if (axes != "robot" && axes != "camera")
    throw Error(ErrorCode::usage, fmt::format("axes='{}': expected 'robot' or 'camera'", axes));
  const py::gil_scoped_release unlocked;
  ReadReport report;
  const ReadOptions options{skip_unknown, repair_information, unit_information, skip_dangling};
  auto bound = std::make_unique<BoundGraph>(with_file(
      path, path, [&] { return read_graph(path, default_registry(), options, report, format); }));
  bound->notes = notes_of(report);
  if (report.truth) {
    bound->truth = std::make_unique<BoundGraph>(std::move(*report.truth));
    bound->truth->stamps = report.stamps;
  }
  bound->stamps = std::move(report.stamps);
  bound->row_ids = report.row_ids;
  if (axes == "camera") {
    try {
      camera_to_robot_axes(bound->get());
    } catch (const Error& error) {
      throw Error(error.code(), fmt::format("{}: axes='camera': {}", path.string(), error.what()));
    }
  }
  return bound;
}

void write(BoundGraph& bound, const std::filesystem::path& path, const std::string& format) {
  const GraphUse use(bound);
  {
    const py::gil_scoped_release unlocked;
    with_file(path, path.parent_path(),
              [&] { write_graph(use.graph(), path, default_registry(), format, bound.stamps); });
  }
  const std::string note = losses_not_written(use.graph());
  if (!note.empty() && PyErr_WarnEx(PyExc_UserWarning, note.c_str(), 1) != 0)
    throw py::error_already_set();
}

std::pair<std::unique_ptr<BoundGraph>, std::unique_ptr<BoundGraph>> generate(
    const std::string& generator, std::uint64_t seed, const py::kwargs& options) {
  const ComponentSpec spec = component_spec(generator, options, Generator::kKind, "generate");
  const py::gil_scoped_release unlocked;
  Simulation simulation =
      default_registry().make<Generator>(spec)->generate(default_registry(), seed);
  return {std::make_unique<BoundGraph>(std::move(simulation.graph)),
          std::make_unique<BoundGraph>(std::move(simulation.truth))};
}

}  // namespace

void bind_files(py::module_& module) {
  module.def("read", &read, py::arg("path"), py::arg("format") = "", py::kw_only(),
             py::arg("skip_unknown") = false, py::arg("repair_information") = false,
             py::arg("unit_information") = false, py::arg("skip_dangling") = false,
             py::arg("axes") = "robot",
             R"(Reads a graph or a trajectory, plain or packed with gzip.

format: a name of `cairn.components("format")`; empty: by the content.
skip_unknown: skips lines with unknown tags, counted in `Graph.notes`, instead of an Error.
repair_information: repairs known mistakes in published information matrices.
unit_information: takes factors whose lines have no information as of unit information.
skip_dangling: leaves out factors on variables that the file does not have, such as those of another robot.
axes: "camera" turns a trajectory in the axes of a camera (x right, y down, z ahead), as KITTI's are, into a robot's (x ahead,
y left, z up).
The true states, where the file has them beside (format pyfg), are `Graph.truth`.)");
  module.def("write", &write, py::arg("graph"), py::arg("path"), py::arg("format") = "",
             R"(Writes a graph: its estimate and, where the format has them, its factors.

format: a name of `cairn.components("format")`; empty: by the ending of the name, before .gz, which packs. The file is
written beside and renamed, so that a failure never leaves half a file. Trajectory formats (tum, kitti) get the poses
alone; tum with `Graph.stamps` where there are any, else with the ids as stamps. No format has robust losses: a graph
with some is written without them, with a UserWarning.)");
  const py::object graph = module.attr("Graph");
  graph.attr("write") =
      py::cpp_function(&write, py::name("write"), py::is_method(graph), py::arg("path"),
                       py::arg("format") = "", "Writes the graph, as `cairn.write(graph, path)`.");
  module.def("generate", &generate, py::arg("generator"), py::arg("seed") = 1,
             R"(A simulated data set: (graph, truth), both a Graph.

generator: a name of `cairn.components("generator")`, whose options are the other keyword arguments. The same options and
seed give the same graph on every machine.)");
}

}  // namespace cairn::python
