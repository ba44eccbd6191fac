// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "arguments.hpp"
#include "commands.hpp"

namespace cairn::app {

/// cairn study optimality FLOOR: the D-optimality of many paths, exactly and by the Laplacian.
Command add_study_optimality(ArgumentParser study);

}  // namespace cairn::app
