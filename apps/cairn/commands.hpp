// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "command.hpp"

namespace cairn::app {

// One file each.
Command plugins_command();
Command new_plugin_command();
Command info_command();
Command convert_command();
Command generate_command();
Command optimize_command();
Command bench_command();
Command replay_command();
Command online_command();
Command marginals_command();
Command compact_command();
Command sparsify_command();
Command explore_command();
Command map_command();
Command evaluate_command();
Command view_command();
Command plot_command();
/// `study` and the commands that it has.
std::vector<Command> study_commands();

}  // namespace cairn::app
