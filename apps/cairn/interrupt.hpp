// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>

namespace cairn::app {

/// While one exists, Ctrl-C (SIGINT) and SIGTERM only set a flag, so that work can end with its
/// best result; a second one ends the program as usual. One at a time.
class InterruptGuard {
 public:
  InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;
  ~InterruptGuard();

  const std::atomic<bool>& flag() const;
  bool interrupted() const { return flag().load(); }
};

inline constexpr int kExitInterrupted = 130;

}  // namespace cairn::app
