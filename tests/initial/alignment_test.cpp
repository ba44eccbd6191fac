// SPDX-License-Identifier: BSD-3-Clause
// Where absolute positions are measured, starts are there.
#include <array>
#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "cairn/geometry/pose.hpp"
#include "cairn/graph/packed.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/initial_guess.hpp"

namespace cairn {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// A chain of exact odometry that begins at the origin, while the truth is far away and turned.
class Alignment : public testing::TestWithParam<const char*> {
 protected:
  static constexpr int kPoses = 40;

  void SetUp() override {
    if (!registry.has("initial_guess", "auto") || !registry.has("types", "slam2d") ||
        !registry.has("types", "slam3d"))
      GTEST_SKIP() << "without starts or types";
  }
  void make(bool space) {
    dimension = space ? 3 : 2;
    pose = registry.variable_type(space ? "VERTEX_SE3:QUAT" : "VERTEX_SE2");
    std::mt19937_64 random(space ? 3 : 2);
    std::uniform_real_distribution<double> number(-0.5, 0.5);
    Pose truth;
    truth.t = Vector3d(4e5, -2e5, space ? 300.0 : 0.0);
    truth.R = turn(2.3, space ? Vector3d(0.6, 0.0, 0.8) : Vector3d::UnitZ());
    const auto edge = registry.factor_type(space ? "EDGE_SE3:QUAT" : "EDGE_SE2");
    const int n = edge->residual_size();
    Pose here;
    for (int v = 0; v < kPoses; ++v) {
      truths.push_back(truth);
      graph.add_variable(pose, v, state(v == 0 ? Pose() : here));
      const Pose step{turn(number(random), space ? Vector3d(number(random), number(random), 1.0)
                                                 : Vector3d::UnitZ()),
                      Vector3d(1.0 + number(random), 0.0, space ? number(random) : 0.0)};
      if (v + 1 < kPoses) odometry.push_back(state(step));
      truth = {truth.R * step.R, truth.R * step.t + truth.t};
    }
    for (int v = 1; v < kPoses; ++v) {
      graph.add_factor(edge, std::array{v - 1, v}, odometry[static_cast<std::size_t>(v - 1)],
                       pack(Eigen::MatrixXd::Identity(n, n)));
    }
  }
  static Matrix3d turn(double angle, const Vector3d& axis) {
    return Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
  }
  std::vector<double> state(const Pose& at) const {
    if (dimension == 2) return {at.t.x(), at.t.y(), std::atan2(at.R(1, 0), at.R(0, 0))};
    const Eigen::Quaterniond q(at.R);
    return {at.t.x(), at.t.y(), at.t.z(), q.x(), q.y(), q.z(), q.w()};
  }
  /// The directions of the world that are marked alone.
  void fix(int v, const Vector3d& marked) {
    const auto type =
        registry.factor_type(dimension == 2 ? "EDGE_PRIOR_SE2_XY" : "EDGE_SE3_PRIORXYZ");
    const Vector3d t = truths[static_cast<std::size_t>(v)].t;
    const Eigen::MatrixXd information = marked.head(dimension).asDiagonal();
    graph.add_factor(type, std::array{v}, std::vector<double>(t.data(), t.data() + dimension),
                     pack(information));
  }
  void start() { registry.make<InitialGuess>(GetParam())->compute(graph); }
  Pose at(int v) const { return pose_of(*pose, graph.state(v)); }

  Registry registry;
  Graph graph;
  int dimension = 0;
  std::shared_ptr<const VariableType> pose;
  std::vector<Pose> truths;
  std::vector<std::vector<double>> odometry;
};

TEST_P(Alignment, PutsAMapWhereItsPositionsWereMeasured) {
  for (const bool space : {false, true}) {
    graph = Graph();
    truths.clear();
    odometry.clear();
    make(space);
    for (const int v : {0, 9, 20, 31, 39}) fix(v, Vector3d::Ones());
    start();
    EXPECT_LT(chi2(graph), 1e-10) << (space ? "space" : "plane");
    for (int v = 0; v < kPoses; ++v) {
      EXPECT_LT((at(v).t - truths[static_cast<std::size_t>(v)].t).norm(), 1e-5) << v;
      EXPECT_LT((at(v).R - truths[static_cast<std::size_t>(v)].R).norm(), 1e-6) << v;
    }
  }
}

TEST_P(Alignment, OnePositionShiftsAMap) {
  make(true);
  const Pose before = at(0);
  fix(20, Vector3d::Ones());
  start();
  EXPECT_LT(chi2(graph), 1e-10);
  EXPECT_LT((at(20).t - truths[20].t).norm(), 1e-6);
  EXPECT_LT((at(0).R - before.R).norm(), 1e-9) << "no measurement turns it";
}

TEST_P(Alignment, OneAltitudeLiftsAMap) {
  make(true);
  const Pose before = at(0);
  fix(20, Vector3d::UnitZ());
  start();
  EXPECT_NEAR(at(20).t.z(), truths[20].t.z(), 1e-6);
  EXPECT_LT((at(0).R - before.R).norm(), 1e-9);
  EXPECT_LT((at(0).t - before.t).head<2>().norm(), 1e-9);
}

TEST_P(Alignment, AConstantPoseStays) {
  make(true);
  graph.set_fixed(0, true);
  const Pose before = at(0);
  for (const int v : {9, 20, 31}) fix(v, Vector3d::Ones());
  start();
  EXPECT_EQ(at(0).t, before.t);
  EXPECT_EQ(at(0).R, before.R);
}

INSTANTIATE_TEST_SUITE_P(Starts, Alignment,
                         testing::Values("chordal", "spanning_tree", "odometry", "auto"));

}  // namespace
}  // namespace cairn
