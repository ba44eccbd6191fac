// SPDX-License-Identifier: BSD-3-Clause
// Errands through a city with blocks of unequal size: long straight drives, and streets that are
// recognised only when they are driven in the same direction, as by a camera that looks ahead.
#include "city.hpp"
#include "generators.hpp"
#include "loops.hpp"
#include "noise.hpp"
#include "simulation_builder.hpp"
#include "streets.hpp"

namespace cairn::generate {
namespace {

/// Gaps between streets, drawn from half to one and a half times `block`.
std::vector<int> draw_gaps(int streets, int block, Random& random) {
  std::vector<int> gaps(static_cast<std::size_t>(std::max(streets - 1, 1)));
  const int least = std::max(1, block / 2);
  for (int& gap : gaps) gap = least + static_cast<int>(random.below(block + 1));
  return gaps;
}

}  // namespace

std::unique_ptr<Generator> make_city(const CityOptions& options) {
  const std::int64_t poses = options.poses;
  const double step = options.step;
  const int block = options.block;
  int streets = options.streets;
  if (streets == 0) streets = streets_for(poses, block, 4.0);
  LoopRule rule;
  rule.radius = options.loop_radius;
  rule.max_angle = options.loop_angle;
  rule.probability = options.loop_density;
  rule.most = options.loops_per_pose;
  rule.gap = 10;
  rule.cell_capacity = 16;
  const Noise noise = options.noise;
  const Outliers outliers{options.outliers, rule.radius};
  return std::make_unique<FunctionGenerator>([=](Registry& types, std::uint64_t seed) {
    Random walk(seed, Random::Stream::path), meet(seed, Random::Stream::loops);
    StreetWorld world{step, {}, {}};
    world.east_gaps = draw_gaps(streets, block, walk);
    world.north_gaps = draw_gaps(streets, block, walk);
    const std::vector<Pose2> path = errands(world, poses, walk);
    return simulate(path, find_loops(path, rule, meet), noise, outliers, types, seed);
  });
}

}  // namespace cairn::generate
