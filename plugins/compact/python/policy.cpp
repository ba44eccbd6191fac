// SPDX-License-Identifier: BSD-3-Clause
// cairn.PosePolicy: decides live which poses and which loop closures are kept.
#include <algorithm>
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
#include "cairn/policy/pose_policy.hpp"
#include "cairn/runtime/enum_names.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/typed/symbol.hpp"
#include "component_names.hpp"
#include "estimates.hpp"
#include "factors.hpp"
#include "policy_reports.hpp"
#include "python_registration.hpp"
#include "types_of.hpp"

namespace cairn::python {
namespace {

const char* const kDoc =
    R"(Decides while a robot drives which poses are kept, and which pairs are worth matching (docs/compact.md).

    policy = cairn.PosePolicy("compact_pose", range=3, angle=1)
    policy.add_pose(0, value=cairn.Pose2(), fixed=True)
    policy.end_pose()
    for k in range(1, n):
        policy.add_pose(k, cairn.Factor(cairn.Between(k - 1, k, odometry[k]), sigmas=[0.05, 0.05, 0.02]))
        for pair in iter(policy.next_match, None):
            policy.offer(pair.earlier, match_scans(pair))  # a Factor, several, or None
        report = policy.end_pose()
    policy.finish()

Estimates and covariances are those of the poses that are kept, as of an Estimator. `cairn.compact` runs a policy over a
recorded graph.

name: one of `cairn.components("pose_policy")`; its options are further keyword arguments.
loss, loss_on: as of `Graph.set_loss`, for what comes.
trajectory: whether poses that were left out can be asked for; takes memory for each.)";

/// A policy as Python holds it.
class BoundPolicy final : public HasEstimator {
 public:
  explicit BoundPolicy(std::unique_ptr<PosePolicy> policy)
      : HasEstimator("the policy is in use by a call in another thread that has not returned"),
        policy_(std::move(policy)) {}

  /// For a call that keeps the interpreter's lock.
  PosePolicy& policy() {
    exclusive().refuse_if_used();
    return *policy_;
  }
  /// Does `work(policy)` without the interpreter's lock.
  template <class Work>
  auto unlocked(const Work& work) {
    const EstimatorUse use(*this);
    const py::gil_scoped_release released;
    return work(*policy_);
  }

  std::shared_ptr<const VariableType> pose_type;  ///< of the poses so far; null: there is none
  bool open = false;                              ///< a pose has begun and not ended

 private:
  Estimator& held() override { return policy_->estimator(); }
  std::unique_ptr<PosePolicy> policy_;
};

std::unique_ptr<BoundPolicy> make(const std::string& name, const py::object& loss,
                                  const std::string& loss_on, bool trajectory,
                                  const py::kwargs& options) {
  auto policy = default_registry().make<PosePolicy>(
      component_spec(name, options, PosePolicy::kKind, "PosePolicy"));
  if (!loss.is_none()) policy->estimator().set_loss(loss_of(loss), selector_of(loss_on));
  policy->keep_chains(trajectory);
  return std::make_unique<BoundPolicy>(std::move(policy));
}

void check_open(const BoundPolicy& bound, bool open) {
  if (bound.open == open) return;
  throw Error(ErrorCode::usage, open ? "no pose is open: add_pose comes first"
                                     : "the pose before is still open: end_pose comes first");
}

void load(BoundPolicy& bound, BoundGraph& map) {
  check_open(bound, false);
  const GraphUse graph(map);
  bound.unlocked([&](PosePolicy& policy) { policy.load(graph.graph()); });
}

std::shared_ptr<const VariableType> type_of(const BoundPolicy& bound, const py::object& value,
                                            const py::object& type) {
  if (!type.is_none() || !value.is_none())
    return default_registry().variable_type(tag_of(type.is_none() ? value : type));
  if (bound.pose_type) return bound.pose_type;
  throw Error(ErrorCode::usage,
              "where does the trajectory begin? Give the first pose its value, such as "
              "value=cairn.Pose2()");
}

void add_pose(BoundPolicy& bound, Id id, const py::object& odometry, const py::object& value,
              bool fixed, const py::object& type) {
  check_open(bound, false);
  Variable pose{type_of(bound, value, type), id, {}, fixed};
  if (!value.is_none()) {
    const Doubles state = doubles_of(value, "value");
    pose.state.assign(span_of(state).begin(), span_of(state).end());
  }
  const std::vector<Factor> factors = factors_of(odometry, "odometry");
  bound.unlocked([&](PosePolicy& policy) { policy.add_pose(pose, factors); });
  bound.pose_type = pose.type;
  bound.open = true;
}

std::optional<BoundProposal> next_match(BoundPolicy& bound) {
  check_open(bound, true);
  const auto proposal = bound.unlocked([](PosePolicy& policy) { return policy.next_match(); });
  if (!proposal) return std::nullopt;
  return proposal_of(*proposal, *bound.pose_type);
}

LinkReport offer(BoundPolicy& bound, Id other, const py::object& measured) {
  check_open(bound, true);
  const std::vector<Factor> factors = factors_of(measured, "measured");
  return bound.unlocked([&](PosePolicy& policy) { return policy.offer(other, factors); });
}

PriorReport offer_prior(BoundPolicy& bound, const Factor& measured) {
  check_open(bound, true);
  return bound.unlocked([&](PosePolicy& policy) { return policy.offer_prior(measured); });
}

/// The type of the landmark of a factor on a pose and a landmark.
std::shared_ptr<const VariableType> landmark_type(const std::vector<Factor>& factors, Id id) {
  for (const Factor& factor : factors) {
    const auto at = std::ranges::find(factor.variables, id);
    if (at == factor.variables.end()) continue;
    const auto index = static_cast<std::size_t>(at - factor.variables.begin());
    return default_registry().variable_type(factor.type->variable_tags()[index]);
  }
  throw Error(ErrorCode::usage, "none of the measurements is of landmark " + id_text(id));
}

void offer_landmark(BoundPolicy& bound, Id id, const py::object& measured) {
  check_open(bound, true);
  LandmarkObservation observation{{}, factors_of(measured, "measured")};
  observation.landmark = {landmark_type(observation.factors, id), id, {}, false};
  bound.unlocked([&](PosePolicy& policy) { policy.offer_landmark(observation); });
}

PoseReport end_pose(BoundPolicy& bound) {
  check_open(bound, true);
  PoseReport report = bound.unlocked([](PosePolicy& policy) { return policy.end_pose(); });
  bound.open = false;
  return report;
}

bool finish(BoundPolicy& bound) {
  check_open(bound, false);
  return bound.unlocked([](PosePolicy& policy) { return policy.finish(); });
}

py::object newest(BoundPolicy& bound) {
  if (!bound.pose_type) return py::none();
  return value_of(*bound.pose_type, bound.policy().newest_state());
}

std::unique_ptr<BoundGraph> trajectory(BoundPolicy& bound, const std::string& recovery) {
  const auto how = parse_enum<Recovery>(recovery, "recovery");
  return bound.unlocked([&](PosePolicy& policy) {
    return std::make_unique<BoundGraph>(recovered_trajectory(policy, how));
  });
}

using PolicyClass = py::class_<BoundPolicy, HasEstimator>;

void bind_poses(PolicyClass& policy) {
  policy
      .def(
          "load", &load, py::arg("map"),
          R"(Before the first pose: a map, of an earlier session or of another robot, that this trajectory continues.

Its poses are kept ones. Where the robot is on it is unknown until a match with one of them is offered: see `unlocated`.)")
      .def_property_readonly(
          "unlocated", [](BoundPolicy& bound) { return array_of_ids(bound.policy().unlocated()); },
          "The poses of the map while it is unknown where the robot is on it, (n,) integers: a "
          "match of the newest pose with any of them is wanted. Empty: that is known.")
      .def("add_pose", &add_pose, py::arg("id"), py::arg("odometry") = py::none(), py::kw_only(),
           py::arg("value") = py::none(), py::arg("fixed") = false, py::arg("type") = py::none(),
           R"(The next pose.

odometry: a Factor from the pose before, or several, which are fused; None for the first pose.
value: of the first pose a Pose2 or Pose3, or the numbers of a state of the variable type `type`. Without it the pose is
    where its odometry leads to.
fixed: it is kept, and held at its value.)")
      .def(
          "next_match", &next_match,
          R"(The pair that is most worth matching with the newest pose, a MatchProposal; None: no pair is.

Ask again after `offer`: `for pair in iter(policy.next_match, None)`.)")
      .def(
          "offer", &offer, py::arg("other"), py::arg("measured"),
          R"(What was measured between the newest pose and a pose that is kept, proposed or not; returns a LinkReport.

measured: a Factor, several of them, or None where the two do not match.)")
      .def("offer_prior", &offer_prior, py::arg("measured"),
           "An absolute measurement of the newest pose, after its links; returns a PriorReport.")
      .def("offer_landmark", &offer_landmark, py::arg("landmark"), py::arg("measured"),
           R"(What the newest pose measures of a landmark: a Factor on the two, or several.

They are judged when the pose ends: see `PoseReport.landmarks`.)")
      .def(
          "revoke",
          [](BoundPolicy& bound, Id a, Id b) {
            return bound.unlocked([&](PosePolicy& p) { return p.revoke(a, b); });
          },
          py::arg("a"), py::arg("b"),
          "Takes the link of two poses back, which was false: the graph is as if there had never "
          "been one. False: there is no such link.")
      .def("end_pose", &end_pose, "Decides whether the newest pose is kept; returns a PoseReport.")
      .def("finish", &finish,
           "Ends the trajectory: keeps the newest pose and solves everything. False: it has not "
           "converged.");
}

void bind_contents(PolicyClass& policy) {
  policy
      .def_property_readonly(
          "kept", [](BoundPolicy& bound) { return array_of_ids(bound.policy().kept()); },
          "Ids of the poses that are kept, in the order of arrival: (n,) integers.")
      .def_property_readonly(
          "removed", [](BoundPolicy& bound) { return array_of_ids(bound.policy().removed()); },
          "Those that left with the latest `end_pose` or `finish`, where their number is bounded.")
      .def_property_readonly(
          "landmarks", [](BoundPolicy& bound) { return array_of_ids(bound.policy().landmarks()); },
          "Ids of the landmarks that are in the graph: (n,) integers.")
      .def_property_readonly(
          "undetermined",
          [](BoundPolicy& bound) { return array_of_ids(bound.policy().undetermined()); },
          "Ids of landmarks that are not, since what was measured of them does not determine where "
          "they are: (n,) integers.")
      .def_property_readonly(
          "factor_count", [](BoundPolicy& bound) { return bound.policy().factor_count(); },
          "Factors between all of these.")
      .def_property_readonly("newest", &newest,
                             "The newest pose as it is estimated, kept or not: a Pose2 or Pose3.")
      .def(
          "trajectory", &trajectory, py::arg("recovery") = "v2",
          R"(All poses, those left out put back between those that are kept: a Graph without factors.

recovery: "v0" evenly, "v1" by distance, "v2" along odometry, or "likely".)")
      .def("__repr__", [](BoundPolicy& bound) {
        return fmt::format("<cairn.PosePolicy: {} poses kept, {} factors>",
                           bound.policy().kept().size(), bound.policy().factor_count());
      });
}

}  // namespace

void bind_policy(py::module_& module) {
  bind_policy_reports(module);
  PolicyClass policy(module, "PosePolicy", kDoc);
  policy.def(py::init(&make), py::arg("name") = "compact_pose", py::kw_only(),
             py::arg("loss") = py::none(), py::arg("loss_on") = "all",
             py::arg("trajectory") = true);
  bind_poses(policy);
  bind_contents(policy);
}

}  // namespace cairn::python
