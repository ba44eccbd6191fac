// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// Ability of a world that is a recorded run: the robot goes where it went, `World::move` ignores
/// the motion that it is given, and `World::begin` needs no floor.
class CAIRN_API RecordedWorld {
 public:
  static constexpr std::string_view kAbility = "recorded_world";
  virtual ~RecordedWorld();
  /// Whether its last scan has been taken: `move` throws `Error` (usage) from then on.
  virtual bool has_ended() const = 0;
};

}  // namespace cairn
