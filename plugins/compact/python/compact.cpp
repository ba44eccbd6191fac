// SPDX-License-Identifier: BSD-3-Clause
// cairn.compact: a policy over a recorded graph.
#include <algorithm>
#include <atomic>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "bound_graph.hpp"
#include "cairn/evaluation/plausibility.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/policy/compaction.hpp"
#include "cairn/runtime/enum_names.hpp"
#include "cairn/runtime/error.hpp"
#include "component_names.hpp"
#include "follower.hpp"
#include "interrupt.hpp"
#include "python_registration.hpp"
#include "result_attributes.hpp"

namespace cairn::python {
namespace {

/// A run, as Python reads it.
struct BoundResult {
  Compaction made;       ///< its graphs are moved away
  ResultRecord figures;  ///< read before
  PolicyData data;
  std::unique_ptr<BoundGraph> compact, trajectory;
  std::vector<std::string> notes;
};

/// Without the interpreter's lock.
void run(const CompactionJob& job, const PolicySetting& setting, Follower& follower,
         BoundResult& out) {
  Compaction made = compact_recording(
      job, out.data, setting,
      {.note = [&](const std::string& sentence) { out.notes.push_back(sentence); },
       .selecting = [&] { follower.follow(); }});
  const PolicyResult& result = made.result;
  if (result.interrupted && result.poses.empty())
    out.notes.emplace_back("interrupted before anything was selected");
  for (const SelectionCheck::Advice& advice : made.advice) out.notes.push_back(to_string(advice));
  if (!made.whole && made.check && made.check->is_far()) {
    out.notes.push_back(fmt::format(
        "the map is {}: strategy='whole' keeps as few poses with the estimate of all measurements, "
        "a lower loop_gain uses more loop closures",
        made.check->to_string()));
  }
  if (!result.poses.empty()) {
    for (std::string& doubt : notes_on_estimate(result.compact, chi2(result.compact)).notes)
      out.notes.push_back(std::move(doubt));
  }
  out.figures = result_record(made);
  out.made = std::move(made);
}

const Graph& graph_of(const py::object& given, const char* what) {
  if (!py::isinstance<BoundGraph>(given))
    throw Error(ErrorCode::usage, fmt::format("{}: expected a cairn.Graph", what));
  return given.cast<BoundGraph&>().get();
}

std::unique_ptr<BoundResult> compact(BoundGraph& recording, const std::string& policy,
                                     const std::optional<std::string>& strategy,
                                     const py::object& registration, const py::object& truth,
                                     const py::object& map, std::optional<Id> begin,
                                     std::optional<bool> automatic, double sample, int keep,
                                     const std::string& recovery, const py::object& loss,
                                     const std::string& loss_on, const py::object& callback,
                                     const py::kwargs& options) {
  CompactionJob job{
      .job = {component_spec(policy, options, PosePolicy::kKind, "compact"), "recorded", nullptr},
      .strategy = strategy.value_or(""),
      .find = automatic,
      .sample = sample,
      .keep = keep,
      .recovery = parse_enum<Recovery>(recovery, "recovery")};
  if (!(sample > 0.0 && sample <= 1.0))
    throw Error(ErrorCode::usage, "sample: expected a part of the poses, above 0 and at most 1");
  if (keep < 0) throw Error(ErrorCode::usage, "keep: expected a number of poses, or 0 for any");
  std::optional<PythonRegistration> own;
  if (py::isinstance<py::str>(registration)) {
    job.job.registration = registration.cast<std::string>();
  } else {
    job.job.own = &own.emplace(registration);
  }
  std::optional<Graph> true_graph, earlier;
  if (!truth.is_none()) true_graph = graph_of(truth, "truth").clone();
  if (!map.is_none()) job.map = &earlier.emplace(graph_of(map, "map").clone());
  auto out = std::make_unique<BoundResult>();
  out->data = policy_data(recording.get().clone(), std::move(true_graph), begin,
                          earlier ? Gaps::refuse : Gaps::bridge);
  if (std::string bridged = to_string(out->data.gaps); !bridged.empty())
    out->notes.push_back(std::move(bridged));
  const InterruptGuard guard;
  Follower follower(callback, guard.flag());
  const PolicySetting setting{
      .data = out->data,
      .registry = default_registry(),
      .loss = loss_of(loss),
      .loss_on = loss.is_none() ? FactorSelector() : selector_of(loss_on),
      .interrupt = &follower.stop(),
      .progress = [&](std::string_view, std::size_t, const PolicyResult& counts) {
        follower.after(counts.poses.back());
      }};
  try {
    const py::gil_scoped_release unlocked;
    run(job, setting, follower, *out);
  } catch (const Error&) {
    if (own) own->rethrow();
    follower.rethrow();
    throw;
  }
  guard.absorb();
  follower.rethrow();
  if (own) own->rethrow();
  out->compact = std::make_unique<BoundGraph>(std::move(out->made.result.compact));
  out->trajectory = std::make_unique<BoundGraph>(std::move(out->made.result.trajectory));
  return out;
}

py::object nees_of(const BoundResult& bound) {
  const auto& normalized = bound.made.result.normalized;
  if (!normalized) return py::none();
  return py::make_tuple(normalized->squared, normalized->dof);
}

void bind_result(py::module_& module) {
  py::class_<BoundResult> type(module, "CompactResult",
                               "What a policy has kept of a recorded graph.");
  type.def_property_readonly(
          "strategy", [](const BoundResult& bound) { return bound.made.strategy; },
          "'whole', or that of the policy; empty: it has none.")
      .def_property_readonly(
          "graph", [](const BoundResult& bound) { return bound.compact.get(); },
          py::return_value_policy::reference_internal, "What was kept, at its estimate.")
      .def_property_readonly(
          "trajectory", [](const BoundResult& bound) { return bound.trajectory.get(); },
          py::return_value_policy::reference_internal,
          "All poses, those left out put back; without factors. With the strategy 'whole', the "
          "estimate of all measurements.")
      .def_property_readonly(
          "poses", [](const BoundResult& bound) { return bound.made.result.poses; },
          "A PoseReport for each pose, in the order of arrival.")
      .def_property_readonly(
          "errors", [](const BoundResult& bound) { return bound.made.result.errors; },
          "With the truth: a TrajectoryError of all poses, by the name of each recovery, or "
          "'whole'.")
      .def_property_readonly("nees", &nees_of,
                             "With the truth of all poses: (e^T Sigma^-1 e, degrees of freedom), "
                             "the mean of the first being the second where the covariance is "
                             "right; else None.")
      .def_readonly("notes", &BoundResult::notes, "Sentences for the user.")
      .def("__repr__", [](const BoundResult& bound) {
        const PolicyResult& result = bound.made.result;
        return fmt::format(
            "<cairn.CompactResult {}: {} of {} poses, {} loop closures, chi2 {:.6g}>",
            std::get<std::string>(bound.figures.values[bound.figures.find("status")].data),
            result.kept_poses - result.map_poses, result.poses.size(), result.kept_loops,
            result.chi2);
      });
  bind_fields<Compaction>(type, &BoundResult::figures);
}

}  // namespace

void bind_compact(py::module_& module) {
  bind_result(module);
  module.def(
      "compact", &compact, py::arg("graph"), py::arg("policy") = "compact_pose", py::kw_only(),
      py::arg("strategy") = py::none(), py::arg("registration") = "recorded",
      py::arg("truth") = py::none(), py::arg("map") = py::none(), py::arg("begin") = py::none(),
      py::arg("find_thresholds") = py::none(), py::arg("sample") = 0.6, py::arg("keep") = 0,
      py::arg("recovery") = "v2", py::arg("loss") = py::none(), py::arg("loss_on") = "all",
      py::arg("callback") = py::none(),
      R"(Runs a policy over a recorded graph: which poses and which loop closures are worth keeping (docs/compact.md).

graph: poses with odometry by rising id, whose gaps other measurements bridge, loop closures, absolute measurements, landmarks; it stays as it is.
policy: a name of `cairn.components("pose_policy")`; its options are further keyword arguments.
strategy: "whole", the poses that the policy keeps with the information of all measurements of the graph; or what a robot
    can know while it drives: "fpfl", few poses and few loop closures, "apfl", all poses, "apal", all of both. None:
    "whole", and "fpfl" where that cannot be: with map=, or another registration than "recorded".
registration: measures the pairs that the policy proposes: a name of `cairn.components("registration")`, of which
    "recorded" answers by the graph; or written in Python, a function match(proposal) that is given a MatchProposal and
    returns a Factor, several, or None for no match. An object with such a method may have three more:
    recognise(places, pose), which returns a pose of a map and the factors measured, pose_ended(pose, kept), and
    begin(), which is called before each run over the graph: one for each trial where thresholds are found, then the
    one that selects.
truth: a Graph of the true poses, for `CompactResult.errors`.
map: a Graph that an earlier session has left, which this trajectory continues.
begin: the id of the first pose; those before it are of earlier sessions.
find_thresholds: whether the policy finds its thresholds in a sample; None: unless some are given.
sample: the part of the poses that is the sample.
keep: the largest number of poses; 0: any.
recovery: how poses that were left out are put back: "v0", "v1", "v2" or "likely".
loss, loss_on: as of `Graph.set_loss`.
callback: called with the PoseReport of each; when it returns False, the run ends.

Ctrl-C ends the run too, with what was kept so far. An exception in the registration or the callback is raised here. The
interpreter's lock is released meanwhile, and taken for calls into Python.)");
}

}  // namespace cairn::python
