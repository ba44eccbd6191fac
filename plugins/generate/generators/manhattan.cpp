// SPDX-License-Identifier: BSD-3-Clause
// A random walk on a regular grid of streets, after the simulated worlds of Olson, Leonard and
// Teller (ICRA 2006): the robot recognises places that it has passed, whichever way it came.
#include "manhattan.hpp"
#include "generators.hpp"
#include "loops.hpp"
#include "noise.hpp"
#include "simulation_builder.hpp"
#include "streets.hpp"

namespace cairn::generate {

std::unique_ptr<Generator> make_manhattan(const ManhattanOptions& options) {
  const std::int64_t poses = options.poses;
  const int block = options.block;
  int streets = options.streets;
  if (streets == 0) streets = streets_for(poses, block, 3.0);
  StreetWorld world{options.step, {}, {}};
  world.east_gaps.assign(static_cast<std::size_t>(std::max(streets - 1, 1)), block);
  world.north_gaps = world.east_gaps;
  LoopRule rule;
  rule.radius = options.loop_radius;
  rule.probability = options.loop_density;
  rule.most = options.loops_per_pose;
  rule.gap = 10;
  rule.cell_capacity = 16;
  const Noise noise = options.noise;
  const Outliers outliers{options.outliers, rule.radius};
  return std::make_unique<FunctionGenerator>([=](Registry& types, std::uint64_t seed) {
    Random walk(seed, Random::Stream::path), meet(seed, Random::Stream::loops);
    const std::vector<Pose2> path = random_walk(world, poses, walk);
    return simulate(path, find_loops(path, rule, meet), noise, outliers, types, seed);
  });
}

}  // namespace cairn::generate
