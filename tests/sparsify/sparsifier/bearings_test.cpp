// SPDX-License-Identifier: BSD-3-Clause
// Poses that leave have seen a landmark by bearings alone, which do not determine it by themselves.
#include <cmath>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/plugin/registry.hpp"
#include "sparsify/sparsifier/world.hpp"

namespace cairn::sparsify {
namespace {

/// A robot drives 8 m along x. Of a landmark 30 m ahead it measures bearings, and two poses that it
/// reaches later see it from the side: those locate it.
class SeenByBearings : public testing::Test {
 protected:
  static constexpr Id kLandmark = 100;
  static constexpr double kX = 30.0, kY = 1.0;

  SeenByBearings() {
    for (Id id = 0; id < 9; ++id) pose(id, static_cast<double>(id), 0.0);
    pose(10, 20.0, 10.0);
    pose(11, 30.0, -10.0);
    graph().add_variable(registry_.variable_type("VERTEX_XY"), kLandmark, std::vector{kX, kY});
    for (Id id = 0; id < 8; ++id) relate(id, id + 1);
    relate(8, 10);
    relate(10, 11);
    see(10, 0.0);
    see(11, 0.0);
  }
  Graph& graph() { return world_.graph; }
  void pose(Id id, double x, double y) {
    graph().add_variable(registry_.variable_type("VERTEX_SE2"), id, std::vector{x, y, 0.0});
  }
  void relate(Id a, Id b) {
    const auto x = graph().state(world_.index(a)), y = graph().state(world_.index(b));
    const std::vector<double> z{y[0] - x[0], y[1] - x[1], 0.0};
    graph().add_factor(registry_.factor_type("EDGE_SE2"),
                       std::vector{world_.index(a), world_.index(b)}, z,
                       std::vector{1e4, 0.0, 0.0, 1e4, 0.0, 1e6});
  }
  /// A bearing with a standard deviation of 0.02, off by `error`.
  void see(Id id, double error) {
    const auto x = graph().state(world_.index(id));
    graph().add_factor(registry_.factor_type("EDGE_BEARING_RANGE_SE2_XY"),
                       std::vector{world_.index(id), world_.index(kLandmark)},
                       std::vector{std::atan2(kY - x[1], kX - x[0]) + error, 1.0},
                       std::vector{2500.0, 0.0, 0.0});
  }
  /// How far the factors that take the place of poses 2 to 6 put the landmark from where the graph
  /// has it.
  std::vector<double> moved() {
    const Graph rest = world_.without({2, 3, 4, 5, 6}, "sparsify:scheme=multi");
    std::vector<double> all;
    for (int f = 0; f < rest.factor_count(); ++f) {
      const Factor factor = rest.factor(f);
      if (factor.variables.size() != 2 || factor.variables[1] != kLandmark ||
          factor.variables[0] >= 10)
        continue;
      const double bearing = factor.measurement[0], range = factor.measurement[1],
                   x = static_cast<double>(factor.variables[0]);
      all.push_back(std::hypot(x + range * std::cos(bearing) - kX, range * std::sin(bearing) - kY));
    }
    return all;
  }

  World world_{2, 1};
  Registry registry_;
};

// The bearings turn by less than they would for a landmark at any distance: the minimum of what
// the five poses measured has it at infinity.
TEST_F(SeenByBearings, ALandmarkStaysThoughTheBearingsThatLeaveMeetNowhere) {
  for (Id id = 2; id < 7; ++id) see(id, 0.01 * (4.0 - static_cast<double>(id)));
  const std::vector<double> all = moved();
  EXPECT_FALSE(all.empty());
  for (const double distance : all) EXPECT_LT(distance, 3.0);
}

}  // namespace
}  // namespace cairn::sparsify
