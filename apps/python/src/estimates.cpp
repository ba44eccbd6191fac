// SPDX-License-Identifier: BSD-3-Clause
#include "estimates.hpp"

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <fmt/core.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "bound_graph.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/typed/symbol.hpp"
#include "component_names.hpp"
#include "missing.hpp"
#include "types_of.hpp"

namespace cairn::python {
namespace {

void expect_variable(const Estimator& estimator, Id id) {
  if (!estimator.has(id)) throw MissingKey("there is no variable " + id_text(id));
}

py::array_t<Id> ids_of_type(HasEstimator& bound, const py::object& type) {
  Estimator& estimator = bound.get();
  std::vector<Id> ids = estimator.variables();
  if (!type.is_none()) {
    const std::string tag = tag_of(type);
    std::erase_if(ids, [&](Id id) { return estimator.type(id)->tag() != tag; });
  }
  return py::array_t<Id>(static_cast<py::ssize_t>(ids.size()), ids.data());
}

py::array_t<double> states_of_type(HasEstimator& bound, const py::object& type) {
  const py::array_t<Id> ids = ids_of_type(bound, type);
  Estimator& estimator = bound.get();
  if (ids.size() == 0)
    throw Error(ErrorCode::usage, "there is no " + tag_of(type) + " in the estimator");
  std::vector<double> states;
  for (py::ssize_t k = 0; k < ids.size(); ++k) {
    const std::span<const double> state = estimator.state(ids.data()[k]);
    states.insert(states.end(), state.begin(), state.end());
  }
  const auto rows = static_cast<std::size_t>(ids.size());
  return array_of(states, {rows, states.size() / rows});
}

double chi2_of(HasEstimator& bound) {
  const EstimatorUse use(bound);
  const py::gil_scoped_release unlocked;
  return use.estimator().chi2();
}

std::unique_ptr<BoundGraph> graph_of(HasEstimator& bound) {
  const EstimatorUse use(bound);
  const py::gil_scoped_release unlocked;
  return std::make_unique<BoundGraph>(use.estimator().graph());
}

// Covariances -------------------------------------------------------------------------------------

/// Blocks of one size, of pairs of ids one after the other.
py::array_t<double> blocks(HasEstimator& bound, std::span<const Id> first,
                           std::span<const Id> second) {
  const EstimatorUse use(bound);
  Estimator& estimator = use.estimator();
  if (first.empty()) return blocks_of({}, 0, 0);
  for (const Id id : first) expect_variable(estimator, id);
  for (const Id id : second) expect_variable(estimator, id);
  const int rows = estimator.type(first[0])->tangent_size();
  const int columns = estimator.type(second[0])->tangent_size();
  const std::size_t size = static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
  std::vector<double> numbers(first.size() * size);
  {
    const py::gil_scoped_release unlocked;
    for (std::size_t k = 0; k < first.size(); ++k) {
      if (estimator.type(first[k])->tangent_size() != rows ||
          estimator.type(second[k])->tangent_size() != columns) {
        throw Error(ErrorCode::usage,
                    fmt::format("an array has blocks of one size, and that of {} is another than "
                                "that of {}: ask for each type by itself",
                                id_text(first[k]), id_text(first[0])));
      }
      if (!estimator.covariance(first[k], second[k], {numbers.data() + k * size, size})) {
        throw Error(ErrorCode::numerical,
                    "the measurements so far do not determine variable " + id_text(first[k]));
      }
    }
  }
  return blocks_of(numbers, static_cast<std::size_t>(rows), static_cast<std::size_t>(columns));
}

py::object covariance(HasEstimator& bound, const py::object& ids) {
  const Ids names = one_or_several(ids, "ids");
  py::object all = blocks(bound, span_of(names), span_of(names));
  return is_one_id(ids) ? all[py::int_(0)] : all;
}

py::array_t<double> cross_covariances(HasEstimator& bound, const py::object& pairs) {
  const Ids names = ids_of(pairs, "pairs", 2);
  if (names.size() > 0 && names.shape(1) != 2) {
    throw Error(ErrorCode::usage,
                fmt::format("pairs: the shape is {}, expected (n, 2)", shape_text(names)));
  }
  std::vector<Id> first, second;
  for (std::size_t k = 0; k < span_of(names).size(); k += 2) {
    first.push_back(span_of(names)[k]);
    second.push_back(span_of(names)[k + 1]);
  }
  return blocks(bound, first, second);
}

}  // namespace

void bind_estimates(py::module_& module) {
  py::class_<HasEstimator> estimates(module, "_Estimates",
                                     "Estimates and covariances that are kept up to date.");
  estimates
      .def(
          "estimate",
          [](HasEstimator& bound, Id id) {
            Estimator& e = bound.get();
            expect_variable(e, id);
            return value_of(*e.type(id), e.state(id));
          },
          py::arg("id"),
          "The estimate of a variable: a Pose2, Pose3, Point2 or Point3; of other types its "
          "numbers.")
      .def("ids", &ids_of_type, py::arg("type") = py::none(),
           "Ids of all variables, or of those of a type, in the order of addition: (n,) integers.")
      .def("states", &states_of_type, py::arg("type"),
           "The estimates of all variables of a type, in the order of `ids(type)`: (n, m) numbers.")
      .def(
          "covariance", &covariance, py::arg("ids"),
          R"(Covariances of variables of one tangent size d: (d, d) of one id, (n, d, d) of several.

Of the step delta with x_true = x.retract(delta), at the present linearisation; see `cairn.marginals`.)")
      .def("cross_covariances", &cross_covariances, py::arg("pairs"),
           "Covariances of pairs of variables: (n, d_a, d_b) for pairs (n, 2) of ids (a, b).")
      .def("chi2", &chi2_of, "The sum of rho(||r||^2) at the present estimate.")
      .def("graph", &graph_of, "Everything at the present estimate, as a Graph of its own.")
      .def("__contains__", [](HasEstimator& bound, Id id) { return bound.get().has(id); })
      .def_property_readonly("variable_count",
                             [](HasEstimator& bound) { return bound.get().variable_count(); });
}

}  // namespace cairn::python
