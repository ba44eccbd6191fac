// SPDX-License-Identifier: BSD-3-Clause
#include "policy_reports.hpp"

#include <string>

#include <fmt/core.h>
#include <pybind11/stl.h>

#include "cairn/policy/pose_policy.hpp"
#include "cairn/typed/symbol.hpp"
#include "python_registration.hpp"

namespace cairn::python {
namespace {

constexpr const char* kVerdict =
    "'linked' (it is in the graph), 'unmatched' (there is nothing to link), 'uninformative' (its "
    "information gain is below the threshold), 'inconsistent' (it contradicts the estimate, or "
    "other links), 'waiting' (until others confirm it) or 'nonlinear' (of a landmark: not linear "
    "over what is not known of where the two are).";

/// What the three kinds of measurements have in common.
template <class Report>
py::class_<Report> bind_report(py::module_& module, const char* name, const char* doc) {
  py::class_<Report> report(module, name, doc);
  report.def_readonly("gain", &Report::gain, "Information gain [nats].")
      .def_readonly("innovation", &Report::innovation,
                    "Squared Mahalanobis distance from what was expected.")
      .def_property_readonly(
          "verdict", [](const Report& r) { return std::string(to_string(r.verdict)); }, kVerdict);
  return report;
}

void bind_pose_report(py::module_& module) {
  py::class_<PoseReport>(module, "PoseReport", "What became of a pose, and of its measurements.")
      .def_readonly("id", &PoseReport::id)
      .def_readonly("kept", &PoseReport::kept, "Whether it is in the graph.")
      .def_readonly("closed_loop", &PoseReport::closed_loop)
      .def_readonly("near", &PoseReport::near, "Poses that the search for candidates found.")
      .def_readonly("candidates", &PoseReport::candidates, "Those near enough to be matched.")
      .def_readonly("least_gain", &PoseReport::least_gain,
                    "The least information gain of a link to a candidate [nats]; infinite: none.")
      .def_readonly("links", &PoseReport::links,
                    "A LinkReport for each link, earlier ones that had been waiting among them.")
      .def_readonly("priors", &PoseReport::priors, "A PriorReport for each, likewise.")
      .def_readonly("landmarks", &PoseReport::landmarks, "A LandmarkReport for each.")
      .def_readonly("removed", &PoseReport::removed, "How many poses left the graph with it.")
      .def_property_readonly(
          "seconds", [](const PoseReport& report) { return report.seconds.total; },
          "What it took, without matching [s].")
      .def_readonly("notes", &PoseReport::notes, "Sentences for the user.")
      .def("__repr__", [](const PoseReport& report) {
        return fmt::format("<cairn.PoseReport {}: {}, {} links>", id_text(report.id),
                           report.kept ? "kept" : "left out", report.links.size());
      });
}

}  // namespace

void bind_policy_reports(py::module_& module) {
  py::class_<BoundProposal>(module, "MatchProposal",
                            "Two poses whose sensor data are worth matching.")
      .def_readonly("earlier", &BoundProposal::earlier)
      .def_readonly("later", &BoundProposal::later)
      .def_readonly("gain", &BoundProposal::gain,
                    "Expected information gain of a link [nats]; 0 where a place is to be "
                    "recognised.")
      .def_readonly("expected", &BoundProposal::expected,
                    "Pose `later` as seen from pose `earlier`, by the estimate: a Pose2 or Pose3. "
                    "None: not known, where a place is to be recognised.")
      .def_readonly("covariance", &BoundProposal::covariance,
                    "Of that, (d, d), of delta with true = expected.retract(delta); or None.")
      .def("__repr__", [](const BoundProposal& p) {
        return fmt::format("<cairn.MatchProposal {} {}: {:.4g} nats>", id_text(p.earlier),
                           id_text(p.later), p.gain);
      });
  bind_report<LinkReport>(module, "LinkReport", "What became of a measured link of two poses.")
      .def_readonly("earlier", &LinkReport::earlier)
      .def_readonly("later", &LinkReport::later)
      .def_readonly("expected_gain", &LinkReport::expected_gain,
                    "Information gain before it was measured [nats].")
      .def("__repr__", [](const LinkReport& r) {
        return fmt::format("<cairn.LinkReport {} {}: {}>", id_text(r.earlier), id_text(r.later),
                           to_string(r.verdict));
      });
  bind_report<PriorReport>(module, "PriorReport",
                           "What became of an absolute measurement of a pose.")
      .def_readonly("pose", &PriorReport::pose)
      .def("__repr__", [](const PriorReport& r) {
        return fmt::format("<cairn.PriorReport {}: {}>", id_text(r.pose), to_string(r.verdict));
      });
  bind_report<LandmarkReport>(module, "LandmarkReport",
                              "What became of measurements of a landmark from a pose.")
      .def_readonly("pose", &LandmarkReport::pose)
      .def_readonly("landmark", &LandmarkReport::landmark)
      .def_readonly("factors", &LandmarkReport::factors, "How many they were.")
      .def_readonly("added", &LandmarkReport::added, "Whether the landmark came with them.")
      .def_readonly("removed", &LandmarkReport::removed,
                    "Whether they have left the graph with the landmark, which waits again.")
      .def("__repr__", [](const LandmarkReport& r) {
        return fmt::format("<cairn.LandmarkReport {} {}: {}>", id_text(r.pose), id_text(r.landmark),
                           to_string(r.verdict));
      });
  bind_pose_report(module);
}

}  // namespace cairn::python
