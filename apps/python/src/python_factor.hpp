// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include <pybind11/pybind11.h>

#include "cairn/typed/batched_factor.hpp"

namespace cairn::python {

namespace py = pybind11;

/// A factor type whose residual is a function written in Python, called with arrays. What it raises
/// is an `Error` (plugin); what is no Exception of Python, as after Ctrl-C, is a `CallbackExit`,
/// so that the caller gets it as it is. An optimisation obeys Ctrl-C otherwise (`InterruptGuard`),
/// and keeps its best estimate.
class PythonFactor final : public BatchedFactorType {
 public:
  /// residual(states…, measured) → (n, residual size). jacobians(states…, measured) → one array (n,
  /// residual size, tangent size) for each variable; None: central differences.
  PythonFactor(Description description, py::object residual, py::object jacobians);
  ~PythonFactor() override;

  void residuals(std::size_t count, std::span<const double* const> states,
                 const double* measurements, double* out) const override;
  void jacobians(std::size_t count, std::span<const double* const> states,
                 const double* measurements, double* const* out) const override;

  // The base class takes a lock of its own. A thread that waited for it with the interpreter's lock
  // would wait for ever, so these release that one first.
  void squared_norms(const FactorView& pool, std::size_t begin, std::size_t end,
                     double* out) const override;
  void linearize(const FactorView& pool, std::size_t begin, std::size_t end, const double* weights,
                 const LinearizeSink& sink, double* out_squared_norms) const override;
  void evaluate(const double* const* x, const double* measurement, const double* sqrt_information,
                double* residual, double* const* jacobians) const override;

 private:
  py::object call(const py::object& function, std::size_t count,
                  std::span<const double* const> states, const double* measurements) const;
  void copy_checked(const py::object& result, const char* what, std::size_t count, int columns,
                    double* out) const;

  py::object residual_, jacobians_;
};

/// The factor type that a Python object is, or null if it is none.
std::shared_ptr<PythonFactor> python_factor(const py::object& type);

}  // namespace cairn::python
