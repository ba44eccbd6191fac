// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "commands.hpp"

namespace cairn::app {

/// cairn study optimality FLOOR: the D-optimality of many paths, exactly and by the Laplacian.
Command study_optimality_command();

}  // namespace cairn::app
