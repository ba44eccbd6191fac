// SPDX-License-Identifier: BSD-3-Clause
// The search without any plugin, and at sizes that the random graphs do not have.
#include "cairn/graph/free_directions.hpp"

#include <array>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/planar_graph.hpp"

namespace cairn {
namespace {

using ::testing::SizeIs;

constexpr std::array<double, 6> kWhole{100.0, 0.0, 0.0, 100.0, 0.0, 400.0};
constexpr std::array<double, 6> kNoRotation{100.0, 0.0, 0.0, 100.0, 0.0, 0.0};
constexpr std::array<double, 6> kNoPosition{0.0, 0.0, 0.0, 0.0, 0.0, 400.0};

class FreeDirectionsTest : public ::testing::Test {
 protected:
  /// Poses on a gentle curve, each measured from the one before it.
  void add_chain(int poses, int hinge = -1) {
    for (int k = 0; k < poses; ++k) {
      graph_.add_variable(types_.pose, k, std::array{double(k), 1e-3 * k * k, 2e-3 * k});
      if (k > 0) relate(k - 1, k, k == hinge ? kNoRotation : kWhole);
    }
    graph_.set_fixed(0);
  }
  void relate(int a, int b, const std::array<double, 6>& information) {
    graph_.add_factor(types_.relative_pose, std::array{a, b}, std::array{1.0, 0.0, 0.0},
                      information);
  }
  test::PlanarTypes types_;
  Graph graph_;
};

TEST_F(FreeDirectionsTest, OfALongChainAreNone) {
  add_chain(20000);  // the smallest eigenvalue of its H is far below the rounding of the largest
  const FreeDirections free = find_free_directions(graph_);
  EXPECT_TRUE(free.complete);
  EXPECT_TRUE(free.everywhere);
  EXPECT_TRUE(free.empty());
}

TEST_F(FreeDirectionsTest, OfALongChainBehindAHingeAreOne) {
  add_chain(20000, 5);
  FreeDirections free = find_free_directions(graph_);
  ASSERT_THAT(free.directions, SizeIs(1));
  EXPECT_THAT(free.directions[0].moves, SizeIs(20000 - 5));
  // One weak prior of a heading, of 1e-6 beside 400, at the far end.
  graph_.add_factor(types_.prior, std::array{19999}, std::array{0.0, 0.0, 0.0},
                    std::array{0.0, 0.0, 0.0, 0.0, 0.0, 1e-3});
  free = find_free_directions(graph_);
  EXPECT_TRUE(free.complete);
  EXPECT_TRUE(free.empty());
}

TEST_F(FreeDirectionsTest, AddUpWhatSeveralFactorsMeasureOfOneVariable) {
  add_chain(4);
  graph_.add_variable(types_.pose, 10, std::array{2.0, 2.0, 0.3});
  relate(1, 4, kNoRotation);
  EXPECT_EQ(find_free_directions(graph_).describe(graph_),
            "VERTEX_SE2 10 is free to turn; it stays at the initial estimate");
  relate(2, 4, kNoPosition);
  EXPECT_TRUE(find_free_directions(graph_).empty());
}

TEST_F(FreeDirectionsTest, OfPosesWithPriorsOfPositionsAreThoseOfAllTogether) {
  for (int k = 0; k < 30; ++k) {
    graph_.add_variable(types_.pose, k, std::array{5.0 * std::cos(k), 5.0 * std::sin(k), 0.2 * k});
    if (k > 0) relate(k - 1, k, kWhole);
  }
  const auto add_prior = [&](int k) {
    graph_.add_factor(types_.prior, std::array{k}, std::array{0.0, 0.0, 0.0}, kNoRotation);
  };
  add_prior(0);
  EXPECT_EQ(find_free_directions(graph_).describe(graph_),
            "all 30 poses can turn about pose 0; a prior or one more measurement holds them");
  add_prior(17);
  EXPECT_TRUE(find_free_directions(graph_).empty());
}

TEST_F(FreeDirectionsTest, AreGivenUpWhereAJacobianIsNotFinite) {
  add_chain(3);
  graph_.add_variable(types_.point, 10, std::array{1e300, 1e300});
  graph_.add_factor(types_.point_seen, std::array{2, 3}, std::array{1.0, 0.0},
                    std::array{1e300, 0.0, 1e300});
  const FreeDirections free = find_free_directions(graph_);
  EXPECT_TRUE(free.empty());
}

}  // namespace
}  // namespace cairn
