// SPDX-License-Identifier: BSD-3-Clause
#include "slam_names.hpp"

namespace cairn::app {

void add_slam_options(ArgumentParser cli, SlamNames& names) {
  cli.add_option("--mapper", names.mapper, "builds the map").type_name("NAME").show_default();
  cli.add_option("--policy", names.policy, "decides which poses and loop closures are kept")
      .type_name("NAME")
      .show_default();
  cli.add_option("--registration", names.registration, "matches the scans of two poses")
      .type_name("NAME")
      .show_default();
}

}  // namespace cairn::app
