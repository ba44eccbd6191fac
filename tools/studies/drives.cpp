// SPDX-License-Identifier: BSD-3-Clause
#include "drives.hpp"

#include "cairn/program/command.hpp"
#include "floors.hpp"

namespace cairn::app {

OptionFields<DriveOptions> DriveOptions::fields() {
  using O = DriveOptions;
  return OptionFields<O>()
      .text("floor", &O::floor, "the floor: floor.yaml, or @KIND[:k=v] to generate")
      .positional()
      .placeholder("FLOOR")
      .or_generated_by({"floor_plan"})
      .required()
      .integer("runs", &O::runs, 1, 1e6, "explorations, with the seeds that follow --seed")
      .integer("seed", &O::seed, 0, kMostSeed, "of the first run")
      .component("explorer", &O::explorer, {"explorer"}, "decides where to drive")
      .component("planner", &O::planner, {"path_planner"}, "finds the paths that are compared")
      .component("world", &O::world, {"world"}, "the robot, as of cairn explore")
      .part(&O::slam);
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
