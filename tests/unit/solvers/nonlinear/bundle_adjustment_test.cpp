// SPDX-License-Identifier: BSD-3-Clause
// Bundle adjustment on the published BAL files: the gauge is free, and everybody gets to one
// minimum.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "cairn/graph/gauge.hpp"
#include "cairn/io/format.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/optimizer.hpp"
#include "support/data.hpp"

namespace cairn::test {
namespace {

using ::testing::HasSubstr;

constexpr const char* kLadybug = "ba/ladybug-problem-49-7776-pre.txt";
constexpr const char* kDubrovnik = "ba/dubrovnik-3-7-pre.txt";

class BundleAdjustment : public testing::Test {
 protected:
  void SetUp() override {
    if (!registry.has("format", "bal") || !registry.has("variable", "VERTEX_CAMERA_BAL") ||
        !registry.has("variable", "VERTEX_TRACKXYZ")) {
      GTEST_SKIP() << "the format or the types are not there";
    }
  }
  Summary optimize(Graph& graph, const std::string& optimizer, int iterations) {
    return registry.make<Optimizer>(optimizer)->optimize(graph, {.max_iterations = iterations});
  }
  Registry registry;
};

/// Σ ‖r‖² with no part of cairn's types in it: the paper's formula on the states of the graph.
double chi2_by_the_paper(const Graph& graph) {
  double sum = 0.0;
  for (int f = 0; f < graph.factor_count(); ++f) {
    const auto ends = graph.factor_variables(f);
    const auto c = graph.state(ends[0]), X = graph.state(ends[1]), z = graph.measurement(f);
    Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
    T_world_camera.translation() << c[3], c[4], c[5];
    T_world_camera.linear() = Eigen::Quaterniond(c[9], c[6], c[7], c[8]).toRotationMatrix();
    const Eigen::Vector3d P = T_world_camera.inverse() * Eigen::Vector3d(X[0], X[1], X[2]);
    const Eigen::Vector2d p = -P.head<2>() / P[2];
    const double n = p.squaredNorm();
    sum += (c[0] * (1.0 + c[1] * n + c[2] * n * n) * p - Eigen::Vector2d(z[0], z[1])).squaredNorm();
  }
  return sum;
}

TEST_F(BundleAdjustment, LeavesTheGaugeFreeUnlessTheUserHoldsACamera) {
  CAIRN_NEEDS_DATA();
  Graph graph = read_graph(data_folder() / kDubrovnik, registry);
  const Gauge gauge = resolve_gauge(graph);
  EXPECT_THAT(gauge.anchored, testing::IsEmpty());
  EXPECT_THAT(gauge.left_free, testing::ElementsAre(0));
  EXPECT_EQ(std::count(gauge.held.begin(), gauge.held.end(), true), 0);
  EXPECT_THAT(gauge.describe(graph), HasSubstr("left free"));
  graph.set_fixed(1);
  EXPECT_EQ(resolve_gauge(graph).describe(graph), "");
}

// 38 measurements of 48 unknowns: it can be fitted exactly.
TEST_F(BundleAdjustment, FitsWhatIsUndetermined) {
  CAIRN_NEEDS_DATA();
  for (const std::string name : {"levenberg_marquardt", "dogleg", "ceres"}) {
    if (!registry.has("optimizer", name)) continue;
    Graph graph = read_graph(data_folder() / kDubrovnik, registry);
    const Summary summary = optimize(graph, name, 200);
    EXPECT_NEAR(summary.initial_chi2, 5528.44, 0.001);
    EXPECT_LT(summary.final_chi2, 1e-15) << name;
    EXPECT_LT(chi2_by_the_paper(graph), 1e-15) << name;
  }
}

TEST_F(BundleAdjustment, ReachesOneMinimumWithEverySolver) {
  CAIRN_NEEDS_DATA();
  const Graph given = read_graph(data_folder() / kLadybug, registry);
  // The last of it is a long valley, points on their way to infinity: 22 iterations leave 5e-5. The
  // next minimum, with another point behind its camera, is 6e-3 above.
  constexpr double kMinimum = 26688.48;
  std::vector<std::string> specs;
  for (const char* solver : {"block_cholesky", "cholmod", "eigen", "schur"}) {
    if (!registry.has("linear_solver", solver)) continue;
    specs.push_back("levenberg_marquardt:linear_solver=" + std::string(solver));
  }
  if (registry.has("optimizer", "ceres")) {
    specs.emplace_back("ceres:linear_solver_type=dense_schur");
  }
  for (const std::string& spec : specs) {
    Graph graph = given.clone();
    const Summary summary = optimize(graph, spec, 22);
    EXPECT_NEAR(summary.initial_chi2, 1701824.92, 0.01);
    EXPECT_NEAR(summary.final_chi2, kMinimum, 1e-4 * kMinimum) << spec;
    EXPECT_NEAR(summary.final_chi2, chi2_by_the_paper(graph), 1e-9 * kMinimum) << spec;
  }
}

}  // namespace
}  // namespace cairn::test
