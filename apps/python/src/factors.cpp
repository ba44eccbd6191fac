// SPDX-License-Identifier: BSD-3-Clause
#include "factors.hpp"

#include <cstddef>
#include <string>
#include <utility>

#include <fmt/core.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/typed/symbol.hpp"
#include "component_names.hpp"

namespace cairn::python {
namespace {

const char* const kDoc =
    R"(A measurement with how certain it is, as one value: what a matcher returns, and a policy takes.

    link = cairn.Factor(cairn.Between(3, 41, measured), sigmas=[0.05, 0.05, 0.02])

sigmas, information, covariance, loss: as of `Graph.add`, which takes a Factor as well.)";

/// (r, r), from the packed upper triangle.
py::array_t<double> information_of(const Factor& factor) {
  const auto n = static_cast<std::size_t>(factor.type->residual_size());
  py::array_t<double> matrix({n, n});
  auto entries = matrix.mutable_unchecked<2>();
  const double* packed = factor.information.data();
  for (std::size_t row = 0; row < n; ++row) {
    for (std::size_t column = row; column < n; ++column) {
      const auto r = static_cast<py::ssize_t>(row), c = static_cast<py::ssize_t>(column);
      entries(r, c) = entries(c, r) = *packed++;
    }
  }
  return matrix;
}

std::string text_of(const Factor& factor) {
  std::string text(factor.type->tag());
  for (const Id id : factor.variables) text += " " + id_text(id);
  text += ":";
  for (const double number : factor.measurement) text += fmt::format(" {:.6g}", number);
  return "<cairn.Factor " + text + ">";
}

}  // namespace

Factor factor_of(const Measured& measured, const Noise& noise, const py::object& loss) {
  auto type = measured.own ? measured.own : default_registry().factor_type(measured.tag);
  if (std::ssize(measured.ids) != type->arity())
    throw Error(ErrorCode::usage, fmt::format("{}: {} ids, expected {}", type->tag(),
                                              measured.ids.size(), type->arity()));
  if (std::ssize(measured.numbers) != type->measurement_size())
    throw Error(ErrorCode::usage, fmt::format("{}: {} numbers measured, expected {}", type->tag(),
                                              measured.numbers.size(), type->measurement_size()));
  std::vector<double> packed = noise.packed(type->residual_size());
  return {std::move(type), measured.ids, measured.numbers, std::move(packed), loss_of(loss)};
}

std::vector<Factor> factors_of(const py::object& given, const char* what) {
  std::vector<Factor> factors;
  if (given.is_none()) return factors;
  if (py::isinstance<Factor>(given)) return {given.cast<Factor>()};
  const auto refuse = [&] {
    throw Error(ErrorCode::usage,
                fmt::format("{}: expected a cairn.Factor, several of them, or None; a measurement "
                            "becomes one by cairn.Factor(measurement, sigmas=…)",
                            what));
  };
  if (!py::isinstance<py::iterable>(given)) refuse();
  for (const py::handle one : given) {
    if (!py::isinstance<Factor>(one)) refuse();
    factors.push_back(one.cast<Factor>());
  }
  return factors;
}

void bind_factors(py::module_& module) {
  py::class_<Factor>(module, "Factor", kDoc)
      .def(py::init([](const Measured& measured, const py::object& sigmas,
                       const py::object& information, const py::object& covariance,
                       const py::object& loss) {
             return factor_of(measured, Noise{sigmas, information, covariance}, loss);
           }),
           py::arg("measurement"), py::kw_only(), py::arg("sigmas") = py::none(),
           py::arg("information") = py::none(), py::arg("covariance") = py::none(),
           py::arg("loss") = py::none())
      .def_property_readonly(
          "tag", [](const Factor& factor) { return std::string(factor.type->tag()); },
          "Name of the factor type.")
      .def_readonly("ids", &Factor::variables, "The variables, by id.")
      .def_property_readonly(
          "values", [](const Factor& factor) { return array_of(factor.measurement); },
          "The numbers measured.")
      .def_property_readonly("information", &information_of, "The information matrix: (r, r).")
      .def("__repr__", &text_of);
}

}  // namespace cairn::python
