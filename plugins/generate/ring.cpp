// SPDX-License-Identifier: BSD-3-Clause
// Laps on a circle: the last part of the way repeats the first, and only there loops are closed.
// One weak constraint on a long chain, the smallest world in which an estimate bends.
#include "generators.hpp"
#include "loops.hpp"
#include "noise.hpp"
#include "simulation_builder.hpp"

namespace cairn::generate {

OptionTable ring_options() {
  OptionTable table;
  table.integer("poses", 434, 3, 1e8, "number of poses")
      .real("laps", 1.06, 0.01, 1e6, "times around")
      .real("step", 1.0, 1e-3, 1e3, "distance between poses [m]")
      .real("loop_radius", 0.8, 1e-3, 1e4, "loops are closed with places nearer than this [m]")
      .real("loop_density", 1.0, 0.0, 1.0, "probability that a place within reach is recognised")
      .integer("loops_per_pose", 1, 0, 1000, "largest number of loops that a pose closes");
  add_noise_options(table, {.translation_sigma = 0.05, .rotation_sigma = 0.01});
  add_outlier_option(table);
  return table;
}

std::unique_ptr<Generator> make_ring(const Options& options) {
  const std::int64_t poses = options.integer("poses");
  const double turn =
      2.0 * kPi * options.real("laps") / static_cast<double>(poses - 1);  // a step [rad]
  const double radius = options.real("step") / turn;  // steps are measured along the arc
  LoopRule rule;
  rule.radius = options.real("loop_radius");
  rule.probability = options.real("loop_density");
  rule.most = static_cast<int>(options.integer("loops_per_pose"));
  rule.gap = std::max(2, static_cast<int>(kPi / turn));  // half a lap
  rule.cell_capacity = 64;
  const Noise noise = read_noise(options);
  const Outliers outliers{options.integer("outliers"), rule.radius};
  return std::make_unique<FunctionGenerator>([=](Registry& types, std::uint64_t seed) {
    Random meet(seed, Random::Stream::loops);
    std::vector<Pose2> path;
    path.reserve(static_cast<std::size_t>(poses));
    for (std::int64_t k = 0; k < poses; ++k) {
      const double angle = turn * static_cast<double>(k);
      const SinCos r = sin_cos(wrap_angle(angle));
      path.push_back({radius * r.sin, radius * (1.0 - r.cos), wrap_angle(angle)});
    }
    return simulate(path, find_loops(path, rule, meet), noise, outliers, types, seed);
  });
}

}  // namespace cairn::generate
