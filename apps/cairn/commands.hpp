// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>

#include <CLI/App.hpp>

#include "session.hpp"

namespace cairn::app {

/// A subcommand: what the command line parser knows of it, and what it does once its options stand.
/// `run` returns the program's exit code, or throws `Error`.
struct Command {
  CLI::App* app = nullptr;
  std::function<int(Session&)> run;
};

// One file each. Adds the subcommand with its options to the program.
Command add_plugins(CLI::App& program);
Command add_info(CLI::App& program);
Command add_convert(CLI::App& program);
Command add_generate(CLI::App& program);
Command add_optimize(CLI::App& program);
Command add_bench(CLI::App& program);
Command add_replay(CLI::App& program);
Command add_online(CLI::App& program);
Command add_marginals(CLI::App& program);
Command add_compact(CLI::App& program);
Command add_sparsify(CLI::App& program);
Command add_study(CLI::App& program);
Command add_evaluate(CLI::App& program);
Command add_view(CLI::App& program);
Command add_plot(CLI::App& program);

}  // namespace cairn::app
