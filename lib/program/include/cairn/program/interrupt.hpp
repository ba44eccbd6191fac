// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>

namespace cairn::app {

inline constexpr int kExitInterrupted = 130;

/// From here on Ctrl-C (SIGINT), SIGTERM and the end of a terminal (SIGHUP, unless it was ignored
/// when the program began) end it with `code` at once, where no `InterruptGuard` exists; outputs
/// that are not whole are removed. For the start of `main`, and for a service, whose end is no
/// failure.
void end_on_interrupts(int code = kExitInterrupted);

/// While one exists, these signals only set a flag, so that work can end with its best result; a
/// second one, but for SIGHUP, ends the program at once, with `kExitInterrupted`. One at a time.
class InterruptGuard {
 public:
  InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;
  ~InterruptGuard();

  const std::atomic<bool>& flag() const;
  bool interrupted() const { return flag().load(); }
};

}  // namespace cairn::app
