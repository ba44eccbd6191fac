// SPDX-License-Identifier: BSD-3-Clause
#include "exploration/support/exploration_runs.hpp"

#include "cairn/grid/floor_plan.hpp"

namespace cairn::test {

OccupancyGrid floor_named(const std::string& plan, std::uint64_t seed) {
  return Registry().make<FloorPlan>(parse_component(plan))->generate(seed);
}

ExplorationParts::ExplorationParts(const std::string& world_name, const std::string& explorer_name)
    : world(make<World>(world_name)),
      policy(make<PosePolicy>("compact_pose:range=1,angle=0.35,reuse=false")),
      registration(make<Registration>(kTrueMatcher)),
      mapper(make<Mapper>("log_odds")),
      explorer(make<Explorer>(explorer_name)) {}

Exploration ExplorationParts::on(const OccupancyGrid& floor, std::uint64_t seed) {
  return {.world = *world,
          .policy = *policy,
          .registration = *registration,
          .mapper = *mapper,
          .explorer = *explorer,
          .registry = registry,
          .start = {.floor = &floor, .pose = {}, .seed = seed},
          .limits = {}};
}

DecidedRun explore(const std::string& plan, const std::string& world, const std::string& explorer,
                   const ExplorationLimits& limits, std::uint64_t seed) {
  const OccupancyGrid floor = floor_named(plan, seed);
  ExplorationParts parts(world, explorer);
  DecidedRun run;
  Exploration exploration = parts.on(floor, seed);
  exploration.limits = limits;
  exploration.decided = [&](const Decision& decision, const Situation&) {
    run.decisions.push_back(decision);
  };
  run.result = run_exploration(exploration);
  return run;
}

}  // namespace cairn::test
