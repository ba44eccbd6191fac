// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <exception>
#include <utility>

#include <pybind11/pybind11.h>

namespace cairn::python {

namespace py = pybind11;

/// Whether it is False, of Python or of NumPy; None, 0 and others are not.
inline bool is_false(const py::object& answer) {
  py::detail::make_caster<bool> truth;
  return truth.load(answer, false) && !static_cast<bool>(truth);
}

/// Calls a function written in Python after each step of a run, which is to end when the function
/// has returned False or raised, or Ctrl-C was pressed. It is used by a thread
/// without the interpreter's lock.
class Follower {
 public:
  /// `function`: None, or called with what a step has led to. `interrupt`: of the `InterruptGuard`.
  Follower(py::object function, const std::atomic<bool>& interrupt)
      : function_(std::move(function)), interrupt_(&interrupt) {}

  /// From here on the function is called; before, only Ctrl-C counts.
  void follow() { follows_ = true; }
  template <class Step>
  void after(const Step& step) {
    if (interrupt_->load()) stop_ = true;
    if (!follows_ || function_.is_none() || stop_) return;
    const py::gil_scoped_acquire locked;
    try {
      if (is_false(function_(step))) stop_ = true;
    } catch (const py::error_already_set& error) {
      if (!error.matches(PyExc_KeyboardInterrupt) || !interrupt_->load())
        raised_ = std::current_exception();
      stop_ = true;
    }
  }
  /// Ends the run.
  void end() { stop_ = true; }
  const std::atomic<bool>& stop() const { return stop_; }
  /// Throws what the function has raised, if it has.
  void rethrow() const {
    if (raised_) std::rethrow_exception(raised_);
  }

 private:
  py::object function_;
  const std::atomic<bool>* interrupt_;
  bool follows_ = false;
  std::atomic<bool> stop_ = false;
  std::exception_ptr raised_;
};

}  // namespace cairn::python
