// SPDX-License-Identifier: BSD-3-Clause
#include "slam_names.hpp"

namespace cairn::app {

void add_slam_options(ArgumentParser cli, SlamNames& names) {
  cli.add_option("--mapper", names.mapper, "builds the map").component({"mapper"}).show_default();
  cli.add_option("--policy", names.policy, "decides which poses and loop closures are kept")
      .component({"pose_policy"})
      .show_default();
  cli.add_option("--registration", names.registration, "matches the scans of two poses")
      .component({"registration"})
      .show_default();
}

}  // namespace cairn::app
