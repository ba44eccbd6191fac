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
#include "cairn/policy/map_check.hpp"
#include "cairn/policy/policy_run.hpp"
#include "cairn/policy/selection_check.hpp"
#include "cairn/policy/threshold_search.hpp"
#include "cairn/runtime/enum_names.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/sparsification/whole_map.hpp"
#include "cairn/text/spelling.hpp"
#include "component_names.hpp"
#include "follower.hpp"
#include "interrupt.hpp"
#include "python_registration.hpp"

namespace cairn::python {
namespace {

/// A run, as Python reads it.
struct BoundResult {
  PolicyResult result;
  FoundThresholds found;
  PolicyData data;  ///< counts of the recording; its graphs are moved away
  std::unique_ptr<BoundGraph> compact, trajectory;
  std::optional<MapCheck> check;
  std::optional<WholeMap> whole;
  std::vector<std::vector<Id>> left_out;
  std::string strategy;
  std::vector<std::string> notes;

  std::string status() const {
    if (result.interrupted) return "interrupted";
    if (!result.located) return "unlocated";
    return result.converged ? "converged" : "max_iterations";
  }
};

/// What is run, and how.
struct Plan {
  PolicyJob job;
  std::string strategy{};  ///< empty: `whole` where it can be
  std::optional<PythonRegistration> own{};
  std::optional<bool> automatic;  ///< whether thresholds are found; none: unless some are given
  double sample = 0.6;
  double error_ratio = 2.5;
  int keep = 0;
  Recovery recovery = Recovery::distribute;
  std::optional<Graph> map{};
  std::shared_ptr<const Loss> loss;
  FactorSelector loss_on{};
};

constexpr const char* kWhole = "whole";

/// The strategy of the plan, or of the policy's options; by default `whole` where that can be.
/// Empty: the policy has none.
std::string strategy_of(const Plan& plan, const PolicySetting& setting) {
  const ComponentSpec& policy = plan.job.policy;
  const auto own = policy.values.find("strategy");
  if (own != policy.values.end()) {
    if (!plan.strategy.empty() && plan.strategy != own->second) {
      throw Error(ErrorCode::usage, "strategy= is given, and among the policy's options: give one");
    }
    return own->second;
  }
  const OptionSpec* const has_some =
      setting.registry.options(PosePolicy::kKind, policy.name).find("strategy");
  if (!has_some && !plan.strategy.empty())
    throw Error(ErrorCode::usage, fmt::format("policy '{}' has no strategies", policy.name));
  if (!plan.strategy.empty()) {
    std::vector<std::string> names = has_some->choices;
    names.emplace_back(kWhole);
    if (std::ranges::find(names, plan.strategy) == names.end()) {
      throw Error(ErrorCode::usage, fmt::format("strategy cannot be '{}'{}", plan.strategy,
                                                what_is_on_offer(plan.strategy, names)));
    }
  }
  if (!has_some || (!plan.strategy.empty() && plan.strategy != kWhole)) return plan.strategy;
  const std::string why_not =
      plan.map ? "the trajectory continues a map (map=)" : why_no_whole_map(plan.job, setting);
  if (why_not.empty()) return kWhole;
  if (plan.strategy.empty()) return "fpfl";
  throw Error(ErrorCode::usage, fmt::format("strategy={}: {}", kWhole, why_not));
}

/// A job of this strategy with the thresholds that are found for it. False: interrupted.
bool complete(const Plan& plan, const PolicySetting& setting, PolicyJob& job, BoundResult& out) {
  Registry& registry = setting.registry;
  job = plan.job;
  OptionValues& options = job.policy.values;
  const bool automatic = plan.automatic.value_or(
      !gives_thresholds(job.policy) && finds_thresholds(job.policy, registry) &&
      (setting.data.loops > 0 || setting.data.observations == 0));
  if (automatic) {
    const ThresholdSample sample = threshold_sample(setting.data, plan.sample);
    // The error of a whole map does not depend on which loop closures the policy uses.
    const double ratio = out.strategy == kWhole ? 0.0 : plan.error_ratio;
    out.found = find_thresholds(job, sample.count, ratio, setting);
    if (setting.interrupted()) return false;
    for (const auto& [name, value] : out.found.options) options.emplace(name, value);
  }
  if (plan.keep > 0 && !options.emplace("keep", fmt::format("{}", plan.keep)).second)
    throw Error(ErrorCode::usage, "keep= is given, and among the policy's options: give one");
  if (!out.strategy.empty())
    options.emplace("strategy", out.strategy == kWhole ? "fpfl" : out.strategy);
  // The policy's own map is not kept, so that relocation costs nothing.
  if (out.strategy == kWhole && registry.options(PosePolicy::kKind, job.policy.name).find("reuse"))
    options.emplace("reuse", "true");
  return true;
}

/// Runs the policy. False: interrupted before that.
bool select(const Plan& plan, const PolicySetting& setting, Follower& follower, PolicyJob& job,
            BoundResult& out) {
  if (!complete(plan, setting, job, out)) {
    out.result.interrupted = true;
    out.notes.emplace_back("interrupted before anything was selected");
    return false;
  }
  follower.follow();
  PolicyRun policy(job, setting);
  if (plan.map) policy.load(*plan.map);
  policy.run(setting.data.poses.size(), job.policy.name);
  out.result = policy.finish(plan.recovery);
  return true;
}

/// The estimate of all measurements, without those that contradict the others, which leave the
/// recording. Nothing, and a note, where there is none: the strategy is `fpfl` then.
std::optional<EstimateOfAll> estimate_all(const PolicySetting& setting, BoundResult& out) {
  EstimateOfAll all = estimate_of_all(setting);
  if (!all.why_not.empty()) {
    out.strategy = "fpfl";
    if (!setting.interrupted())
      out.notes.push_back(fmt::format("the map is that of strategy fpfl: {}", all.why_not));
    return std::nullopt;
  }
  if (std::string words = left_out_in_words(all, out.data); !words.empty()) {
    out.notes.push_back(std::move(words));
    out.left_out = all.left_out_on;
    out.data = without_contradictions(std::move(out.data), all);
  }
  return all;
}

/// Their map in the place of the policy's own.
void make_whole(const PolicySetting& setting, const PolicyJob& job, const EstimateOfAll& all,
                BoundResult& out) {
  WholeMap whole = take_whole_map(job, setting, all, out.result);
  if (!whole.why_not.empty()) {
    out.strategy = "fpfl";
    out.notes.push_back(fmt::format("the map is that of strategy fpfl: {}", whole.why_not));
    return;
  }
  out.notes.insert(out.notes.end(), whole.notes.begin(), whole.notes.end());
  out.check = whole.check;
  out.whole = std::move(whole);
}

/// Without the interpreter's lock.
void run(const Plan& plan, const PolicySetting& setting, Follower& follower, BoundResult& out) {
  PolicyJob job;
  out.strategy = strategy_of(plan, setting);
  std::optional<EstimateOfAll> all;
  if (out.strategy == kWhole) all = estimate_all(setting, out);
  if (!select(plan, setting, follower, job, out)) return;
  if (all) make_whole(setting, job, *all, out);
  if (!out.whole) out.check = check_map(job, out.result, setting);
  if (out.whole) {
    if (out.whole->advice) out.notes.push_back(to_string(*out.whole->advice));
  } else if (out.check && out.check->is_far()) {
    out.notes.push_back(fmt::format(
        "the map is {}: strategy='whole' keeps as few poses with the estimate of all measurements, "
        "a lower loop_gain uses more loop closures",
        out.check->to_string()));
  }
  SelectionCheck check;
  for (const PoseReport& pose : out.result.poses) check.add(pose);
  const FoundThresholds* found = out.found.seconds > 0.0 ? &out.found : nullptr;
  if (!out.result.interrupted && out.result.located &&
      finds_thresholds(job.policy, setting.registry)) {
    const std::int64_t loops = out.whole ? 0 : setting.data.loops;
    for (const auto& advice : check.advice(found, loops)) out.notes.push_back(to_string(advice));
  }
  for (std::string& doubt : notes_on_estimate(out.result.compact, chi2(out.result.compact)).notes)
    out.notes.push_back(std::move(doubt));
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
  Plan plan{.job = {component_spec(policy, options, PosePolicy::kKind, "compact")},
            .strategy = strategy.value_or(""),
            .automatic = automatic,
            .sample = sample,
            .keep = keep,
            .recovery = parse_enum<Recovery>(recovery, "recovery"),
            .loss = loss_of(loss)};
  if (!(sample > 0.0 && sample <= 1.0))
    throw Error(ErrorCode::usage, "sample: expected a part of the poses, above 0 and at most 1");
  if (keep < 0) throw Error(ErrorCode::usage, "keep: expected a number of poses, or 0 for any");
  if (!loss.is_none()) plan.loss_on = selector_of(loss_on);
  if (py::isinstance<py::str>(registration)) {
    plan.job.registration = registration.cast<std::string>();
  } else {
    plan.job.own = &plan.own.emplace(registration);
  }
  std::optional<Graph> true_graph;
  if (!truth.is_none()) true_graph = graph_of(truth, "truth").clone();
  if (!map.is_none()) plan.map = graph_of(map, "map").clone();
  auto out = std::make_unique<BoundResult>();
  out->data = policy_data(recording.get().clone(), std::move(true_graph), begin,
                          plan.map ? Gaps::refuse : Gaps::bridge);
  if (std::string bridged = to_string(out->data.gaps); !bridged.empty())
    out->notes.push_back(std::move(bridged));
  const InterruptGuard guard;
  Follower follower(callback, guard.flag());
  const PolicySetting setting{
      .data = out->data,
      .registry = default_registry(),
      .loss = plan.loss,
      .loss_on = plan.loss_on,
      .interrupt = &follower.stop(),
      .progress = [&](std::string_view, std::size_t, const PolicyResult& counts) {
        follower.after(counts.poses.back());
      }};
  try {
    const py::gil_scoped_release unlocked;
    run(plan, setting, follower, *out);
  } catch (const Error&) {
    if (plan.own) plan.own->rethrow();
    follower.rethrow();
    throw;
  }
  guard.absorb();
  follower.rethrow();
  if (plan.own) plan.own->rethrow();
  out->compact = std::make_unique<BoundGraph>(std::move(out->result.compact));
  out->trajectory = std::make_unique<BoundGraph>(std::move(out->result.trajectory));
  return out;
}

py::dict counts_of(const BoundResult& bound) {
  const PolicyResult& result = bound.result;
  py::dict counts;
  counts["poses"] = result.poses.size();
  counts["kept"] = result.kept_poses - result.map_poses;
  counts["map"] = result.map_poses;
  counts["loops"] = bound.data.loops;
  counts["proposed"] = result.proposed;
  counts["registered"] = result.registered;
  counts["kept_loops"] = result.kept_loops;
  counts["false_registered"] = result.false_registered;
  counts["false_kept"] = result.false_kept;
  counts["priors"] = bound.data.priors;
  counts["kept_priors"] = result.kept_priors;
  counts["landmarks"] = bound.data.landmarks;
  counts["kept_landmarks"] = result.kept_landmarks;
  counts["undetermined_landmarks"] = result.undetermined_landmarks;
  counts["observations"] = bound.data.observations;
  counts["kept_observations"] = result.kept_observations;
  counts["nonlinear_observations"] = result.nonlinear_observations;
  counts["information_nonzeros"] = result.information_nonzeros;
  counts["factor_nonzeros"] = result.factor_nonzeros;
  return counts;
}

py::dict seconds_of(const BoundResult& bound) {
  py::dict seconds;
  seconds["total"] = bound.result.seconds.total;
  seconds["estimate"] = bound.result.seconds.estimate;
  seconds["covariances"] = bound.result.seconds.covariances;
  seconds["search"] = bound.result.seconds.search;
  seconds["registration"] = bound.result.registration_seconds;
  seconds["thresholds"] = bound.found.seconds;
  return seconds;
}

py::object nees_of(const BoundResult& bound) {
  const auto& normalized = bound.result.normalized;
  if (!normalized) return py::none();
  return py::make_tuple(normalized->squared, normalized->dof);
}

void bind_result(py::module_& module) {
  py::class_<BoundResult>(module, "CompactResult", "What a policy has kept of a recorded graph.")
      .def_property_readonly("status", &BoundResult::status,
                             "'converged', 'max_iterations', 'interrupted', or 'unlocated': no "
                             "match with the map that was to be continued.")
      .def_readonly("strategy", &BoundResult::strategy,
                    "'whole', or that of the policy; empty: it has none.")
      .def_readonly("left_out", &BoundResult::left_out,
                    "Measurements that contradict the others and are left out: the ids of the "
                    "variables of each.")
      .def_property_readonly(
          "kld",
          [](const BoundResult& bound) {
            return bound.whole ? std::optional(bound.whole->kld) : std::nullopt;
          },
          "With the strategy 'whole': divergence of the graph from the estimate of all "
          "measurements, of the poses that are kept [nats]; else None.")
      .def_property_readonly(
          "policy", [](const BoundResult& bound) { return bound.result.policy; },
          "The policy with all its options, those that were found among them.")
      .def_property_readonly(
          "graph", [](const BoundResult& bound) { return bound.compact.get(); },
          py::return_value_policy::reference_internal, "What was kept, at its estimate.")
      .def_property_readonly(
          "trajectory", [](const BoundResult& bound) { return bound.trajectory.get(); },
          py::return_value_policy::reference_internal,
          "All poses, those left out put back; without factors. With the strategy 'whole', the "
          "estimate of all measurements.")
      .def_property_readonly(
          "poses", [](const BoundResult& bound) { return bound.result.poses; },
          "A PoseReport for each pose, in the order of arrival.")
      .def_property_readonly("counts", &counts_of,
                             "How many poses, loops, priors, landmarks and observations there were "
                             "and how many of them were kept; pairs proposed and registered; "
                             "nonzeros of the information matrix and of its factor.")
      .def_property_readonly(
          "verdicts", [](const BoundResult& bound) { return bound.result.verdicts; },
          "How many links there were of each verdict.")
      .def_property_readonly(
          "chi2", [](const BoundResult& bound) { return bound.result.chi2; }, "Of what was kept.")
      .def_property_readonly(
          "errors", [](const BoundResult& bound) { return bound.result.errors; },
          "With the truth: a TrajectoryError of all poses, by the name of each recovery, or "
          "'whole'.")
      .def_property_readonly("nees", &nees_of,
                             "With the truth of all poses: (e^T Sigma^-1 e, degrees of freedom), "
                             "the mean of the first being the second where the covariance is "
                             "right; else None.")
      .def_property_readonly(
          "distance",
          [](const BoundResult& bound) {
            return bound.check ? std::optional(bound.check->distance) : std::nullopt;
          },
          "How far all poses (strategy 'whole': those of the graph) are from the map of all "
          "measurements, after alignment, root mean square [m]; None where that map is no measure "
          "of it: another map was continued, matches "
          "were inconsistent, or they were not those of the graph.")
      .def_property_readonly(
          "thresholds", [](const BoundResult& bound) { return bound.found.options; },
          "Options of the policy that were found, as texts.")
      .def_property_readonly("seconds", &seconds_of,
                             "Of each part: estimate, covariances, search, registration, "
                             "thresholds; total without the last two.")
      .def_readonly("notes", &BoundResult::notes, "Sentences for the user.")
      .def("__repr__", [](const BoundResult& bound) {
        return fmt::format(
            "<cairn.CompactResult {}: {} of {} poses, {} loop closures, chi2 {:.6g}>",
            bound.status(), bound.result.kept_poses - bound.result.map_poses,
            bound.result.poses.size(), bound.result.kept_loops, bound.result.chi2);
      });
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
