// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <utility>

#include "cairn/runtime/component.hpp"

namespace cairn {

/// Thrown out of long work that is to end, for the caller that set `Interruptible::watch` to catch.
/// What the work had found is lost, and nothing else.
struct Interruption {};

/// A component whose work may take long. It asks now and then whether to go on.
class Interruptible : public Component {
 public:
  /// `go_on` is asked from now on in the thread that works, every few milliseconds or less often;
  /// where it returns false, the work ends with an `Interruption`. Empty: the work goes on to its
  /// end.
  void watch(std::function<bool()> go_on) { go_on_ = std::move(go_on); }

 protected:
  /// Throws `Interruption` if the work is to end.
  void check_interruption() const {
    if (go_on_ && !go_on_()) throw Interruption();
  }

 private:
  std::function<bool()> go_on_;
};

}  // namespace cairn
