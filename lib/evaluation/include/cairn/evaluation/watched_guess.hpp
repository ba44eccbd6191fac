// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string_view>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// Ability of an initial guess that may take long: it reports how far it is, and can be ended.
///
///     if (auto* watched = query<WatchedGuess>(*guess)) watched->watch(show_and_ask);
class CAIRN_API WatchedGuess {
 public:
  static constexpr std::string_view kAbility = "watched_guess";

  /// Is called now and then, in the thread of `compute`, with what is going on ("incremental") and
  /// which part of that is done, from 0 to 1. Returns whether to go on.
  using GoOn = std::function<bool(std::string_view what, double part)>;

  /// For each `compute` from now on; an empty function: none. Once it has returned false `compute`
  /// ends soon, with the best states that it has, and says so in a note.
  virtual void watch(GoOn go_on) = 0;

 protected:
  ~WatchedGuess() = default;
};

}  // namespace cairn
