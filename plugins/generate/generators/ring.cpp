// SPDX-License-Identifier: BSD-3-Clause
// Laps on a circle: the last part of the way repeats the first, and only there loops are closed.
// One weak constraint on a long chain, the smallest world in which an estimate bends.
#include "ring.hpp"
#include "generators.hpp"
#include "loops.hpp"
#include "noise.hpp"
#include "simulation_builder.hpp"

namespace cairn::generate {

std::unique_ptr<Generator> make_ring(const RingOptions& options) {
  const std::int64_t poses = options.poses;
  const double turn = 2.0 * kPi * options.laps / static_cast<double>(poses - 1);  // a step [rad]
  const double radius = options.step / turn;  // steps are measured along the arc
  LoopRule rule;
  rule.radius = options.loop_radius;
  rule.probability = options.loop_density;
  rule.most = options.loops_per_pose;
  rule.gap = std::max(2, static_cast<int>(kPi / turn));  // half a lap
  rule.cell_capacity = 64;
  const Noise noise = options.noise;
  const Outliers outliers{options.outliers, rule.radius};
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
