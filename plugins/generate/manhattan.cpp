// SPDX-License-Identifier: BSD-3-Clause
// A random walk on a regular grid of streets, after the simulated worlds of Olson, Leonard and
// Teller (ICRA 2006): the robot recognises places that it has passed, whichever way it came.
#include "generators.hpp"
#include "loops.hpp"
#include "noise.hpp"
#include "simulation_builder.hpp"
#include "streets.hpp"

namespace cairn::generate {

OptionTable manhattan_options() {
  OptionTable table;
  table.integer("poses", 3500, 2, 1e8, "number of poses")
      .real("step", 1.0, 1e-3, 1e3, "distance between poses [m]")
      .integer("block", 4, 1, 10000, "steps between two crossings")
      .integer("streets", 0, 0, 100000, "streets in each direction; 0: as many as fit the poses")
      .real("loop_radius", 1.5, 1e-3, 1e4, "loops are closed with places nearer than this [m]")
      .real("loop_density", 0.2, 0.0, 1.0, "probability that a place within reach is recognised")
      .integer("loops_per_pose", 3, 0, 1000, "largest number of loops that a pose closes");
  add_noise_options(table, {.translation_sigma = 0.02, .rotation_sigma = 0.02});
  add_outlier_option(table);
  return table;
}

std::unique_ptr<Generator> make_manhattan(const Options& options) {
  const std::int64_t poses = options.integer("poses");
  const int block = static_cast<int>(options.integer("block"));
  int streets = static_cast<int>(options.integer("streets"));
  if (streets == 0) streets = streets_for(poses, block, 3.0);
  StreetWorld world{options.real("step"), {}, {}};
  world.east_gaps.assign(static_cast<std::size_t>(std::max(streets - 1, 1)), block);
  world.north_gaps = world.east_gaps;
  LoopRule rule;
  rule.radius = options.real("loop_radius");
  rule.probability = options.real("loop_density");
  rule.most = static_cast<int>(options.integer("loops_per_pose"));
  rule.gap = 10;
  rule.cell_capacity = 16;
  const Noise noise = read_noise(options);
  const Outliers outliers{options.integer("outliers"), rule.radius};
  return std::make_unique<FunctionGenerator>([=](Registry& types, std::uint64_t seed) {
    Random walk(seed, Random::Stream::path), meet(seed, Random::Stream::loops);
    const std::vector<Pose2> path = random_walk(world, poses, walk);
    return simulate(path, find_loops(path, rule, meet), noise, outliers, types, seed);
  });
}

}  // namespace cairn::generate
