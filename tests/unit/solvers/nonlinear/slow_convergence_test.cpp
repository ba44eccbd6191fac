// SPDX-License-Identifier: BSD-3-Clause
// Graphs in which Gauss-Newton's steps converge linearly, since residuals are large at the minimum.
#include <array>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/lie/so3.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/optimizer.hpp"
#include "support/components.hpp"
#include "support/sampling.hpp"

namespace cairn::test {
namespace {

constexpr std::size_t kOdometry = 15;
/// A straight drive of 16 poses, and two loop closures (12 to 1, 14 to 3) that are false.
constexpr std::array<std::array<double, 7>, kOdometry> kDrive{
    {{0.98620, 0.10137, 0.13521, 0.04200, 0.07086, -0.10184, 0.99138},
     {1.05513, 0.01787, -0.10739, 0.02613, 0.05984, 0.01159, 0.99780},
     {1.12716, 0.12924, 0.17988, -0.03385, 0.01518, -0.02320, 0.99904},
     {0.91837, 0.00813, 0.02814, -0.00104, 0.05531, -0.03621, 0.99781},
     {0.91378, 0.12084, 0.03945, -0.06386, -0.06912, 0.01418, 0.99546},
     {0.98470, 0.10856, -0.05259, 0.01228, 0.00834, 0.03581, 0.99925},
     {1.00359, -0.08623, 0.20019, -0.00900, -0.02721, 0.02390, 0.99930},
     {1.17477, -0.01484, 0.07032, -0.01455, -0.00465, 0.01577, 0.99976},
     {1.10206, -0.02400, -0.00154, 0.00395, -0.05851, 0.03166, 0.99778},
     {1.06259, -0.04696, 0.02920, -0.05998, -0.06084, -0.01564, 0.99622},
     {1.14479, -0.12460, 0.07441, 0.03870, 0.00383, 0.02297, 0.99898},
     {0.94567, -0.10773, -0.00618, -0.07531, 0.01725, 0.00811, 0.99698},
     {1.05455, -0.10359, -0.03042, -0.01641, 0.00390, -0.03630, 0.99920},
     {0.95860, 0.11825, -0.06583, -0.01566, 0.05066, -0.05976, 0.99680},
     {1.08348, -0.09204, 0.01909, -0.04956, 0.01131, -0.01160, 0.99864}}};
constexpr std::array<double, 7> kFalseLoop{1.03, 0.01, 0.03, -0.0078, -0.0283, -0.0042, 0.99956};
constexpr double kMinimum = 35.889830446;

class SlowConvergence : public testing::Test {
 protected:
  void SetUp() override {
    if (!registry.has("factor", "EDGE_SE3:QUAT")) GTEST_SKIP() << "there are no types slam3d";
    registry.set_type_options(parse_component("slam3d:metric=logarithm"));
    pose = registry.variable_type("VERTEX_SE3:QUAT");
    relative = registry.factor_type("EDGE_SE3:QUAT");
  }
  /// Begins where the odometry says.
  void drive(Graph& graph, const std::vector<std::vector<double>>& odometry) {
    graph.add(Variable{pose, 0, {0, 0, 0, 0, 0, 0, 1}, true});
    for (std::size_t k = 0; k < odometry.size(); ++k) {
      std::vector<double> z = odometry[k], next(7);
      ASSERT_EQ(relative->normalize(z.data()), "");
      const double* const x[] = {graph.state(static_cast<int>(k)).data(), nullptr};
      ASSERT_TRUE(relative->propagate(1, x, z.data(), next.data()));
      const auto id = static_cast<Id>(k);
      graph.add(Variable{pose, id + 1, next});
      graph.add(Factor{relative, {id, id + 1}, z, kInformation});
    }
  }
  void close(Graph& graph, Id from, Id to, std::vector<double> z) {
    ASSERT_EQ(relative->normalize(z.data()), "");
    graph.add(Factor{relative, {from, to}, std::move(z), kInformation});
  }
  /// 12 to 40 poses with odometry that turns at random, and one to three false loop closures.
  Graph random_drive(std::uint64_t seed) {
    Sampler sampler(seed);
    const int poses = 12 + static_cast<int>(seed * 7 % 29);
    std::vector<std::vector<double>> odometry;
    const auto measured = [&](double turn) {
      std::vector<double> z = sampler.vector(3, 0.15);
      z[0] += 1.0;
      const std::vector<double> w = sampler.vector(3, turn);
      for (const double half : w) z.push_back(0.5 * half);
      z.push_back(1.0);
      return z;
    };
    for (int k = 1; k < poses; ++k) odometry.push_back(measured(0.3));
    Graph graph;
    drive(graph, odometry);
    for (std::uint64_t k = 0; k < 1 + seed % 3; ++k) {
      const auto from = static_cast<Id>(sampler.uniform(poses / 2.0, poses));
      const auto to = static_cast<Id>(sampler.uniform(0.0, poses / 3.0));
      close(graph, from, to, measured(0.1));
    }
    return graph;
  }

  const std::vector<double> kInformation{2.5, 0, 0, 0, 0,  0, 2.5, 0,  0, 0, 0,
                                         2.5, 0, 0, 0, 10, 0, 0,   10, 0, 10};
  Registry registry;
  std::shared_ptr<const VariableType> pose;
  std::shared_ptr<const FactorType> relative;
};

// 390 iterations without acceleration, or more than 200 from here.
TEST_F(SlowConvergence, EndsSoonBesideFalseLoopClosures) {
  std::vector<std::vector<double>> odometry;
  for (const auto& z : kDrive) odometry.emplace_back(z.begin(), z.end());
  for (const char* name : {"levenberg_marquardt", "gauss_newton", "dogleg"}) {
    if (!registry.has("optimizer", name)) continue;
    Graph graph;
    drive(graph, odometry);
    for (const auto& [from, to] : {std::pair{12, 1}, std::pair{14, 3}})
      close(graph, from, to, {kFalseLoop.begin(), kFalseLoop.end()});
    const Summary summary =
        registry.make<Optimizer>(with_some_linear_solver(name))->optimize(graph);
    EXPECT_EQ(summary.status, Status::converged) << name;
    EXPECT_NEAR(summary.final_chi2, kMinimum, 1e-7 * kMinimum) << name;
    EXPECT_LT(summary.iterations.size(), 60U) << name;
  }
}

// As many without acceleration: up to 490.
TEST_F(SlowConvergence, EndsAtMinimaOfRandomDrives) {
  for (const char* name : {"levenberg_marquardt", "dogleg"}) {
    if (!registry.has("optimizer", name)) continue;
    const auto optimizer = registry.make<Optimizer>(with_some_linear_solver(name));
    for (std::uint64_t seed = 0; seed < 40; ++seed) {
      Graph graph = random_drive(seed);
      const Summary summary = optimizer->optimize(graph, {.max_iterations = 2000});
      EXPECT_EQ(summary.status, Status::converged) << name << ' ' << seed;
      EXPECT_LT(summary.iterations.size(), 100U) << name << ' ' << seed;
      // No step of Gauss-Newton's own leads lower from there.
      const Summary again = optimizer->optimize(graph, {.max_iterations = 20, .tolerance = 0.0});
      EXPECT_NEAR(again.final_chi2, summary.final_chi2, 1e-8 * summary.final_chi2)
          << name << ' ' << seed;
    }
  }
}

}  // namespace
}  // namespace cairn::test
