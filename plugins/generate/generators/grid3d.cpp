// SPDX-License-Identifier: BSD-3-Clause
// A robot that visits every node of a cubic lattice, back and forth, row by row and floor by floor,
// and sees neighbouring nodes that it has visited: as in grid3D of Carlone et al. (ICRA 2015). The
// hardest of the usual graphs for a sparse factorisation: fill grows with the 4/3 power of the
// nodes.
#include <cstdlib>

#include "generators.hpp"
#include "grid3d.hpp"
#include "loops.hpp"
#include "noise.hpp"
#include "simulation_builder.hpp"

namespace cairn::generate {
namespace {

struct Lattice {
  int nx, ny, nz;
  double spacing;

  /// Where the node (x, y, z) comes along the path: rows and floors alternate in direction, so that
  /// consecutive nodes are neighbours.
  int index(int x, int y, int z) const {
    const int row = z % 2 == 0 ? y : ny - 1 - y;
    const int rows_before = z * ny + row;
    return rows_before * nx + (rows_before % 2 == 0 ? x : nx - 1 - x);
  }
  std::array<int, 3> node(int index) const {
    const int rows_before = index / nx, along = index % nx;
    const int z = rows_before / ny, row = rows_before % ny;
    return {rows_before % 2 == 0 ? along : nx - 1 - along, z % 2 == 0 ? row : ny - 1 - row, z};
  }
  int size() const { return nx * ny * nz; }
};

/// Each pose looks towards the next node; z stays up, except where the robot climbs.
std::vector<Pose3> visit_all(const Lattice& lattice) {
  std::vector<Pose3> path;
  path.reserve(static_cast<std::size_t>(lattice.size()));
  std::array<double, 3> forward{1.0, 0.0, 0.0};
  for (int k = 0; k < lattice.size(); ++k) {
    const std::array<int, 3> here = lattice.node(k);
    if (k + 1 < lattice.size()) {
      const std::array<int, 3> next = lattice.node(k + 1);
      for (int a = 0; a < 3; ++a) forward[a] = next[a] - here[a];
    }
    const std::array<double, 3> up = forward[2] != 0.0 ? std::array<double, 3>{-1.0, 0.0, 0.0}
                                                       : std::array<double, 3>{0.0, 0.0, 1.0};
    path.push_back(look_along(
        {lattice.spacing * here[0], lattice.spacing * here[1], lattice.spacing * here[2]}, forward,
        up));
  }
  return path;
}

std::vector<Loop> see_neighbours(const Lattice& lattice, double density, Random& random) {
  std::vector<Loop> loops;
  for (int k = 0; k < lattice.size(); ++k) {
    const std::array<int, 3> here = lattice.node(k);
    for (int axis = 0; axis < 3; ++axis) {
      for (int side = -1; side <= 1; side += 2) {
        std::array<int, 3> there = here;
        there[axis] += side;
        const std::array<int, 3> n{lattice.nx, lattice.ny, lattice.nz};
        if (there[axis] < 0 || there[axis] >= n[axis]) continue;
        const int other = lattice.index(there[0], there[1], there[2]);
        if (other < k - 1 && random.chance(density)) loops.push_back({other, k});
      }
    }
  }
  return loops;
}

}  // namespace

std::unique_ptr<Generator> make_grid3d(const Grid3dOptions& options) {
  const Lattice lattice{options.nx, options.ny, options.nz, options.spacing};
  const double density = options.loop_density;
  const Noise noise = options.noise;
  const Outliers outliers{options.outliers, lattice.spacing};
  return std::make_unique<FunctionGenerator>([=](Registry& types, std::uint64_t seed) {
    Random meet(seed, Random::Stream::loops);
    return simulate(visit_all(lattice), see_neighbours(lattice, density, meet), noise, outliers,
                    types, seed);
  });
}

}  // namespace cairn::generate
