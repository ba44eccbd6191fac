// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cairn/program/session.hpp"

namespace cairn::app {

/// `cairn plugins --check FILE…`
struct PluginCheckOptions {
  std::vector<std::string> files;
  double seconds = 60.0;   ///< for each group of checks
  std::uint64_t seed = 1;  ///< of the random inputs
};

/// Runs the conformance suite over what each file offers, in child processes, and prints each group
/// of checks as it ends. Returns 0, or the exit code of plugin errors if anything was found.
int check_plugins(const PluginCheckOptions& options, Session& session);

}  // namespace cairn::app
