// SPDX-License-Identifier: BSD-3-Clause
// cairn.Estimator: follows a graph while it grows and changes.
#include "cairn/solve/estimator.hpp"

#include <array>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "bound_estimator.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/typed/symbol.hpp"
#include "cairn/update/rejected_factors.hpp"
#include "component_names.hpp"
#include "factors.hpp"
#include "ids.hpp"
#include "measured.hpp"
#include "result_attributes.hpp"
#include "types_of.hpp"

namespace cairn::python {
namespace {

const char* const kDoc =
    R"(Keeps the estimate of a graph, with covariances, up to date while the graph grows and changes.

    estimator = cairn.Estimator("incremental_cholesky")
    estimator.add(0, cairn.Pose2())
    estimator.add(1, cairn.Pose2)  # its first measurement says where
    estimator.add(cairn.Between(0, 1, cairn.Pose2(1, 0, 0)), sigmas=[0.1, 0.1, 0.05])
    report = estimator.update()

What is added, marginalised and removed is carried out by the next `update`, all or nothing. Factors are numbered in the
order of their addition, from 0; no number is used twice.

name: one of `cairn.components("estimator")`; its options are further keyword arguments.
keep: which covariances are kept up to date after every update: "none", "last" (of the variable that was added last) or
    "diagonal" (of every variable). All others are solved for when they are asked for.)";

KeptMarginals kept_of(const std::string& keep) {
  const std::array<std::pair<const char*, KeptMarginals>, 3> choices{
      {{"none", KeptMarginals::none},
       {"last", KeptMarginals::last},
       {"diagonal", KeptMarginals::diagonal}}};
  for (const auto& [name, kept] : choices) {
    if (keep == name) return kept;
  }
  throw Error(ErrorCode::usage,
              fmt::format("keep='{}': expected 'none', 'last' or 'diagonal'", keep));
}

std::unique_ptr<BoundEstimator> make(const std::string& name, const std::string& keep,
                                     const py::kwargs& options) {
  const KeptMarginals kept = kept_of(keep);
  auto estimator = default_registry().make<Estimator>(
      component_spec(name, options, Estimator::kKind, "Estimator"));
  estimator->keep_marginals(kept);
  return std::make_unique<BoundEstimator>(std::move(estimator));
}

// What the next update does -----------------------------------------------------------------------

void add_variable(BoundEstimator& bound, Id id, const py::object& value, bool fixed,
                  const py::object& type) {
  check_new_id(id);
  const bool placed_later = value.is_none() || py::isinstance<py::type>(value);
  const py::object which = !type.is_none() ? type : value;
  Variable variable{default_registry().variable_type(tag_of(which)), id, {}, fixed};
  if (!placed_later) {
    const Doubles state = doubles_of(value, "value");
    variable.state.assign(span_of(state).begin(), span_of(state).end());
  }
  bound.pending().variables.push_back(std::move(variable));
}

void add_measurement(BoundEstimator& bound, const Measured& measured, const py::object& sigmas,
                     const py::object& information, const py::object& covariance,
                     const py::object& loss) {
  bound.pending().factors.push_back(
      factor_of(measured, Noise{sigmas, information, covariance}, loss));
}

void append_ids(std::vector<std::int64_t>& list, const py::object& ids, const char* what) {
  const Ids numbers =
      py::isinstance<py::int_>(ids) ? ids_of(py::make_tuple(ids), what) : ids_of(ids, what);
  list.insert(list.end(), span_of(numbers).begin(), span_of(numbers).end());
}

void change(BoundEstimator& bound, FactorId factor, const py::object& values,
            const py::object& sigmas, const py::object& information, const py::object& covariance) {
  const Doubles numbers = doubles_of(values, "values");
  ChangedFactor changed{factor, {span_of(numbers).begin(), span_of(numbers).end()}, {}};
  if (!sigmas.is_none() || !information.is_none() || !covariance.is_none()) {
    const int n = bound.get().factor(factor).type->residual_size();
    changed.information = Noise{sigmas, information, covariance}.packed(n);
  }
  bound.pending().changed.push_back(std::move(changed));
}

UpdateReport update(BoundEstimator& bound, bool full, bool defer, double max_seconds) {
  if (!(max_seconds >= 0.0))
    throw Error(ErrorCode::usage, "max_seconds: expected 0 (no limit) or more");
  const GraphUpdate what = std::exchange(bound.pending(), {});
  const EstimatorUse use(bound);
  const py::gil_scoped_release unlocked;
  Estimator& estimator = use.estimator();
  UpdateReport report =
      estimator.update(what, {.defer = defer, .full = full, .max_seconds = max_seconds});
  if (full) note_rejected(estimator.graph(), report);
  return report;
}

// Copies
// -------------------------------------------------------------------------------------------

std::unique_ptr<BoundEstimator> copy(BoundEstimator& bound) {
  auto result = std::make_unique<BoundEstimator>(bound.get().clone());
  result->pending() = bound.pending();
  return result;
}

// Classes -----------------------------------------------------------------------------------------

void bind_report(py::module_& module) {
  py::class_<UpdateReport> type(module, "UpdateReport", "What an update did.");
  type.def("__repr__", [](const UpdateReport& report) {
    return fmt::format("<cairn.UpdateReport {}: {} affected, {} relinearized, {:.3g} s>",
                       report.ok ? "ok" : "not ok", report.affected_variables,
                       report.relinearized_factors, report.seconds.total);
  });
  bind_fields<UpdateReport>(type);
}

void bind_changes(py::class_<BoundEstimator, HasEstimator>& estimator) {
  estimator
      .def("add", &add_variable, py::arg("id"), py::arg("value") = py::none(),
           py::arg("fixed") = false, py::arg("type") = py::none(),
           R"(Adds a variable with the next update.

value: a Pose2, Pose3, Point2 or Point3, or the numbers of a state of the variable type `type`, given by its tag. A class,
such as cairn.Pose2, or None with `type`: the first measurement of the update that can places it.)")
      .def("add", &add_measurement, py::arg("measurement"), py::kw_only(),
           py::arg("sigmas") = py::none(), py::arg("information") = py::none(),
           py::arg("covariance") = py::none(), py::arg("loss") = py::none(),
           "Adds a measurement with the next update; see `Graph.add`.")
      .def(
          "add",
          [](BoundEstimator& bound, const Factor& factor) {
            bound.pending().factors.push_back(factor);
          },
          py::arg("factor"), "Adds a measurement with its noise with the next update.")
      .def(
          "add",
          [](BoundEstimator&, const py::args& arguments, const py::kwargs& named) {
            refuse_added(arguments, named);
          },
          "Anything else is a TypeError.")
      .def("change", &change, py::arg("factor"), py::arg("values"), py::kw_only(),
           py::arg("sigmas") = py::none(), py::arg("information") = py::none(),
           py::arg("covariance") = py::none(),
           "Replaces what a factor measured and, where it is given, how certain that is.")
      .def(
          "marginalize",
          [](BoundEstimator& bound, const py::object& ids) {
            append_ids(bound.pending().marginalized, ids, "ids");
          },
          py::arg("ids"),
          "Variables that leave with the next update, one id or several; their information stays "
          "as a prior on their neighbours.")
      .def(
          "remove",
          [](BoundEstimator& bound, const py::object& variables, const py::object& factors) {
            append_ids(bound.pending().removed_variables, variables, "variables");
            append_ids(bound.pending().removed_factors, factors, "factors");
          },
          py::kw_only(), py::arg("variables") = py::tuple(), py::arg("factors") = py::tuple(),
          "Takes out variables (ids) with all factors on them, and factors (numbers), with the "
          "next "
          "update.")
      .def("update", &update, py::kw_only(), py::arg("full") = false, py::arg("defer") = false,
           py::arg("max_seconds") = 0.0,
           R"(Carries out what was asked for since the last update; returns an UpdateReport.

full: relinearise, reorder and solve everything, until it has converged.
defer: take in what is new and solve later.
max_seconds: relinearisation that would take longer is deferred to later updates; 0: no limit.

With an Error the estimator is as it was after the last update, and what was asked for is forgotten.)")
      .def(
          "set_loss",
          [](BoundEstimator& bound, const py::object& loss, const std::string& on) {
            bound.get().set_loss(loss_of(loss), selector_of(on));
          },
          py::arg("loss"), py::arg("on") = "all",
          "As `Graph.set_loss`, also for factors to come that have no loss of their own.");
}

void bind_copies(py::class_<BoundEstimator, HasEstimator>& estimator) {
  estimator
      .def("copy", &copy,
           "A copy, for questions of the kind 'what if': neither is affected by changes of the "
           "other.")
      .def("__copy__", &copy)
      .def("__deepcopy__", [](BoundEstimator& bound, const py::dict&) { return copy(bound); })
      .def_property_readonly("factor_count",
                             [](BoundEstimator& bound) { return bound.get().factor_count(); })
      .def_property_readonly(
          "factors", [](BoundEstimator& bound) { return bound.get().factors(); },
          "Numbers of all factors, rising.")
      .def("__repr__", [](BoundEstimator& bound) {
        return fmt::format("<cairn.Estimator: {} variables, {} factors>",
                           bound.get().variable_count(), bound.get().factor_count());
      });
}

}  // namespace

void bind_estimator(py::module_& module) {
  bind_report(module);
  py::class_<BoundEstimator, HasEstimator> estimator(module, "Estimator", kDoc);
  estimator.def(py::init(&make), py::arg("name") = "incremental_cholesky", py::kw_only(),
                py::arg("keep") = "none");
  bind_changes(estimator);
  bind_copies(estimator);
}

}  // namespace cairn::python
