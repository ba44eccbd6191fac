// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>

namespace cairn::python {

/// Whether Ctrl-C was pressed while an `InterruptGuard` exists.
bool interrupted();

/// While one exists, Ctrl-C (SIGINT) sets a flag besides what Python does with it, so that an
/// optimisation ends with its best estimate although the interpreter does not run. Several may
/// exist, in several threads. To be made and destroyed under the interpreter's lock.
class InterruptGuard {
 public:
  InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;
  ~InterruptGuard();

  const std::atomic<bool>& flag() const;

  /// After the work: takes the KeyboardInterrupt that Python would raise for the same Ctrl-C, since
  /// it was obeyed. Throws what else a signal handler written in Python raises.
  void absorb() const;
};

}  // namespace cairn::python
