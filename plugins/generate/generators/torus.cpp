// SPDX-License-Identifier: BSD-3-Clause
// A robot that winds around the tube of a torus until the turns close: as in the data sets
// torus10000 (iSAM) and torus3D (Carlone et al., ICRA 2015), each pose sees the one a turn earlier,
// and the last turn sees the first.
#include "torus.hpp"
#include "generators.hpp"
#include "loops.hpp"
#include "noise.hpp"
#include "simulation_builder.hpp"

namespace cairn::generate {
namespace {

struct Torus {
  int turns, poses_per_turn;
  double major_radius, minor_radius;
};

std::vector<Pose3> wind_around(const Torus& torus) {
  const int n = torus.turns * torus.poses_per_turn;
  std::vector<Pose3> path;
  path.reserve(static_cast<std::size_t>(n));
  for (int k = 0; k < n; ++k) {
    const SinCos tube =
        sin_cos(wrap_angle(2.0 * kPi * (k % torus.poses_per_turn) / torus.poses_per_turn));
    const SinCos around = sin_cos(wrap_angle(2.0 * kPi * (static_cast<double>(k) / n)));
    const double distance = torus.major_radius + torus.minor_radius * tube.cos;  // from the axis
    const std::array<double, 3> t{distance * around.cos, distance * around.sin,
                                  torus.minor_radius * tube.sin};
    const std::array<double, 3> forward{-tube.sin * around.cos, -tube.sin * around.sin, tube.cos};
    const std::array<double, 3> normal{tube.cos * around.cos, tube.cos * around.sin, tube.sin};
    path.push_back(look_along(t, forward, normal));
  }
  return path;
}

}  // namespace

std::unique_ptr<Generator> make_torus(const TorusOptions& options) {
  const Torus torus{options.turns, options.poses_per_turn, options.major_radius,
                    options.minor_radius};
  const double density = options.loop_density;
  const Noise noise = options.noise;
  const double spacing = 2.0 * kPi * torus.major_radius / torus.turns;  // between two turns [m]
  const Outliers outliers{options.outliers, spacing};
  return std::make_unique<FunctionGenerator>([=](Registry& types, std::uint64_t seed) {
    Random meet(seed, Random::Stream::loops);
    const std::vector<Pose3> path = wind_around(torus);
    const int turn = torus.poses_per_turn, n = static_cast<int>(path.size());
    std::vector<Loop> loops;
    for (int k = turn; k < n; ++k) {
      if (meet.chance(density)) loops.push_back({k - turn, k});
      const int first_turn = k - (n - turn);  // the place of this pose, once more around
      if (first_turn >= 0 && first_turn != k - turn && meet.chance(density)) {
        loops.push_back({first_turn, k});
      }
    }
    return simulate(path, loops, noise, outliers, types, seed);
  });
}

}  // namespace cairn::generate
