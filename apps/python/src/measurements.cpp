// SPDX-License-Identifier: BSD-3-Clause
// Measurements as Python values.
#include <string>
#include <utility>

#include <fmt/core.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/typed/measurements.hpp"
#include "cairn/typed/symbol.hpp"
#include "component_names.hpp"
#include "ids.hpp"
#include "measured.hpp"
#include "python_factor.hpp"

namespace cairn::python {
namespace {

/// A measurement of the typed layer, as `Kind` (one of those of `measured.hpp`).
template <class Kind, class M>
Kind measured_as(const M& measurement) {
  return Kind{{std::string(M::kTag), measurement.variables(), measurement.numbers()}};
}

template <class Pose>
MeasuredBetween between(Id from, Id to, const Pose& pose) {
  return measured_as<MeasuredBetween>(Between<Pose>(from, to, pose));
}
template <class T>
MeasuredPrior prior(Id id, const T& value) {
  return measured_as<MeasuredPrior>(Prior<T>(id, value));
}
template <class Point>
MeasuredPosition position(Id pose, const Point& point) {
  return measured_as<MeasuredPosition>(Position<Point>(pose, point));
}
template <class Point>
MeasuredObservation observation(Id pose, Id landmark, const Point& point) {
  return measured_as<MeasuredObservation>(Observation<Point>(pose, landmark, point));
}

std::string text_of(const Measured& measured) {
  std::string text = measured.tag;
  for (const Id id : measured.ids) text += " " + id_text(id);
  text += ":";
  for (const double number : measured.numbers) text += fmt::format(" {:.6g}", number);
  return "<" + text + ">";
}

/// Classes know the tags of their factor types.
template <class... M>
py::tuple tags() {
  return py::make_tuple(std::string(M::kTag)...);
}

/// What has not been a measurement of any kind that there is.
[[noreturn]] void refuse(const char* kind, const py::tuple& ids, const py::object& measured,
                         const char* example) {
  for (const py::handle id : ids) refuse_id_that_is_none(py::reinterpret_borrow<py::object>(id));
  throw py::type_error(fmt::format("{}: what is measured is a value such as {}, not a {}", kind,
                                   example, type_name(measured)));
}

void bind_measurement(py::module_& module) {
  py::class_<Measured>(
      module, "Measurement",
      R"(A measurement of any factor type: on which variables it is, and what was measured.

type: tag of the factor type, as in files (`cairn.components("factor")` lists them), or a FactorType.
ids: the variables, in the order of the type.
values: the numbers measured, in the order and the units of the type.)")
      .def(py::init([](const py::object& type, const py::object& ids, const py::object& values) {
             const Ids variables = ids_of(ids, "ids");
             const Doubles numbers = doubles_of(values, "values");
             return Measured{tag_of(type),
                             {span_of(variables).begin(), span_of(variables).end()},
                             {span_of(numbers).begin(), span_of(numbers).end()},
                             python_factor(type)};
           }),
           py::arg("type"), py::arg("ids"), py::arg("values"))
      .def_readonly("tag", &Measured::tag, "Name of the factor type.")
      .def_readonly("ids", &Measured::ids, "The variables, by id.")
      .def_property_readonly(
          "values", [](const Measured& measured) { return array_of(measured.numbers); },
          "The numbers measured.")
      .def("__repr__", &text_of);
}

/// What is measured of a pose without the rest of it.
void bind_parts_of_poses(py::module_& module) {
  py::class_<MeasuredPosition, Measured> position_class(
      module, "Position",
      R"(Where a pose is in the world, without its orientation, as from GNSS: a `Point2` for a `Pose2`, a `Point3` for a `Pose3`.

The error [m] is along the axes of the world. An altimeter is `Position(id, Point3(0, 0, z))` with sigmas=(inf, inf, s).)");
  position_class.attr("tags") = tags<Position<Point2>, Position<Point3>>();
  position_class.def(py::init(&position<Point2>), py::arg("id"), py::arg("measured"))
      .def(py::init(&position<Point3>), py::arg("id"), py::arg("measured"))
      .def(py::init([](const py::object& id, const py::object& measured) -> MeasuredPosition {
             refuse("Position", py::make_tuple(id), measured, "Point2(1, 0) or a Point3");
           }),
           py::arg("id"), py::arg("measured"));
  py::class_<MeasuredOrientation, Measured> orientation_class(
      module, "Orientation",
      R"(How a `Pose3` is turned in the world, without its position, as from an attitude filter.

The error is the rotation vector [rad] of measured.inverse() * orientation.)");
  orientation_class.attr("tags") = tags<Orientation>();
  orientation_class
      .def(py::init([](Id id, const Rot3& measured) {
             return measured_as<MeasuredOrientation>(Orientation(id, measured));
           }),
           py::arg("id"), py::arg("measured"))
      .def(py::init([](const py::object& id, const py::object& measured) -> MeasuredOrientation {
             refuse("Orientation", py::make_tuple(id), measured, "Rot3()");
           }),
           py::arg("id"), py::arg("measured"));
  py::class_<MeasuredDirection, Measured> direction_class(
      module, "Direction",
      R"(A direction that is known in the world, such as that of gravity, seen in the frame of a `Pose3`; lengths do not matter.

The error has three numbers, the difference of the unit vectors in the frame of the pose: for small angles the angle
between them [rad]. Roll and pitch without yaw are `Direction(id, Point3(0, 0, -1), seen)`.)");
  direction_class.attr("tags") = tags<Direction>();
  direction_class
      .def(py::init([](Id id, const Point3& in_world, const Point3& seen) {
             return measured_as<MeasuredDirection>(Direction(id, in_world, seen));
           }),
           py::arg("id"), py::arg("in_world"), py::arg("seen"))
      .def(py::init([](const py::object& id, const py::object&,
                       const py::object& seen) -> MeasuredDirection {
             refuse("Direction", py::make_tuple(id), seen, "Point3(0, 0, -1), both times");
           }),
           py::arg("id"), py::arg("in_world"), py::arg("seen"));
}

void bind_kinds(py::module_& module) {
  py::class_<MeasuredBetween, Measured> between_class(
      module, "Between",
      R"(Odometry or a loop closure: pose `to_id` as seen from pose `from_id`.

measured = pose(from_id).inverse() * pose(to_id). The error has three numbers (x y [m], theta [rad]) for a `Pose2`, six
(translation [m], rotation [rad]) for a `Pose3`.)");
  between_class.attr("tags") = tags<Between<Pose2>, Between<Pose3>>();
  between_class
      .def(py::init(&between<Pose2>), py::arg("from_id"), py::arg("to_id"), py::arg("measured"))
      .def(py::init(&between<Pose3>), py::arg("from_id"), py::arg("to_id"), py::arg("measured"))
      .def(py::init([](const py::object& from, const py::object& to,
                       const py::object& measured) -> MeasuredBetween {
             refuse("Between", py::make_tuple(from, to), measured, "Pose2(1, 0, 0) or a Pose3");
           }),
           py::arg("from_id"), py::arg("to_id"), py::arg("measured"));
  py::class_<MeasuredPrior, Measured> prior_class(module, "Prior",
                                                  R"(Where a pose or a landmark is in the world.

The error of a pose is along the axes of the pose that was measured. What is not known has an infinite sigma, and then
changes nothing of the rest; `Position`, `Orientation` and `Direction` are what is measured alone.)");
  prior_class.attr("tags") = tags<Prior<Pose2>, Prior<Pose3>, Prior<Point2>, Prior<Point3>>();
  prior_class.def(py::init(&prior<Pose2>), py::arg("id"), py::arg("measured"))
      .def(py::init(&prior<Pose3>), py::arg("id"), py::arg("measured"))
      .def(py::init(&prior<Point2>), py::arg("id"), py::arg("measured"))
      .def(py::init(&prior<Point3>), py::arg("id"), py::arg("measured"))
      .def(py::init([](const py::object& id, const py::object& measured) -> MeasuredPrior {
             refuse("Prior", py::make_tuple(id), measured,
                    "Pose2(1, 0, 0), Pose3, Point2 or Point3");
           }),
           py::arg("id"), py::arg("measured"));
  bind_parts_of_poses(module);
  py::class_<MeasuredObservation, Measured> observation_class(
      module, "Observation",
      "A landmark seen from a pose: its position [m] in the frame of the pose.");
  observation_class.attr("tags") = tags<Observation<Point2>, Observation<Point3>>();
  observation_class
      .def(py::init(&observation<Point2>), py::arg("pose"), py::arg("landmark"),
           py::arg("measured"))
      .def(py::init(&observation<Point3>), py::arg("pose"), py::arg("landmark"),
           py::arg("measured"))
      .def(py::init([](const py::object& pose, const py::object& landmark,
                       const py::object& measured) -> MeasuredObservation {
             refuse("Observation", py::make_tuple(pose, landmark), measured,
                    "Point2(1, 0) or a Point3");
           }),
           py::arg("pose"), py::arg("landmark"), py::arg("measured"));
  py::class_<MeasuredBearingRange, Measured> bearing_range_class(
      module, "BearingRange",
      "A landmark of the plane seen from a pose: direction [rad], anticlockwise from straight "
      "ahead, and distance [m].");
  bearing_range_class.attr("tags") = tags<BearingRange>();
  bearing_range_class.def(
      py::init([](Id pose, Id landmark, double bearing, double range) {
        return measured_as<MeasuredBearingRange>(BearingRange(pose, landmark, bearing, range));
      }),
      py::arg("pose"), py::arg("landmark"), py::arg("bearing"), py::arg("range"));
}

void bind_symbols(py::module_& module) {
  module.def(
      "symbol",
      [](const std::string& letter, std::int64_t index) {
        if (letter.size() != 1)
          throw Error(ErrorCode::usage,
                      "a symbol is one letter and an index, not '" + letter + "'");
        return symbol(letter[0], index);
      },
      py::arg("letter"), py::arg("index"),
      "The id of variable `index` of the kind that a letter stands for: symbol('x', 3).");
  module.def("X", &symbols::X, py::arg("index"), "The id of pose `index`: symbol('x', index).");
  module.def("L", &symbols::L, py::arg("index"), "The id of landmark `index`: symbol('l', index).");
  module.def("id_text", &id_text, py::arg("id"),
             "'x3' for an id of `symbol`, the number of any other.");
}

}  // namespace

void bind_measurements(py::module_& module) {
  bind_measurement(module);
  bind_kinds(module);
  bind_symbols(module);
}

}  // namespace cairn::python
