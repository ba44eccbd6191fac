// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>

#include "arguments.hpp"
#include "session.hpp"

namespace cairn::app {

/// A subcommand: what the command line parser knows of it, and what it does once its options stand.
/// `run` returns the program's exit code, or throws `Error`.
struct Command {
  ArgumentParser parser;
  std::function<int(Session&)> run;
};

// One file each. Adds the subcommand with its options to the program.
Command add_plugins(ArgumentParser program);
Command add_new_plugin(ArgumentParser program);
Command add_info(ArgumentParser program);
Command add_convert(ArgumentParser program);
Command add_generate(ArgumentParser program);
Command add_optimize(ArgumentParser program);
Command add_bench(ArgumentParser program);
Command add_replay(ArgumentParser program);
Command add_online(ArgumentParser program);
Command add_marginals(ArgumentParser program);
Command add_compact(ArgumentParser program);
Command add_sparsify(ArgumentParser program);
Command add_explore(ArgumentParser program);
Command add_map(ArgumentParser program);
Command add_study(ArgumentParser program);
Command add_evaluate(ArgumentParser program);
Command add_view(ArgumentParser program);
Command add_plot(ArgumentParser program);

}  // namespace cairn::app
