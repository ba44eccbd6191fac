// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <exception>
#include <string>
#include <utility>

#include <pybind11/pybind11.h>

#include "cairn/runtime/error.hpp"
#include "interrupt.hpp"

namespace cairn::python {

namespace py = pybind11;

/// The method of that name; None: it has none.
inline py::object method_of(const py::object& object, const char* name) {
  if (!py::hasattr(object, name)) return py::none();
  return object.attr(name);
}

/// A component that is written in Python. It lives under the interpreter's lock, and is called by a
/// thread without it.
class PythonComponent {
 public:
  /// Throws what its Python code has raised, if it has.
  void rethrow() const {
    if (raised_) std::rethrow_exception(raised_);
  }

 protected:
  /// `kind`: what it is, for messages: "registration".
  explicit PythonComponent(std::string kind) : kind_(std::move(kind)) {}
  ~PythonComponent() = default;

  /// `work` under the lock. What it raises is kept for `rethrow`, and ends the run as an `Error`;
  /// Ctrl-C ends it as well, after `otherwise` is returned.
  template <class Work, class Result>
  Result call(const Work& work, Result otherwise) {
    const py::gil_scoped_acquire locked;
    try {
      return work();
    } catch (const py::error_already_set& error) {
      if (error.matches(PyExc_KeyboardInterrupt) && interrupted()) return otherwise;
      raised_ = std::current_exception();
      throw Error(ErrorCode::plugin,
                  "the " + kind_ + ", written in Python, has raised an exception");
    } catch (const Error&) {
      raised_ = std::current_exception();
      throw;
    }
  }

 private:
  std::string kind_;
  std::exception_ptr raised_;
};

}  // namespace cairn::python
