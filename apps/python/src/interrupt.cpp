// SPDX-License-Identifier: BSD-3-Clause
#include "interrupt.hpp"

#include <csignal>

#include <pybind11/pybind11.h>

namespace cairn::python {
namespace {

// A signal handler can reach nothing but globals.
std::atomic<bool> interrupt_flag{false};
static_assert(std::atomic<bool>::is_always_lock_free, "else a signal handler may not touch it");
using Handler = void (*)(int);
std::atomic<Handler> python_handler{nullptr};
static_assert(std::atomic<Handler>::is_always_lock_free);

int guards = 0;  // under the interpreter's lock

extern "C" void cairn_python_on_signal(int signal) {
  interrupt_flag.store(true);
  if (const Handler handler = python_handler.load()) handler(signal);
}

bool is_function(const struct sigaction& action) {
  return (action.sa_flags & SA_SIGINFO) == 0 && action.sa_handler != SIG_DFL &&
         action.sa_handler != SIG_IGN;
}

}  // namespace

bool interrupted() { return guards > 0 && interrupt_flag.load(); }

InterruptGuard::InterruptGuard() {
  if (guards++ > 0) return;
  interrupt_flag.store(false);
  struct sigaction before {};
  sigaction(SIGINT, nullptr, &before);
  // Where SIGINT is ignored, or ends the process, it shall go on doing so.
  if (!is_function(before) || before.sa_handler == &cairn_python_on_signal) return;
  python_handler.store(before.sa_handler);
  before.sa_handler = &cairn_python_on_signal;
  sigaction(SIGINT, &before, nullptr);
}

InterruptGuard::~InterruptGuard() {
  if (--guards > 0) return;
  struct sigaction now {};
  sigaction(SIGINT, nullptr, &now);
  if ((now.sa_flags & SA_SIGINFO) != 0 || now.sa_handler != &cairn_python_on_signal) return;
  now.sa_handler = python_handler.load();
  sigaction(SIGINT, &now, nullptr);
}

const std::atomic<bool>& InterruptGuard::flag() const { return interrupt_flag; }

void InterruptGuard::absorb() const {
  if (!interrupt_flag.load() || PyErr_CheckSignals() == 0) return;
  if (PyErr_ExceptionMatches(PyExc_KeyboardInterrupt) == 0) throw pybind11::error_already_set();
  PyErr_Clear();
}

}  // namespace cairn::python
