// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>

namespace cairn::app {

inline constexpr int kExitInterrupted = 130;

/// From here on Ctrl-C (SIGINT) and SIGTERM end the program with `kExitInterrupted` at once, where
/// no `InterruptGuard` exists; outputs that are not whole are removed. For the start of `main`.
void end_on_interrupts();

/// While one exists, Ctrl-C (SIGINT) and SIGTERM only set a flag, so that work can end with its
/// best result; a second one ends the program as without one. One at a time.
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
