// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "arguments.hpp"

namespace cairn::app {

/// What makes a pose graph and a map of scans, by name.
struct SlamNames {
  std::string policy, registration = "icp", mapper = "log_odds";
};

/// --mapper, --policy and --registration.
void add_slam_options(ArgumentParser cli, SlamNames& names);

}  // namespace cairn::app
