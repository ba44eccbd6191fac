// SPDX-License-Identifier: BSD-3-Clause
// Poses that leave have seen landmarks by bearings alone, which those nearby do not determine.
#include <cmath>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/plugin/registry.hpp"
#include "unit/plugins/sparsify/world.hpp"

namespace cairn::sparsify {
namespace {

/// A robot that drives along x, and a landmark that other poses have located, 30 m ahead.
class SeenByBearings : public testing::Test {
 protected:
  static constexpr Id kLandmark = 100;

  SeenByBearings() {
    for (Id id = 0; id < 6; ++id) pose(id, static_cast<double>(id), 0.0);
    pose(10, 20.0, 10.0);
    pose(11, 30.0, -10.0);
    graph().add_variable(point_, kLandmark, std::vector{30.0, 1.0});
    for (Id id = 0; id < 5; ++id) relate(id, id + 1);
    relate(5, 10);
    relate(10, 11);
  }
  Graph& graph() { return world_.graph; }
  void pose(Id id, double x, double y) { graph().add_variable(pose_, id, std::vector{x, y, 0.0}); }
  void relate(Id a, Id b) {
    const auto x = graph().state(world_.index(a)), y = graph().state(world_.index(b));
    const std::vector<double> z{y[0] - x[0], y[1] - x[1], 0.0};
    const double w = 400.0;
    graph().add_factor(relative_, std::vector{world_.index(a), world_.index(b)}, z,
                       std::vector{w, 0.0, 0.0, w, 0.0, 10.0 * w});
  }
  void see(Id id, double error) {
    const auto x = graph().state(world_.index(id));
    graph().add_factor(bearing_range_, std::vector{world_.index(id), world_.index(kLandmark)},
                       std::vector{std::atan2(1.0 - x[1], 30.0 - x[0]) + error, 1.0},
                       std::vector{2500.0, 0.0, 0.0});
  }
  /// What the factors on the landmark measure once pose 2 has left.
  std::vector<double> ranges() {
    const Graph rest = world_.without({2});
    std::vector<double> all;
    for (int f = 0; f < rest.factor_count(); ++f) {
      const Factor factor = rest.factor(f);
      if (factor.type->tag() == bearing_range_->tag() &&
          (factor.variables.front() < 6 || factor.variables.back() < 6))
        all.push_back(factor.measurement[1]);
    }
    return all;
  }

  World world_{2, 1};
  Registry registry_;
  std::shared_ptr<const VariableType> pose_ = registry_.variable_type("VERTEX_SE2"),
                                      point_ = registry_.variable_type("VERTEX_XY");
  std::shared_ptr<const FactorType> relative_ = registry_.factor_type("EDGE_SE2"),
                                    bearing_range_ =
                                        registry_.factor_type("EDGE_BEARING_RANGE_SE2_XY");
};

// Three bearings from a metre apart meet anywhere, or nowhere; where the landmark is the graph
// knows.
TEST_F(SeenByBearings, LandmarksStayWhereTheGraphHasThem) {
  see(1, 0.04);
  see(2, 0.0);
  see(3, -0.04);
  see(10, 0.0);
  see(11, 0.0);
  const std::vector<double> all = ranges();
  EXPECT_FALSE(all.empty());
  for (const double range : all) {
    EXPECT_GT(range, 15.0);
    EXPECT_LT(range, 45.0);
  }
}

}  // namespace
}  // namespace cairn::sparsify
