// SPDX-License-Identifier: BSD-3-Clause
// cairn.explore: a robot that explores a floor.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "bound_graph.hpp"
#include "cairn/exploration/exploration_measures.hpp"
#include "cairn/exploration/explorer_comparison.hpp"
#include "cairn/exploration/recorded_world.hpp"
#include "cairn/exploration/world.hpp"
#include "cairn/grid/floor_survey.hpp"
#include "cairn/grid/grid.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "component_names.hpp"
#include "floors.hpp"
#include "follower.hpp"
#include "interrupt.hpp"
#include "python_explorer.hpp"
#include "result_attributes.hpp"

namespace cairn::python {
namespace {

/// A run, as Python reads it.
struct BoundExploration {
  ExplorationResult result;
  ExplorationMeasures measures;
  std::unique_ptr<BoundGraph> graph, trajectory, truth;
};

void set_positive(const char* name, const std::optional<double>& value, double& out) {
  if (!value) return;
  if (!(*value > 0.0))
    throw Error(ErrorCode::usage, fmt::format("{}: expected a number above zero", name));
  out = *value;
}

void set_positive(const char* name, const std::optional<int>& value, int& out) {
  if (!value) return;
  if (*value <= 0)
    throw Error(ErrorCode::usage, fmt::format("{}: expected a whole number above zero", name));
  out = *value;
}

struct Limits {
  std::optional<double> distance;
  std::optional<int> steps, decisions;
  std::optional<double> known, rate;
};

ExplorationLimits limits_of(const Limits& given) {
  ExplorationLimits limits;
  set_positive("max_distance", given.distance, limits.distance);
  set_positive("max_steps", given.steps, limits.steps);
  set_positive("max_decisions", given.decisions, limits.decisions);
  set_positive("max_known", given.known, limits.known);
  set_positive("min_rate", given.rate, limits.rate);
  return limits;
}

/// A recorded robot is mapped otherwise: its scans are matched in a row, and loop closures have a
/// robust loss.
void refuse_recorded(const ComponentSpec& world, Registry& registry) {
  if (!query<RecordedWorld>(*registry.make<World>(world))) return;
  throw Error(ErrorCode::usage,
              fmt::format("world: a robot of '{}' has driven already, which is mapped otherwise: "
                          "run `cairn explore --world {}:file=…`",
                          world.name, world.name));
}

/// What a robot can cover of a floor; empty where it cannot start, as the run will say, or where
/// the surveyor's plugin is missing.
std::vector<std::uint8_t> reachable_floor(const ExplorationSetup& setup) {
  constexpr const char* kSurveyor = "round_body";
  if (!setup.registry.has(FloorSurveyor::kKind, kSurveyor)) return {};
  FloorSurveyOptions options{.radius = setup.registry.make<World>(setup.world)->robot().radius};
  if (setup.start) options.start = setup.start->translation();
  try {
    return setup.registry.make<FloorSurveyor>(kSurveyor)->survey(setup.floor, options).covered;
  } catch (const Error&) {
    return {};
  }
}

/// None: it is a name.
std::unique_ptr<PythonExplorer> own_explorer(const py::object& explorer, const py::kwargs& options,
                                             Follower& follower) {
  if (py::isinstance<py::str>(explorer)) return nullptr;
  auto own = std::make_unique<PythonExplorer>(explorer, [&follower] { follower.end(); });
  if (options.empty()) return own;
  throw Error(
      ErrorCode::usage,
      fmt::format("explore has no argument '{}', and options are of explorers by name: give "
                  "those of your own where you make it",
                  std::string(py::str(options.begin()->first))));
}

std::unique_ptr<BoundExploration> explore(
    const py::object& given_floor, const py::object& explorer, std::uint64_t seed,
    const std::optional<Pose2>& start, std::optional<double> max_distance,
    std::optional<int> max_steps, std::optional<int> max_decisions, std::optional<double> max_known,
    std::optional<double> min_rate, const std::string& world, const std::string& policy,
    const std::string& registration, const std::string& mapper, std::optional<double> match_range,
    std::optional<double> match_angle, std::optional<double> decision_budget,
    bool match_consecutive, const py::object& callback, const py::kwargs& options) {
  const OccupancyGrid floor = floor_of(given_floor);
  const InterruptGuard guard;
  Follower follower(callback, guard.flag());
  follower.follow();
  ExplorationSetup setup{
      .registry = default_registry(),
      .world = parse_component(world),
      .policy = parse_component(policy),
      .registration = parse_component(registration),
      .mapper = parse_component(mapper),
      .floor = floor,
      .start = start,
      .limits = limits_of({max_distance, max_steps, max_decisions, max_known, min_rate}),
      .interrupt = &follower.stop(),
      .match_consecutive = match_consecutive};
  refuse_recorded(setup.world, setup.registry);
  const std::vector<std::uint8_t> reachable = reachable_floor(setup);
  setup.reachable = reachable;
  set_positive("match_range", match_range, setup.match.range);
  set_positive("match_angle", match_angle, setup.match.angle);
  set_positive("decision_budget", decision_budget, setup.decision_budget);
  const auto own = own_explorer(explorer, options, follower);
  const ComponentSpec spec =
      own ? ComponentSpec()
          : component_spec(py::str(explorer), options, Explorer::kKind, "explore");
  const ExplorationHooks hooks{
      .moved = [&](const ExplorationStep& step, const FloorMap&) { follower.after(step); }};
  auto out = std::make_unique<BoundExploration>();
  try {
    const py::gil_scoped_release unlocked;
    out->result =
        own ? run_exploration(setup, *own, seed, hooks) : run_exploration(setup, spec, seed, hooks);
  } catch (const Error&) {
    if (own) own->rethrow();
    throw;
  }
  guard.absorb();
  follower.rethrow();
  ExplorationResult& result = out->result;
  out->measures =
      measures_of(result, static_cast<double>(floor.frame.size()) * floor.frame.cell_area());
  out->graph = std::make_unique<BoundGraph>(std::move(result.graph));
  out->trajectory = std::make_unique<BoundGraph>(std::move(result.trajectory));
  out->truth = std::make_unique<BoundGraph>(std::move(result.truth_trajectory));
  return out;
}

// Arrays ------------------------------------------------------------------------------------------

template <class Number>
py::array column(const std::vector<ExplorationStep>& steps, std::size_t field) {
  const detail::ResultFieldList& fields = result_fields<ExplorationStep>().list();
  py::array_t<Number> numbers(static_cast<py::ssize_t>(steps.size()));
  for (std::size_t k = 0; k < steps.size(); ++k) {
    numbers.mutable_data()[k] = std::visit(
        [](const auto& value) -> Number {
          if constexpr (std::is_arithmetic_v<std::remove_cvref_t<decltype(value)>>)
            return static_cast<Number>(value);
          return Number();
        },
        fields.value(field, &steps[k]).data);
  }
  return numbers;
}

template <class Get>
py::array_t<double> poses(const std::vector<ExplorationStep>& steps, const Get& get) {
  std::vector<double> numbers;
  for (const ExplorationStep& step : steps) {
    const Pose2 pose = get(step);
    numbers.insert(numbers.end(), {pose.x(), pose.y(), pose.theta()});
  }
  return array_of(numbers, {steps.size(), 3});
}

/// A column for each field of a step; of poses one for all three.
py::dict steps_of(const BoundExploration& bound) {
  using Step = ExplorationStep;
  const std::vector<Step>& steps = bound.result.steps;
  const double nan = std::nan("");
  py::dict all;
  const std::vector<ResultField>& fields = result_fields<Step>().all();
  for (std::size_t k = 0; k < fields.size(); ++k) {
    const py::str name(fields[k].name.substr(0, fields[k].name.find('.')));
    if (fields[k].name == "estimate.x") {
      all[name] = poses(steps, [](const Step& s) { return s.estimate; });
    } else if (fields[k].name == "truth.x") {
      all[name] =
          poses(steps, [&](const Step& s) { return s.truth.value_or(Pose2(nan, nan, nan)); });
    } else if (!all.contains(name)) {
      all[name] =
          fields[k].type == ResultType::integer ? column<int>(steps, k) : column<double>(steps, k);
    }
  }
  return all;
}

void bind_step(py::module_& module) {
  using Step = ExplorationStep;
  py::class_<Step> type(module, "ExplorationStep", "A run after one motion.");
  type.def_readonly("estimate", &Step::estimate, "Where the robot is, as estimated: a Pose2.")
      .def_readonly(
          "truth", &Step::truth,
          "Where it truly is, in the frame of the estimate, where both begin at one pose: a Pose2; "
          "None: that is not known.")
      .def("__repr__", [](const Step& step) {
        return fmt::format("<cairn.ExplorationStep {}: {:.1f} m driven, {:.1f} m^2 known>",
                           step.step, step.distance, step.coverage);
      });
  bind_fields<Step>(type);
}

void bind_result(py::module_& module) {
  using Bound = BoundExploration;
  const auto inside = py::return_value_policy::reference_internal;
  py::class_<Bound>(module, "ExplorationResult", "How a robot has explored a floor.")
      .def_property_readonly(
          "end", [](const Bound& b) { return std::string(to_string(b.result.end)); },
          "'finished', 'limit', 'stuck' or 'interrupted'.")
      .def_property_readonly(
          "why", [](const Bound& b) { return b.result.why; }, "A sentence.")
      .def_property_readonly(
          "start", [](const Bound& b) { return b.result.start; },
          "Where the frame of the estimate lies on the floor, by the first true pose: a Pose2; "
          "None: "
          "that is not known.")
      .def_property_readonly("steps", &steps_of,
                             "An array for each quantity of ExplorationStep, of all steps: (n,), "
                             "and (n, 3) x y [m] theta [rad] for 'estimate' and 'truth' (NaN: not "
                             "known). The first is of the start.")
      .def_property_readonly(
          "graph", [](const Bound& b) { return b.graph.get(); }, inside,
          "The poses that are kept, and their factors.")
      .def_property_readonly(
          "trajectory", [](const Bound& b) { return b.trajectory.get(); }, inside,
          "All poses, without factors.")
      .def_property_readonly(
          "truth", [](const Bound& b) { return b.truth.get(); }, inside,
          "Where they truly were, in the frame of the floor; without variables if that is not "
          "known.")
      .def_property_readonly(
          "map", [](const Bound& b) { return b.result.map.occupancy(); }, "The map: a Floor.")
      .def_property_readonly(
          "measures", [](const Bound& b) { return dict_of(result_record(b.measures)); },
          "The numbers by which runs are compared (docs/explore.md), by name: "
          "coverage [m^2], map_error [m^2], ate [m], seconds [s], …; NaN: not "
          "known.")
      .def_property_readonly(
          "decision_seconds", [](const Bound& b) { return array_of(b.result.decision_seconds); },
          "Of each decision [s]: (n,).")
      .def_property_readonly("converged", [](const Bound& b) { return b.result.converged; })
      .def_property_readonly(
          "notes", [](const Bound& b) { return b.result.notes; }, "Sentences for the user.")
      .def("__repr__", [](const Bound& b) {
        return fmt::format("<cairn.ExplorationResult {}: {:.1f} m driven, {:.1f} m^2 known>",
                           to_string(b.result.end), b.result.steps.back().distance,
                           b.result.map.coverage());
      });
}

}  // namespace

void bind_exploration(py::module_& module) {
  bind_step(module);
  bind_result(module);
  module.def(
      "explore", &explore, py::arg("floor"), py::arg("explorer") = ExplorationSetup::kExplorer,
      py::kw_only(), py::arg("seed") = 1, py::arg("start") = py::none(),
      py::arg("max_distance") = py::none(), py::arg("max_steps") = py::none(),
      py::arg("max_decisions") = py::none(), py::arg("max_known") = py::none(),
      py::arg("min_rate") = py::none(), py::arg("world") = ExplorationSetup::kWorld,
      py::arg("policy") = ExplorationSetup::kPolicy, py::arg("registration") = "icp",
      py::arg("mapper") = "log_odds", py::arg("match_range") = py::none(),
      py::arg("match_angle") = py::none(), py::arg("decision_budget") = py::none(),
      py::arg("match_consecutive") = true, py::arg("callback") = py::none(),
      R"(A simulated robot with a lidar explores a floor, and decides by itself where to drive (docs/explore.md).

floor: a Floor to drive on, the name of a file of one, as of `read_floor`, or "@rooms", a floor plan with its options.
explorer: a name of `cairn.components("explorer")`, whose options are further keyword arguments; or one of your own, a function
    decide(situation) that returns a Decision, or an object with such a method, and if it has them begin(seed), called before
    the first decision, and is_worthwhile(situation, path), called after each motion: False: it decides anew.
seed: of all noise and random choices: the same seed gives the same run.
start: the Pose2 at which it begins; None: the widest place, with a heading by the seed. The estimate begins at the identity
    all the same: a robot does not know where on the floor it is.
max_distance [m], max_steps, max_decisions, max_known (part of what the body can cover, 0 to 1), min_rate (what the last
    20 m brought per metre [m^2/m]): it ends there; None: when nothing is left to explore.
world, policy, registration, mapper: the robot, and what makes a graph and a map of its scans, with options:
    world="lidar_building:range=8,fov=180".
match_range [m], match_angle [rad]: within which the explorer expects loop closures.
decision_budget: within which explorers decide [s], as far as they can; then no run is like the other.
match_consecutive: whether each scan is matched with the one before, which corrects odometry.
callback: called with an ExplorationStep after each motion; when it returns False, the run ends.

What an explorer of your own raises is raised here. Ctrl-C ends the run too, with the map so far. The interpreter's lock is released meanwhile.)");
}

}  // namespace cairn::python
