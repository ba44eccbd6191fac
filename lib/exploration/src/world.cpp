// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/world.hpp"

namespace cairn {

World::~World() = default;

}  // namespace cairn
