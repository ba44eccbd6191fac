// SPDX-License-Identifier: BSD-3-Clause
// cairn.Situation, cairn.Decision: what an explorer written in Python is given, and returns.
#include "situation.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <fmt/core.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "component_names.hpp"

namespace cairn::python {
namespace {

using Eigen::Vector2d;

const char* const kDoc =
    R"(What an explorer decides upon: the map, where the robot is, and how certain that is.

Arrays of the map are (rows, columns), copies that may be kept; row 0 is the lowest, x counts columns to the right and y rows
upwards. Estimates and covariances are those of the poses that are kept, as of an Estimator. It can be asked until the call
that it was given to has returned.)";

// Arrays ------------------------------------------------------------------------------------------

template <class Number, class Cell, class Get>
py::array_t<Number> grid_of(const FloorMap& map, const std::vector<Cell>& cells, const Get& get) {
  py::array_t<Number> array({map.frame.height, map.frame.width});
  std::ranges::transform(cells, array.mutable_data(), get);
  return array;
}

py::array_t<bool> cells_that_are(const BoundSituation& situation, CellState state) {
  const FloorMap& map = situation.now().map;
  return grid_of<bool>(map, map.cells, [state](CellState cell) { return cell == state; });
}

py::array_t<float> numbers_of(const BoundSituation& situation,
                              std::vector<float> FloorMap::*numbers) {
  const FloorMap& map = situation.now().map;
  return grid_of<float>(map, map.*numbers, [](float number) { return number; });
}

py::array_t<double> array_of(const Vector2d& point) {
  return python::array_of(std::span<const double>(point.data(), 2));
}

py::array_t<double> array_of(const std::vector<Vector2d>& points) {
  std::vector<double> numbers;
  for (const Vector2d& point : points) numbers.insert(numbers.end(), {point.x(), point.y()});
  return python::array_of(numbers, {points.size(), 2});
}

/// (2,), or (n, 2): rows of two numbers.
Doubles rows_of_two(const py::object& given, const char* what) {
  Doubles numbers = doubles_of(given, what);
  const py::ssize_t last = numbers.ndim() > 0 ? numbers.shape(numbers.ndim() - 1) : 0;
  if (last != 2 || numbers.ndim() > 2) {
    throw Error(ErrorCode::usage, fmt::format("{}: the shape is {}, expected (2,) or (n, 2)", what,
                                              shape_text(numbers)));
  }
  return numbers;
}

Vector2d point_of(const py::object& given, const char* what) {
  const Doubles numbers = rows_of_two(given, what);
  const Vector2d point(numbers.data()[0], numbers.size() > 1 ? numbers.data()[1] : 0.0);
  if (numbers.ndim() != 1 || !point.allFinite()) {
    throw Error(ErrorCode::usage, fmt::format("{}: expected two finite numbers, x y [m]", what));
  }
  return point;
}

/// A function of each row, in the shape that was given.
template <class Work>
py::array_t<double> by_row(const Doubles& rows, const Work& work) {
  py::array_t<double> out(std::vector<py::ssize_t>(rows.shape(), rows.shape() + rows.ndim()));
  for (py::ssize_t k = 0; k < rows.size(); k += 2) {
    const Vector2d result = work(Vector2d(rows.data()[k], rows.data()[k + 1]));
    std::copy_n(result.data(), 2, out.mutable_data() + k);
  }
  return out;
}

/// The middles of cells [m]; rows and columns as numpy.argwhere gives them.
py::array_t<double> centres(const BoundSituation& situation, const py::object& cells) {
  const GridFrame& frame = situation.now().map.frame;
  return by_row(rows_of_two(cells, "cells"), [&](const Vector2d& cell) {
    return frame.to_world({cell.y() + 0.5, cell.x() + 0.5});
  });
}

py::array_t<std::int64_t> cells_at(const BoundSituation& situation, const py::object& points) {
  const GridFrame& frame = situation.now().map.frame;
  const py::array_t<double> cells =
      by_row(rows_of_two(points, "points"), [&](const Vector2d& point) -> Vector2d {
        const Vector2d cell = frame.to_cells(point).array().floor();
        return {cell.y(), cell.x()};
      });
  return py::array_t<std::int64_t>::ensure(cells.attr("astype")("int64"));
}

py::array_t<std::int64_t> cells_of(const Frontier& frontier, const GridFrame& frame) {
  py::array_t<std::int64_t> cells({py::ssize_t(frontier.cells.size()), py::ssize_t(2)});
  std::int64_t* out = cells.mutable_data();
  for (const std::int32_t cell : frontier.cells) {
    *out++ = cell / frame.width;
    *out++ = cell % frame.width;
  }
  return cells;
}

/// A frontier, as Python reads it.
struct BoundFrontier {
  double length;
  py::array_t<double> middle;
  py::array_t<std::int64_t> cells;
};

std::vector<BoundFrontier> frontiers_of(const BoundSituation& situation) {
  const FloorMap& map = situation.now().map;
  std::vector<BoundFrontier> all;
  for (const Frontier& frontier : map.frontiers)
    all.push_back({frontier.length, array_of(frontier.middle), cells_of(frontier, map.frame)});
  return all;
}

// Decisions ---------------------------------------------------------------------------------------

PlannedPath path_of(const py::object& to, BoundSituation& situation) {
  if (py::isinstance<PlannedPath>(to)) return to.cast<PlannedPath>();
  if (to.is_none()) {
    throw Error(
        ErrorCode::usage,
        "Decision.drive: None is no path; Situation.path_to returns it where there is none");
  }
  const Doubles numbers = rows_of_two(to, "Decision.drive");
  if (numbers.ndim() == 1) {
    const Vector2d goal = point_of(to, "Decision.drive");
    std::optional<PlannedPath> path = situation.path_to(goal, 2.0, {}, "grid_dijkstra");
    if (path) return *path;
    throw Error(ErrorCode::usage,
                fmt::format("Decision.drive: there is no path to ({:g}, {:g}), nor to anywhere "
                            "within 2 m; Situation.path_to returns None for such goals",
                            goal.x(), goal.y()));
  }
  if (numbers.shape(0) == 0) {
    throw Error(ErrorCode::usage,
                "Decision.drive: the path has no points; where nothing is left to drive to return "
                "Decision.finished or Decision.stuck");
  }
  PlannedPath path;
  Vector2d from = situation.now().pose.translation();
  for (py::ssize_t k = 0; k < numbers.size(); k += 2) {
    const Vector2d point(numbers.data()[k], numbers.data()[k + 1]);
    if (!point.allFinite())
      throw Error(ErrorCode::usage, "Decision.drive: the path has a number that is not finite");
    path.length += (point - from).norm();
    path.points.push_back(from = point);
  }
  return path;
}

void bind_decision(py::module_& module) {
  using Kind = Decision::Kind;
  py::class_<BoundDecision>(module, "Decision",
                            "What an explorer returns: where to drive, or why "
                            "no more.")
      .def_static(
          "drive",
          [](py::object to, std::string why, py::object look_at) {
            return BoundDecision{Kind::drive, std::move(why), std::move(to), std::move(look_at)};
          },
          py::arg("to"), py::arg("why") = "", py::kw_only(), py::arg("look_at") = py::none(),
          R"(Drive there, unless an obstacle or a loop closure makes a new decision necessary.

to: what `Situation.path_to` has found, points (n, 2) x y [m] of a path from where the robot is, or a goal (2,), to which a path
    is planned.
look_at: (2,) x y [m] towards which it turns at the end.)")
      .def_static(
          "finished",
          [](std::string why) {
            return BoundDecision{Kind::finished, std::move(why), py::none(), py::none()};
          },
          py::arg("why") = "the explorer has finished", "Nothing is left to explore.")
      .def_static(
          "stuck",
          [](std::string why) {
            return BoundDecision{Kind::stuck, std::move(why), py::none(), py::none()};
          },
          py::arg("why") = "the explorer is stuck",
          "Something is left, and there is no path to it.")
      .def_readonly("why", &BoundDecision::why);
}

void bind_path(py::module_& module) {
  py::class_<PlannedPath>(module, "PlannedPath", "A path over known free floor.")
      .def_property_readonly(
          "points", [](const PlannedPath& path) { return array_of(path.points); },
          "(n, 2) x y [m]: where it turns, and its end.")
      .def_readonly("length", &PlannedPath::length, "[m]")
      .def_property_readonly(
          "look_at",
          [](const PlannedPath& path) -> py::object {
            if (!path.look_at) return py::none();
            return array_of(*path.look_at);
          },
          "(2,) x y [m] towards which the robot turns at its end, or None.")
      .def("__repr__", [](const PlannedPath& path) {
        return fmt::format("<cairn.PlannedPath of {:.2f} m>", path.length);
      });
  py::class_<BoundFrontier>(module, "Frontier",
                            "Free cells beside unknown ones that hang together.")
      .def_readonly("length", &BoundFrontier::length, "[m]")
      .def_readonly("middle", &BoundFrontier::middle,
                    "(2,) x y [m]: of the cell that is nearest to the centroid.")
      .def_readonly("cells", &BoundFrontier::cells, "(n, 2) integers: row, column.");
}

}  // namespace

const Situation& BoundSituation::now() const {
  if (now_) return *now_;
  throw Error(
      ErrorCode::usage,
      "a Situation can be asked until the call that it was given to has returned; copy what "
      "is needed later");
}

std::optional<PlannedPath> BoundSituation::path_to(const Vector2d& goal, double tolerance,
                                                   std::optional<double> radius,
                                                   const std::string& planner) {
  const Situation& situation = now();
  const double body = radius.value_or(situation.robot.radius);
  std::unique_ptr<PathPlanner>& plans = planners_[{planner, body}];
  if (!plans) {
    auto made = default_registry().make<PathPlanner>(parse_component(planner));
    made->start(situation.map, situation.pose.translation(), body);
    plans = std::move(made);
  }
  return plans->path_to(goal, tolerance);
}

Decision decision_of(const py::object& returned, BoundSituation& situation) {
  if (!py::isinstance<BoundDecision>(returned)) {
    throw Error(ErrorCode::usage,
                fmt::format("what the explorer returned is a {}; expected cairn.Decision.drive, "
                            "finished or stuck",
                            std::string(py::str(py::type::of(returned).attr("__name__")))));
  }
  const BoundDecision bound = returned.cast<BoundDecision>();
  Decision decision{
      .kind = bound.kind, .why = bound.why, .candidates = {}, .chosen = 0, .notes = {}};
  if (bound.kind != Decision::Kind::drive) return decision;
  PlannedPath path = path_of(bound.to, situation);
  if (!bound.look_at.is_none()) path.look_at = point_of(bound.look_at, "look_at");
  const double length = path.length;
  decision.candidates.push_back({std::move(path), length, bound.why});
  return decision;
}

void bind_situation(py::module_& module) {
  using Bound = BoundSituation;
  bind_path(module);
  bind_decision(module);
  py::class_<Bound, HasEstimator>(module, "Situation", kDoc)
      .def_property_readonly(
          "pose", [](const Bound& b) { return b.now().pose; },
          "Where the robot is, as estimated: a Pose2.")
      .def_property_readonly(
          "poses", [](const Bound& b) { return array_of_ids(b.now().poses); },
          "The ids of the poses that are kept, in the order of arrival: (n,) integers.")
      .def_property_readonly(
          "decision", [](const Bound& b) { return b.now().decision; },
          "How many decisions came before.")
      .def_property_readonly(
          "free", [](const Bound& b) { return cells_that_are(b, CellState::free); },
          "Whether cells are free: (rows, columns).")
      .def_property_readonly(
          "occupied", [](const Bound& b) { return cells_that_are(b, CellState::occupied); },
          "Whether cells are occupied: (rows, columns).")
      .def_property_readonly(
          "log_odds", [](const Bound& b) { return numbers_of(b, &FloorMap::log_odds); },
          "ln(p / (1 - p)), p the probability of being occupied; 0: unknown.")
      .def_property_readonly(
          "clearance", [](const Bound& b) { return numbers_of(b, &FloorMap::clearance); },
          "From the middle of a cell to that of the nearest one that is not free, or to what the "
          "robot "
          "has touched twice [m].")
      .def_property_readonly(
          "caution",
          [](const Bound& b) {
            return numbers_of(
                b, b.now().map.caution.empty() ? &FloorMap::clearance : &FloorMap::caution);
          },
          "The same, or less: to free cells as well that a wall may fill in part [m].")
      .def_property_readonly("frontiers", &frontiers_of, "A list of Frontier, longest first.")
      .def_property_readonly(
          "resolution", [](const Bound& b) { return b.now().map.frame.resolution; },
          "The side of a cell [m].")
      .def_property_readonly(
          "radius", [](const Bound& b) { return b.now().robot.radius; },
          "Of the robot's round body [m].")
      .def_property_readonly(
          "match_range", [](const Bound& b) { return b.now().match.range; },
          "Within which loop closures are expected [m].")
      .def_property_readonly(
          "match_angle", [](const Bound& b) { return b.now().match.angle; }, "[rad]")
      .def("centres", &centres, py::arg("cells"),
           "The middles of cells, x y [m], in the shape given: (2,) or (n, 2) row, column, as of "
           "numpy.argwhere.")
      .def("cells_at", &cells_at, py::arg("points"),
           "Row and column of the cells that hold points x y [m]: integers in the shape given, "
           "(2,) or (n, 2); they may lie outside the map.")
      .def(
          "path_to",
          [](Bound& b, const py::object& goal, double tolerance, std::optional<double> radius,
             const std::string& planner) {
            return b.path_to(point_of(goal, "goal"), tolerance, radius, planner);
          },
          py::arg("goal"), py::arg("tolerance") = 2.0, py::kw_only(),
          py::arg("radius") = py::none(), py::arg("planner") = "grid_dijkstra",
          R"(A PlannedPath over free cells as near to the goal, (2,) x y [m], as the body can come; None: there is no such place within `tolerance` [m].

radius: of the body [m]; None: the robot's.
planner: a name of `cairn.components("path_planner")`, with options: "rrt_star:seed=2".)");
}

}  // namespace cairn::python
