// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/arrival_order.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/planar_graph.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

const std::vector<double> kUnit3 = {1, 0, 0, 1, 0, 1}, kUnit2 = {1, 0, 1};

class ArrivalOrder : public ::testing::Test {
 protected:
  int pose(Id id) { return graph_.add_variable(types_.pose, id, std::array{0.0, 0.0, 0.0}); }
  int point(Id id) { return graph_.add_variable(types_.point, id, std::array{0.0, 0.0}); }
  int between(int a, int b) {
    return graph_.add_factor(types_.relative_pose, std::array{a, b}, std::array{1.0, 0.0, 0.0},
                             kUnit3);
  }
  int seen(int pose, int point) {
    return graph_.add_factor(types_.point_seen, std::array{pose, point}, std::array{1.0, 0.0},
                             kUnit2);
  }
  test::PlanarTypes types_;
  Graph graph_;
};

TEST_F(ArrivalOrder, APoseComesWithWhatItSeesFirst) {
  const int l = point(100);
  const int a = pose(1), b = pose(2), c = pose(3);
  const int ab = between(a, b), bl = seen(b, l), bc = between(b, c), cl = seen(c, l),
            ac = between(a, c);
  const std::vector<Arrival> order = arrival_order(graph_);
  ASSERT_THAT(order, SizeIs(3));
  EXPECT_THAT(order[0].variables, ElementsAre(a));
  EXPECT_THAT(order[0].factors, IsEmpty());
  EXPECT_THAT(order[1].variables, ElementsAre(b, l));
  EXPECT_THAT(order[1].factors, ElementsAre(ab, bl));
  EXPECT_THAT(order[2].variables, ElementsAre(c));
  EXPECT_THAT(order[2].factors, ElementsAre(bc, cl, ac));
  EXPECT_TRUE(in_arrival_order(order));
}

TEST_F(ArrivalOrder, PosesComeByIdWhateverTheOrderOfTheFile) {
  const int c = pose(30), a = pose(10), b = pose(20);
  const int bc = between(b, c), ab = between(a, b);
  const std::vector<Arrival> order = arrival_order(graph_);
  ASSERT_THAT(order, SizeIs(3));
  EXPECT_THAT(order[0].variables, ElementsAre(a));
  EXPECT_THAT(order[1].factors, ElementsAre(ab));
  EXPECT_THAT(order[2].factors, ElementsAre(bc));
  EXPECT_FALSE(in_arrival_order(order));
}

TEST_F(ArrivalOrder, HasEveryVariableAndFactorOnce) {
  graph_ = test::random_graph(types_, 20, 9, 3);
  const int lonely = point(1000);
  const int prior =
      graph_.add_factor(types_.point_prior, std::array{lonely}, std::array{0.0, 0.0}, kUnit2);
  std::vector<int> variables(static_cast<std::size_t>(graph_.variable_count()), 0),
      factors(static_cast<std::size_t>(graph_.factor_count()), 0), step(variables.size());
  const std::vector<Arrival> order = arrival_order(graph_);
  for (std::size_t k = 0; k < order.size(); ++k) {
    for (const int v : order[k].variables) {
      ++variables[v];
      step[v] = static_cast<int>(k);
    }
    for (const int f : order[k].factors) {
      ++factors[f];
      for (const std::int32_t v : graph_.factor_variables(f)) {
        EXPECT_EQ(variables[v], 1) << graph_.describe_factor(f);  // it is there
      }
    }
  }
  EXPECT_THAT(variables, ::testing::Each(1));
  EXPECT_THAT(factors, ::testing::Each(1));
  EXPECT_EQ(step[lonely], 19);
  EXPECT_EQ(order.back().factors.back(), prior);
}

}  // namespace
}  // namespace cairn
