// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "commands.hpp"

namespace cairn::app {

/// cairn study objective FLOOR: which form of the objective orders paths as its definition does.
Command study_objective_command();

}  // namespace cairn::app
