// SPDX-License-Identifier: BSD-3-Clause
#include "python_factor.hpp"

#include <algorithm>
#include <exception>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "arrays.hpp"
#include "cairn/runtime/callback_exit.hpp"
#include "cairn/runtime/error.hpp"
#include "interrupt.hpp"

namespace cairn::python {
namespace {

/// Without the interpreter's lock, if this thread has it.
class Unlocked {
 public:
  Unlocked() {
    if (PyGILState_Check() != 0) released_.emplace();
  }

 private:
  std::optional<py::gil_scoped_release> released_;
};

std::size_t size_of(int n) { return static_cast<std::size_t>(n); }

/// "ValueError: what it says (file.py, line 7)"
std::string text_of(const py::error_already_set& error) {
  std::string text = fmt::format("{}: {}", error.type().attr("__name__").cast<std::string>(),
                                 std::string(py::str(error.value())));
  py::object innermost = error.trace();
  while (innermost && !innermost.attr("tb_next").is_none()) innermost = innermost.attr("tb_next");
  if (!innermost) return text;
  return text +
         fmt::format(
             " ({}, line {})",
             innermost.attr("tb_frame").attr("f_code").attr("co_filename").cast<std::string>(),
             innermost.attr("tb_lineno").cast<int>());
}

/// Whether it is to end whatever called the function, as Ctrl-C does (KeyboardInterrupt) or
/// sys.exit().
bool ends_the_call(const py::error_already_set& error) { return !error.matches(PyExc_Exception); }

}  // namespace

PythonFactor::PythonFactor(Description description, py::object residual, py::object jacobians)
    : BatchedFactorType(std::move(description)),
      residual_(std::move(residual)),
      jacobians_(std::move(jacobians)) {}

PythonFactor::~PythonFactor() {
  // A graph may be destroyed by any thread, and a registry after the interpreter has ended.
  if (Py_IsInitialized() == 0) {
    residual_.release();
    jacobians_.release();
    return;
  }
  const py::gil_scoped_acquire locked;
  residual_ = py::object();
  jacobians_ = py::object();
}

py::object PythonFactor::call(const py::object& function, std::size_t count,
                              std::span<const double* const> states,
                              const double* measurements) const {
  // Copies: a function may keep what it is given.
  py::tuple arguments(states.size() + 1);
  for (std::size_t k = 0; k < states.size(); ++k) {
    const std::size_t ambient = size_of(ambient_size(static_cast<int>(k)));
    arguments[k] = array_of({states[k], count * ambient}, {count, ambient});
  }
  const std::size_t size = size_of(measurement_size());
  arguments[states.size()] = array_of({measurements, count * size}, {count, size});
  try {
    try {
      return function(*arguments);
    } catch (const py::error_already_set& error) {
      // Ctrl-C ends an optimisation with its best estimate, after what is being computed.
      if (!error.matches(PyExc_KeyboardInterrupt) || !interrupted()) throw;
    }
    return function(*arguments);
  } catch (const py::error_already_set& error) {
    if (ends_the_call(error)) throw CallbackExit(std::current_exception());
    throw Error(ErrorCode::plugin,
                fmt::format("factor '{}', written in Python: {}", tag(), text_of(error)));
  }
}

void PythonFactor::copy_checked(const py::object& result, const char* what, std::size_t count,
                                int columns, double* out) const {
  const std::size_t n = size_of(residual_size());
  const Doubles numbers = doubles_of(result, fmt::format("factor '{}': {}", tag(), what));
  const bool is_matrix = columns > 0;
  std::vector<std::size_t> expected{count, n};
  if (is_matrix) expected.push_back(size_of(columns));
  std::vector<std::size_t> shape(numbers.shape(), numbers.shape() + numbers.ndim());
  if (!is_matrix && n == 1 && shape == std::vector<std::size_t>{count}) shape.push_back(1);
  if (shape != expected) {
    throw Error(
        ErrorCode::plugin,
        fmt::format("factor '{}': {} has the shape {}, expected ({}, {}{}) for {} factor{}", tag(),
                    what, shape_text(numbers), count, n,
                    is_matrix ? fmt::format(", {}", columns) : "", count, count == 1 ? "" : "s"));
  }
  std::ranges::copy(span_of(numbers), out);
}

void PythonFactor::residuals(std::size_t count, std::span<const double* const> states,
                             const double* measurements, double* out) const {
  const py::gil_scoped_acquire locked;
  copy_checked(call(residual_, count, states, measurements), "what residual returned", count, 0,
               out);
}

void PythonFactor::jacobians(std::size_t count, std::span<const double* const> states,
                             const double* measurements, double* const* out) const {
  const py::gil_scoped_acquire locked;
  if (jacobians_.is_none()) {
    BatchedFactorType::jacobians(count, states, measurements, out);
    return;
  }
  const py::object result = call(jacobians_, count, states, measurements);
  if (!py::isinstance<py::sequence>(result) || py::len(result) != states.size()) {
    throw Error(ErrorCode::plugin,
                fmt::format("factor '{}': expected of jacobians one array for each of its {} "
                            "variables",
                            tag(), states.size()));
  }
  for (int k = 0; k < arity(); ++k) {
    copy_checked(result[py::int_(k)], fmt::format("Jacobian {}", k).c_str(), count, tangent_size(k),
                 out[k]);
  }
}

void PythonFactor::squared_norms(const FactorView& pool, std::size_t begin, std::size_t end,
                                 double* out) const {
  const Unlocked unlocked;
  BatchedFactorType::squared_norms(pool, begin, end, out);
}

void PythonFactor::linearize(const FactorView& pool, std::size_t begin, std::size_t end,
                             const double* weights, const LinearizeSink& sink,
                             double* out_squared_norms) const {
  const Unlocked unlocked;
  BatchedFactorType::linearize(pool, begin, end, weights, sink, out_squared_norms);
}

void PythonFactor::evaluate(const double* const* x, const double* measurement,
                            const double* sqrt_information, double* residual,
                            double* const* jacobians) const {
  const Unlocked unlocked;
  BatchedFactorType::evaluate(x, measurement, sqrt_information, residual, jacobians);
}

std::shared_ptr<PythonFactor> python_factor(const py::object& type) {
  if (!py::isinstance<PythonFactor>(type)) return nullptr;
  return type.cast<std::shared_ptr<PythonFactor>>();
}

}  // namespace cairn::python
