// SPDX-License-Identifier: BSD-3-Clause
#include "policy_reports.hpp"

#include <string>

#include <fmt/core.h>
#include <pybind11/stl.h>

#include "cairn/policy/pose_policy.hpp"
#include "cairn/typed/symbol.hpp"
#include "python_registration.hpp"
#include "result_attributes.hpp"

namespace cairn::python {
namespace {

void bind_pose_report(py::module_& module) {
  py::class_<PoseReport> type(module, "PoseReport",
                              "What became of a pose, and of its measurements.");
  type.def_readonly("links", &PoseReport::links,
                    "A LinkReport for each link, earlier ones that had been waiting among them.")
      .def_readonly("priors", &PoseReport::priors, "A PriorReport for each, likewise.")
      .def_readonly("landmarks", &PoseReport::landmarks, "A LandmarkReport for each.")
      .def_property_readonly(
          "seconds", [](const PoseReport& report) { return report.seconds.total; },
          "What it took, without matching [s].")
      .def("__repr__", [](const PoseReport& report) {
        return fmt::format("<cairn.PoseReport {}: {}, {} links>", id_text(report.id),
                           report.kept ? "kept" : "left out", report.links.size());
      });
  bind_fields<PoseReport>(type);
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
  py::class_<LinkReport> link(module, "LinkReport", "What became of a measured link of two poses.");
  link.def("__repr__", [](const LinkReport& r) {
    return fmt::format("<cairn.LinkReport {} {}: {}>", id_text(r.earlier), id_text(r.later),
                       to_string(r.verdict));
  });
  bind_fields<LinkReport>(link);
  py::class_<PriorReport> prior(module, "PriorReport",
                                "What became of an absolute measurement of a pose.");
  prior.def("__repr__", [](const PriorReport& r) {
    return fmt::format("<cairn.PriorReport {}: {}>", id_text(r.pose), to_string(r.verdict));
  });
  bind_fields<PriorReport>(prior);
  py::class_<LandmarkReport> landmark(module, "LandmarkReport",
                                      "What became of measurements of a landmark from a pose.");
  landmark.def("__repr__", [](const LandmarkReport& r) {
    return fmt::format("<cairn.LandmarkReport {} {}: {}>", id_text(r.pose), id_text(r.landmark),
                       to_string(r.verdict));
  });
  bind_fields<LandmarkReport>(landmark);
  bind_pose_report(module);
}

}  // namespace cairn::python
