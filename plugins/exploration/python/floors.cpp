// SPDX-License-Identifier: BSD-3-Clause
// cairn.Floor: occupancy grids, from files, generated, or from an array.
#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <system_error>
#include <vector>

#include <fmt/core.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "cairn/grid/floor_plan.hpp"
#include "cairn/grid/grid.hpp"
#include "cairn/grid/grid_format.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "component_names.hpp"
#include "floors.hpp"
#include "ids.hpp"
#include "missing.hpp"

namespace cairn::python {
namespace {

const char* const kDoc =
    R"(The map of a floor: square cells with the probability of being occupied in per cent, or -1 where that is unknown.

cells: (rows, columns) integers; row 0 is the lowest, x counts columns to the right and y rows upwards.
resolution: the side of a cell [m].
origin: x y [m] of the lower left corner of cell (0, 0), and the angle [rad] by which the grid is turned about it.)";

/// Of an array, at most as many as an `int` can be, which no floor has.
int count_of(py::ssize_t size) {
  return static_cast<int>(std::min<py::ssize_t>(size, std::numeric_limits<int>::max()));
}

OccupancyGrid make(const py::object& given, double resolution, const std::vector<double>& origin) {
  const py::array of_any_type = py::array::ensure(given);
  if (!of_any_type) {
    PyErr_Clear();
    throw Error(ErrorCode::usage, "cells: expected (rows, columns) integers");
  }
  const char kind = of_any_type.dtype().kind();
  if (kind != 'i' && kind != 'u') {
    throw Error(ErrorCode::usage,
                fmt::format("cells: expected integers, per cent or -1, not numbers of type {}",
                            std::string(py::str(of_any_type.dtype()))));
  }
  if (kind == 'u' && of_any_type.itemsize() == sizeof(std::uint64_t))
    throw Error(ErrorCode::usage, "cells: uint64 is too large for per cent; use int8");
  if (of_any_type.ndim() != 2)
    throw Error(ErrorCode::usage, fmt::format("cells: the shape is {}, expected (rows, columns)",
                                              shape_text(of_any_type)));
  if (origin.size() != 3)
    throw Error(ErrorCode::usage, "origin: expected x y [m] and an angle [rad]");
  OccupancyGrid floor;
  floor.frame.height = count_of(of_any_type.shape(0));
  floor.frame.width = count_of(of_any_type.shape(1));
  floor.frame.resolution = resolution;
  floor.frame.origin = {origin[0], origin[1]};
  floor.frame.yaw = origin[2];
  check_frame(floor.frame, "Floor");  // before the cells are copied
  const auto cells = py::array_t<std::int64_t, py::array::c_style>::ensure(of_any_type);
  floor.occupancy.reserve(static_cast<std::size_t>(cells.size()));
  for (py::ssize_t k = 0; k < cells.size(); ++k) {
    const std::int64_t value = cells.data()[k];
    if (value < kUnknownCell || value > 100) {
      throw Error(
          ErrorCode::usage,
          fmt::format("cells: {} is neither per cent, 0 to 100, nor -1 for unknown", value));
    }
    floor.occupancy.push_back(static_cast<std::int8_t>(value));
  }
  return floor;
}

py::array_t<std::int8_t> cells_of(const OccupancyGrid& floor) {
  py::array_t<std::int8_t> cells({floor.frame.height, floor.frame.width});
  std::ranges::copy(floor.occupancy, cells.mutable_data());
  return cells;
}

/// The name of a floor plan without its @ is no file.
void check_is_file(const std::string& name) {
  const ComponentSpec spec = parse_component(name.substr(0, name.find(':')));
  if (std::filesystem::exists(name) || !default_registry().has(FloorPlan::kKind, spec.name)) return;
  throw MissingFile(
      Error(ErrorCode::input,
            fmt::format("there is no file '{0}'; '@{0}' makes that floor plan", name)),
      name);
}

OccupancyGrid read(const std::filesystem::path& path) {
  const py::gil_scoped_release unlocked;
  const std::string name = path.string();
  return with_file(path, name.substr(0, name.find(':')),  // options may follow
                   [&] { return read_grid(name, default_registry()); });
}

OccupancyGrid generate(const std::string& plan, std::uint64_t seed, const py::kwargs& options) {
  const ComponentSpec spec = component_spec(plan, options, FloorPlan::kKind, "generate_floor");
  const py::gil_scoped_release unlocked;
  return default_registry().make<FloorPlan>(spec)->generate(seed);
}

/// "rooms:width=12,seed=3", as the program takes it after an @.
OccupancyGrid generate_named(const std::string& plan) {
  ComponentSpec spec = parse_component(plan);
  std::uint64_t seed = 0;  // the program's
  const auto given = spec.values.find("seed");
  if (given != spec.values.end() &&
      !default_registry().options(FloorPlan::kKind, spec.name).find("seed")) {
    const std::string& text = given->second;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), seed);
    if (error != std::errc() || end != text.data() + text.size()) {
      throw Error(ErrorCode::usage,
                  fmt::format("@{}: the seed is '{}', expected an integer from 0", plan, text));
    }
    spec.values.erase(given);
  }
  const py::gil_scoped_release unlocked;
  return default_registry().make<FloorPlan>(spec)->generate(seed);
}

}  // namespace

OccupancyGrid floor_of(const py::object& given) {
  if (py::isinstance<OccupancyGrid>(given)) return given.cast<OccupancyGrid>();
  if (py::isinstance<py::str>(given)) {
    const auto name = given.cast<std::string>();
    if (name.starts_with('@')) return generate_named(name.substr(1));
    check_is_file(name);
    return read(name);
  }
  if (py::hasattr(given, "__fspath__")) return read(given.cast<std::filesystem::path>());
  throw py::type_error(fmt::format(
      "floor: expected a cairn.Floor, the name of a file such as 'floor.yaml', or a floor plan "
      "such as '@rooms', not a {}",
      type_name(given)));
}

void bind_floors(py::module_& module) {
  py::class_<OccupancyGrid>(module, "Floor", kDoc)
      .def(py::init(&make), py::arg("cells"), py::arg("resolution"),
           py::arg("origin") = std::vector<double>{0.0, 0.0, 0.0})
      .def_property_readonly("cells", &cells_of,
                             "(rows, columns) integers of 8 bits: per cent, or -1; row 0 is the "
                             "lowest.")
      .def_property_readonly(
          "resolution", [](const OccupancyGrid& floor) { return floor.frame.resolution; },
          "The side of a cell [m].")
      .def_property_readonly(
          "origin",
          [](const OccupancyGrid& floor) {
            return py::make_tuple(floor.frame.origin.x(), floor.frame.origin.y(), floor.frame.yaw);
          },
          "x y [m] of the lower left corner of cell (0, 0), and the angle [rad] of the grid.")
      .def(
          "write",
          [](const OccupancyGrid& floor, const std::filesystem::path& path) {
            const py::gil_scoped_release unlocked;
            with_file(path, path.parent_path(),
                      [&] { write_grid(floor, path.string(), default_registry()); });
          },
          py::arg("path"), "Writes it: floor.yaml, with floor.png beside it, as ROS' map server.")
      .def("__repr__", [](const OccupancyGrid& floor) {
        return fmt::format("<cairn.Floor: {} x {} cells of {:g} m>", floor.frame.width,
                           floor.frame.height, floor.frame.resolution);
      });
  module.def("read_floor", &read, py::arg("path"),
             "Reads a Floor: floor.yaml as ROS' map server has it, or an image as "
             "'picture.png:resolution=0.05'.");
  module.def("generate_floor", &generate, py::arg("plan"), py::arg("seed") = 1,
             R"(Makes the Floor of a building, the same on every machine.

plan: a name of `cairn.components("floor_plan")`, whose options are the other keyword arguments.)");
}

}  // namespace cairn::python
