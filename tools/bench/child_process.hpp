// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <spawn.h>
#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace cairn::performance {

/// How a program ended.
struct Outcome {
  bool in_time = true;   ///< false: it was stopped because its time was over
  int exit_code = -1;    ///< -1: killed by a signal
  double seconds = 0.0;  ///< of the whole process
  std::string output;
  std::string complaint;  ///< the last line of standard error
};

/// Bytes that a program is allowed, four fifths of the machine's: one that wants more is to fail,
/// not to take the machine down.
double allowed_memory();

/// Starts a program with these files, and takes `actions` back. Throws `std::runtime_error` if it
/// cannot be started.
pid_t spawn_program(const std::vector<std::string>& words, posix_spawn_file_actions_t& actions);

/// Runs a program, with its standard output and error in files of the folder `work`. After `limit`
/// seconds (0: none) it is interrupted, as by Ctrl-C, and a little later killed. Throws
/// `std::runtime_error` if it cannot be started.
Outcome run_program(const std::vector<std::string>& words, const std::filesystem::path& work,
                    double limit = 0.0);

}  // namespace cairn::performance
