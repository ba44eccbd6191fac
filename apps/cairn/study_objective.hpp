// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "arguments.hpp"
#include "commands.hpp"

namespace cairn::app {

/// cairn study objective FLOOR: which form of the objective orders paths as its definition does.
Command add_study_objective(ArgumentParser study);

}  // namespace cairn::app
