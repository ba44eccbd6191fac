// SPDX-License-Identifier: BSD-3-Clause
// What is particular to the generator of cameras and points.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <set>

#include "cairn/io/format.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/optimizer.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

class BundleGenerator : public testing::TestWithParam<const char*> {
 protected:
  Simulation simulate(const std::string& options = "") {
    const std::string spec = "bundle:layout=" + std::string(GetParam()) + options;
    return registry.make<Generator>(spec)->generate(registry, 7);
  }
  Registry registry;
};
INSTANTIATE_TEST_SUITE_P(Layouts, BundleGenerator, testing::Values("ring", "street"));

TEST_P(BundleGenerator, MakesTheCamerasAndPointsAskedFor) {
  const Graph graph = simulate(",cameras=20,points=500,track=4").graph;
  ASSERT_EQ(graph.variable_count(), 520);
  EXPECT_EQ(graph.describe_variable(19), "VERTEX_CAMERA_BAL 19");
  EXPECT_EQ(graph.describe_variable(20), "VERTEX_TRACKXYZ 20");
  std::map<int, std::set<int>> cameras_of;
  for (int f = 0; f < graph.factor_count(); ++f) {
    const auto ends = graph.factor_variables(f);
    EXPECT_TRUE(cameras_of[ends[1]].insert(ends[0]).second) << "a camera sees a point once";
  }
  ASSERT_EQ(cameras_of.size(), 500u);
  std::size_t longest = 0;
  for (const auto& [point, cameras] : cameras_of) {
    EXPECT_GE(cameras.size(), 2u);
    longest = std::max(longest, cameras.size());
  }
  EXPECT_EQ(longest, 4u);
}

// Along a street only neighbours share points; around a thing also those on its other side.
TEST_P(BundleGenerator, TiesNeighboursOrEverybody) {
  const Graph graph = simulate(",cameras=80").graph;
  std::map<int, std::pair<int, int>> range;  // point → first and last camera that see it
  for (int f = 0; f < graph.factor_count(); ++f) {
    const auto ends = graph.factor_variables(f);
    const auto [at, added] = range.try_emplace(ends[1], ends[0], ends[0]);
    at->second.first = std::min(at->second.first, ends[0]);
    at->second.second = std::max(at->second.second, ends[0]);
  }
  int widest = 0;
  for (const auto& [point, cameras] : range) {
    widest = std::max(widest, cameras.second - cameras.first);
  }
  if (GetParam() == std::string("street")) {
    EXPECT_LT(widest, 45);
  } else {
    EXPECT_GT(widest, 45);
  }
}

TEST_P(BundleGenerator, ShowsEveryPointInFrontOfItsCameraAndWithinItsImage) {
  const Graph truth = simulate(",noise=0").truth;
  for (int f = 0; f < truth.factor_count(); ++f) {
    const auto ends = truth.factor_variables(f);
    std::array<double, 9> R;
    std::array<double, 3> t;
    truth.type(ends[0]).placement()->split(truth.state(ends[0]).data(), R.data(), t.data());
    const auto X = truth.state(ends[1]);
    double depth = 0.0;  // along the camera's −z axis, the last column of R
    for (int k = 0; k < 3; ++k) depth -= R[6 + k] * (X[k] - t[k]);
    EXPECT_GE(depth, 2.0 - 1e-9);
    EXPECT_LE(depth, 30.0 + 1e-9);
    const auto pixel = truth.measurement(f);
    EXPECT_LE(std::abs(pixel[0]), 600.0);
    EXPECT_LE(std::abs(pixel[1]), 450.0);
  }
}

// All seven freedoms of the gauge are free, so chi2 has that many degrees of freedom more.
TEST_P(BundleGenerator, LeavesTheChi2OfItsNoiseAtTheMinimum) {
  Graph graph = simulate(",cameras=20,points=500").graph;
  const double initial = chi2(graph);
  const Summary summary = registry.make<Optimizer>("levenberg_marquardt")->optimize(graph);
  EXPECT_EQ(summary.status, Status::converged);
  const auto n = static_cast<double>(graph.residual_size() - graph.tangent_size() + 7);
  EXPECT_NEAR(summary.final_chi2, n, 4.0 * std::sqrt(2.0 * n));
  EXPECT_GT(initial, 20.0 * summary.final_chi2);
}

TEST_P(BundleGenerator, CanBeWrittenAsBalAndReadBack) {
  const Graph graph = simulate(",cameras=12,points=300").graph;
  const auto bal = registry.make<Format>("bal");
  ReadReport report;
  const Graph again = bal->read(bal->write(graph), "file", registry, {}, report);
  ASSERT_EQ(again.factor_count(), graph.factor_count());
  for (int f = 0; f < graph.factor_count(); ++f) {
    EXPECT_EQ(again.describe_factor(f), graph.describe_factor(f));
  }
  EXPECT_NEAR(chi2(again) / chi2(graph), 1.0, 1e-11);
  EXPECT_TRUE(report.notes.empty()) << "no point is behind a camera";
}

TEST_P(BundleGenerator, RefusesWorldsThatAreTooPoor) {
  try {
    simulate(",cameras=50,points=20");
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::usage);
    EXPECT_THAT(error.what(), HasSubstr("ask for more points"));
  }
}

}  // namespace
}  // namespace cairn
