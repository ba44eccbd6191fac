// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sparsification/edge_selection.hpp"

namespace cairn {

EdgeSelection::~EdgeSelection() = default;

}  // namespace cairn
