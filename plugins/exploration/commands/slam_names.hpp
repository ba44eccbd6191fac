// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/plugin/option_fields.hpp"

namespace cairn::app {

/// What makes a pose graph and a map of scans, by name.
struct SlamNames {
  std::string policy, registration = "icp", mapper = "log_odds";

  static auto fields() {
    using O = SlamNames;
    return OptionFields<O>()
        .component("mapper", &O::mapper, {"mapper"}, "builds the map")
        .component("policy", &O::policy, {"pose_policy"},
                   "decides which poses and loop closures are kept")
        .component("registration", &O::registration, {"registration"},
                   "matches the scans of two poses");
  }
};

}  // namespace cairn::app
