// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/explorer.hpp"

namespace cairn {

Explorer::~Explorer() = default;
bool Explorer::is_worthwhile(const Situation&, const PlannedPath&) { return true; }

}  // namespace cairn
