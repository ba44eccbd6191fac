// SPDX-License-Identifier: BSD-3-Clause
// A robot that winds its way up a sphere, as in the data sets sphere400 and sphere2500 of Kaess,
// Ranganathan and Dellaert (iSAM, TRO 2008): each pose sees the one below it, a turn earlier.
#include "sphere.hpp"
#include "generators.hpp"
#include "loops.hpp"
#include "noise.hpp"
#include "simulation_builder.hpp"

namespace cairn::generate {
namespace {

struct Sphere {
  int turns, poses_per_turn;
  double radius;
};

std::vector<Pose3> wind_up(const Sphere& sphere) {
  const int n = sphere.turns * sphere.poses_per_turn;
  std::vector<Pose3> path;
  path.reserve(static_cast<std::size_t>(n));
  for (int k = 0; k < n; ++k) {
    const SinCos around =
        sin_cos(wrap_angle(2.0 * kPi * (k % sphere.poses_per_turn) / sphere.poses_per_turn));
    // Half a step away from the poles, where the direction around is not defined.
    const SinCos up = sin_cos(kPi * ((k + 0.5) / n - 0.5));
    const std::array<double, 3> normal{up.cos * around.cos, up.cos * around.sin, up.sin};
    const std::array<double, 3> east{-around.sin, around.cos, 0.0};
    path.push_back(look_along(
        {sphere.radius * normal[0], sphere.radius * normal[1], sphere.radius * normal[2]}, east,
        normal));
  }
  return path;
}

}  // namespace

std::unique_ptr<Generator> make_sphere(const SphereOptions& options) {
  const Sphere sphere{options.turns, options.poses_per_turn, options.radius};
  const double density = options.loop_density;
  const Noise noise = options.noise;
  const double spacing = kPi * sphere.radius / sphere.turns;  // between two turns [m]
  const Outliers outliers{options.outliers, spacing};
  return std::make_unique<FunctionGenerator>([=](Registry& types, std::uint64_t seed) {
    Random meet(seed, Random::Stream::loops);
    const std::vector<Pose3> path = wind_up(sphere);
    std::vector<Loop> loops;
    for (int k = sphere.poses_per_turn; k < static_cast<int>(path.size()); ++k) {
      if (meet.chance(density)) loops.push_back({k - sphere.poses_per_turn, k});
    }
    return simulate(path, loops, noise, outliers, types, seed);
  });
}

}  // namespace cairn::generate
