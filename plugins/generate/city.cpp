// SPDX-License-Identifier: BSD-3-Clause
// Errands through a city with blocks of unequal size: long straight drives, and streets that are
// recognised only when they are driven in the same direction, as by a camera that looks ahead.
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

OptionTable city_options() {
  OptionTable table;
  table.integer("poses", 10000, 2, 1e8, "number of poses")
      .real("step", 1.0, 1e-3, 1e3, "distance between poses [m]")
      .integer("block", 12, 1, 10000, "mean steps between two crossings")
      .integer("streets", 0, 0, 100000, "streets in each direction; 0: as many as fit the poses")
      .real("loop_radius", 1.5, 1e-3, 1e4, "loops are closed with places nearer than this [m]")
      .real("loop_angle", 0.8, 0.0, 3.15, "and seen from a heading that differs less [rad]")
      .real("loop_density", 0.4, 0.0, 1.0, "probability that a place within reach is recognised")
      .integer("loops_per_pose", 2, 0, 1000, "largest number of loops that a pose closes");
  add_noise_options(table, {.translation_sigma = 0.02, .rotation_sigma = 0.01});
  add_outlier_option(table);
  return table;
}

std::unique_ptr<Generator> make_city(const Options& options) {
  const std::int64_t poses = options.integer("poses");
  const double step = options.real("step");
  const int block = static_cast<int>(options.integer("block"));
  int streets = static_cast<int>(options.integer("streets"));
  if (streets == 0) streets = streets_for(poses, block, 4.0);
  LoopRule rule;
  rule.radius = options.real("loop_radius");
  rule.max_angle = options.real("loop_angle");
  rule.probability = options.real("loop_density");
  rule.most = static_cast<int>(options.integer("loops_per_pose"));
  rule.gap = 10;
  rule.cell_capacity = 16;
  const Noise noise = read_noise(options);
  const Outliers outliers{options.integer("outliers"), rule.radius};
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
