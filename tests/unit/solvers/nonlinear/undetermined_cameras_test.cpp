// SPDX-License-Identifier: BSD-3-Clause
// Bundle adjustment that does not determine all of its points and cameras.
#include <functional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "cairn/graph/free_directions.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/optimizer.hpp"
#include "support/components.hpp"
#include "support/sampling.hpp"

namespace cairn::test {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr int kCameras = 4, kPoints = 20;

struct World {
  std::function<bool(int camera, int point)> sees = [](int, int) { return true; };
  double spacing = 1.0;  ///< of the cameras
  double unit = 1.0;     ///< of lengths, in metres
};

class UndeterminedCameras : public testing::Test {
 protected:
  void SetUp() override {
    if (!registry.has("variable", "VERTEX_CAMERA_BAL") ||
        !registry.has("variable", "VERTEX_TRACKXYZ"))
      GTEST_SKIP() << "the types are not there";
  }

  /// Cameras in a row that look along −z, each turned a little more than the one before.
  Graph problem(const World& world) {
    Sampler sampler(7);
    Graph graph;
    std::vector<Eigen::Isometry3d> poses;
    for (int k = 0; k < kCameras; ++k) {
      Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
      pose.rotate(Eigen::AngleAxisd(0.1 * k, Eigen::Vector3d(0.2, 1.0, 0.1).normalized()));
      pose.translation() = Eigen::Vector3d(world.spacing * k, 0.0, 0.1 * world.spacing * k);
      poses.push_back(pose);
      const Eigen::Quaterniond q(pose.linear());
      const Eigen::Vector3d t = pose.translation() / world.unit;
      graph.add(Variable{registry.variable_type("VERTEX_CAMERA_BAL"),
                         k,
                         {500.0, 0.01, -0.01, t[0], t[1], t[2], q.x(), q.y(), q.z(), q.w()}});
    }
    std::vector<Factor> images;
    for (int p = 0; p < kPoints; ++p) {
      const Eigen::Vector3d X(sampler.uniform(-2.0, 5.0), sampler.uniform(-3.0, 3.0),
                              sampler.uniform(-9.0, -5.0));
      graph.add(Variable{registry.variable_type("VERTEX_TRACKXYZ"),
                         kCameras + p,
                         {X[0] / world.unit, X[1] / world.unit, X[2] / world.unit}});
      for (int k = 0; k < kCameras; ++k) {
        const Eigen::Vector3d P = poses[static_cast<std::size_t>(k)].inverse() * X;
        const Eigen::Vector2d at = -P.head<2>() / P[2];
        const double n = at.squaredNorm();
        const Eigen::Vector2d z = 500.0 * (1.0 + n * (0.01 - n * 0.01)) * at;
        if (!world.sees(k, p)) continue;
        images.push_back({registry.factor_type("EDGE_PROJECT_BAL"),
                          {k, kCameras + p},
                          {z[0] + sampler.uniform(-0.5, 0.5), z[1] + sampler.uniform(-0.5, 0.5)},
                          {1.0, 0.0, 1.0}});
      }
    }
    for (const Factor& image : images) graph.add(image);
    return graph;
  }

  std::string free(const World& world) {
    const Graph graph = problem(world);
    return find_free_directions(graph).describe(graph);
  }

  Registry registry;
};

bool point_7_by_camera_2_alone(int camera, int point) { return point != 7 || camera == 2; }
bool camera_3_sees_two(int camera, int point) { return camera != 3 || point < 2; }

TEST_F(UndeterminedCameras, AreNamed) {
  EXPECT_EQ(free({}), "");
  EXPECT_EQ(free({.sees = point_7_by_camera_2_alone}),
            "VERTEX_TRACKXYZ 11 is free along its bearing from VERTEX_CAMERA_BAL 2; it stays at "
            "the initial estimate");
  EXPECT_EQ(free({.sees = camera_3_sees_two}),
            "VERTEX_CAMERA_BAL 3 is free in 5 of its 9 directions; it stays at the initial "
            "estimate");
  EXPECT_EQ(free({.sees =
                      [](int camera, int point) {
                        return point_7_by_camera_2_alone(camera, point) &&
                               camera_3_sees_two(camera, point);
                      }}),
            "VERTEX_CAMERA_BAL 3 is free in 5 of its 9 directions, VERTEX_TRACKXYZ 11 is free "
            "along its bearing from VERTEX_CAMERA_BAL 2; they stay at the initial estimate");
}

// As many images as usual, of which none tells how far the points are.
TEST_F(UndeterminedCameras, AreNamedWhereAllAreAtOnePlace) {
  const Graph graph = problem({.spacing = 0.0});
  const FreeDirections free = find_free_directions(graph);
  EXPECT_THAT(free.directions, SizeIs(kPoints));
  EXPECT_THAT(free.describe(graph), HasSubstr("VERTEX_TRACKXYZ 4 is free along its bearing from "
                                              "VERTEX_CAMERA_BAL 0"));
  EXPECT_EQ(this->free({.spacing = 1e-4}), "");
}

// What is free does not hang on the unit of lengths, nor on the information.
TEST_F(UndeterminedCameras, AreTheSameInAnyUnit) {
  for (const double unit : {1e-9, 1e-3, 1e6}) {
    EXPECT_EQ(free({.unit = unit}), "") << unit;
    EXPECT_THAT(free({.sees = point_7_by_camera_2_alone, .unit = unit}),
                HasSubstr("VERTEX_TRACKXYZ 11 is free along its bearing from VERTEX_CAMERA_BAL 2"))
        << unit;
    EXPECT_THAT(free({.sees = camera_3_sees_two, .unit = unit}), HasSubstr("in 5 of its 9"))
        << unit;
  }
  Graph weak = problem({.sees = point_7_by_camera_2_alone});
  for (int f = 0; f < weak.factor_count(); f += 2)
    weak.set_measurement(f, weak.measurement(f), std::vector<double>{1e-18, 0.0, 1e-18});
  EXPECT_THAT(find_free_directions(weak).directions, SizeIs(1));
}

TEST_F(UndeterminedCameras, AreNamedByEveryOptimizer) {
  for (const char* name : {"levenberg_marquardt", "dogleg", "ceres:linear_solver_type=dense_schur",
                           "ceres_line_search", "gauss_newton"}) {
    if (!registry.has("optimizer", parse_component(name).name)) continue;
    const auto optimizer = registry.make<Optimizer>(with_some_linear_solver(name));
    Graph graph = problem({.sees = point_7_by_camera_2_alone});
    const Summary summary = optimizer->optimize(graph);
    EXPECT_THAT(summary.notes, Contains(HasSubstr("VERTEX_TRACKXYZ 11 is free along its bearing")))
        << name;
    EXPECT_THAT(find_free_directions(graph).directions, SizeIs(1)) << name;
  }
}

}  // namespace
}  // namespace cairn::test
