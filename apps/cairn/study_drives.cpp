// SPDX-License-Identifier: BSD-3-Clause
#include "study_drives.hpp"

#include "floors.hpp"

namespace cairn::app {

void add_drive_options(ArgumentParser cli, DriveOptions& options) {
  cli.add_option("floor", options.floor, "the floor: floor.yaml, or @KIND[:k=v] to generate")
      .type_name("FLOOR")
      .file_or_generated({"floor_plan"})
      .required();
  cli.add_option("--runs", options.runs, "explorations, with the seeds that follow --seed")
      .type_name("N")
      .within(1, 1000000)
      .show_default();
  cli.add_option("--seed", options.seed, "of the first run").type_name("N").show_default();
  cli.add_option("--explorer", options.explorer, "decides where to drive")
      .component({"explorer"})
      .show_default();
  cli.add_option("--planner", options.planner, "finds the paths that are compared")
      .component({"path_planner"})
      .show_default();
  cli.add_option("--world", options.world, "the robot, as of cairn explore")
      .component({"world"})
      .show_default();
  add_slam_options(cli, options.slam);
}

StudyDrives::StudyDrives(const DriveOptions& options, Session& session)
    : options_(options),
      session_(session),
      floor_(load_floor(options.floor, session)),
      line_(session.common.quiet) {}

void StudyDrives::each(const std::function<void(std::uint64_t)>& drive) {
  for (int run = 0; run < options_.runs && !interrupted(); ++run)
    drive(options_.seed + static_cast<std::uint64_t>(run));
  line_.clear();
}

StudyDrives::Parts StudyDrives::parts() const {
  return {.world = make<World>(options_.world),
          .policy = make<PosePolicy>(options_.slam.policy),
          .registration = make<Registration>(options_.slam.registration),
          .mapper = make<Mapper>(options_.slam.mapper),
          .explorer = make<Explorer>(options_.explorer)};
}

Exploration StudyDrives::exploration(Parts& parts, std::uint64_t seed) const {
  return {.world = *parts.world,
          .policy = *parts.policy,
          .registration = *parts.registration,
          .mapper = *parts.mapper,
          .explorer = *parts.explorer,
          .registry = session_.registry(),
          .start = {.floor = &floor_, .pose = {}, .seed = seed},
          .limits = {},
          .interrupt = &guard_.flag()};
}

}  // namespace cairn::app
