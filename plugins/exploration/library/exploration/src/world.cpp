// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/world.hpp"

#include "cairn/exploration/recorded_world.hpp"

namespace cairn {

World::~World() = default;
RecordedWorld::~RecordedWorld() = default;

}  // namespace cairn
