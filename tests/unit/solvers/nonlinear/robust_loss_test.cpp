// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/plugin/registry.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/types/loss.hpp"
#include "support/components.hpp"
#include "support/sample_graphs.hpp"

namespace cairn::test {
namespace {

std::vector<std::string> registered_losses() { return Registry().names("loss"); }

class RobustLossTest : public testing::TestWithParam<std::string> {
 protected:
  Graph graph(const FactorSelector& scope) {
    Graph graph = ring_of_poses(40, 0.03, 3);
    graph.set_loss(registry_.make<Loss>(GetParam()), scope);
    return graph;
  }
  Registry registry_;
};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(RobustLossTest);
INSTANTIATE_TEST_SUITE_P(Registered, RobustLossTest, testing::ValuesIn(registered_losses()),
                         test_name);

TEST_P(RobustLossTest, EveryOptimizerReachesTheSameMinimum) {
  for (const FactorSelector& scope : {FactorSelector::all(), FactorSelector::loops()}) {
    double expected = -1.0;
    for (const char* name : {"levenberg_marquardt", "dogleg", "ceres"}) {
      if (!registry_.has("optimizer", name)) continue;
      Graph robust = graph(scope);
      const Summary summary = registry_.make<Optimizer>(with_some_linear_solver(name))
                                  ->optimize(robust, Stop{.max_iterations = 500});
      EXPECT_EQ(summary.status, Status::converged) << name;
      EXPECT_NEAR(chi2_of(robust), summary.final_chi2, 1e-12 * summary.final_chi2) << name;
      if (expected < 0.0) expected = summary.final_chi2;
      EXPECT_NEAR(summary.final_chi2, expected, 1e-8 * expected) << name;
    }
  }
}

/// A loss that is not convex has several minima, and far from them neither slope nor curvature; so
/// from somewhere near to one.
TEST_P(RobustLossTest, ALineSearchReturnsToTheMinimum) {
  CAIRN_NEEDS("optimizer", "ceres_line_search");
  CAIRN_NEEDS("optimizer", "levenberg_marquardt");
  Graph robust = graph(FactorSelector::all());
  const auto reference = registry_.make<Optimizer>(with_some_linear_solver("levenberg_marquardt"));
  const Stop exactly{.max_iterations = 500, .tolerance = 1e-14};
  const double minimum = reference->optimize(robust, exactly).final_chi2;
  for (int v = 0; v < robust.variable_count(); ++v) {
    const std::span<const double> x = robust.state(v);
    std::vector<double> moved(x.begin(), x.end());
    const double delta[] = {0.01 * std::sin(v), 0.01 * std::cos(3.0 * v),
                            0.003 * std::sin(2.0 * v)};
    const std::int64_t offset = 0;
    robust.type(v).retract(1, x.data(), &offset, delta, moved.data());
    robust.set_state(v, moved);
  }
  EXPECT_GT(chi2_of(robust), 1.01 * minimum);
  const Summary back = registry_.make<Optimizer>("ceres_line_search")
                           ->optimize(robust, Stop{.max_iterations = 20000});
  EXPECT_EQ(back.status, Status::converged) << testing::PrintToString(back.notes);
  EXPECT_NEAR(back.final_chi2, minimum, 1e-8 * minimum);
}

/// Where all weights are zero there is neither slope nor curvature: no minimum.
TEST(LineSearch, SaysWhereARobustLossHoldsNothing) {
  CAIRN_NEEDS("optimizer", "ceres_line_search");
  CAIRN_NEEDS("loss", "tukey");
  Registry registry;
  Graph graph = ring_of_poses(10, 0.01);
  for (int v = 1; v < graph.variable_count(); ++v) {
    std::vector<double> x(graph.state(v).begin(), graph.state(v).end());
    x[0] += 1e4 * v;
    graph.set_state(v, x);
  }
  graph.set_loss(registry.make<Loss>("tukey"), FactorSelector::all());
  const Summary summary =
      registry.make<Optimizer>("ceres_line_search")->optimize(graph, Stop{.max_iterations = 50});
  EXPECT_EQ(summary.status, Status::not_positive_definite);
  EXPECT_THAT(summary.notes, testing::Contains(testing::HasSubstr("robust loss")));
}

TEST_P(RobustLossTest, WeighsOutliersDown) {
  if (!registry_.has("optimizer", "levenberg_marquardt")) GTEST_SKIP();
  Graph plain = ring_of_poses(40, 0.03, 3), robust = graph(FactorSelector::loops());
  const auto optimizer = registry_.make<Optimizer>(with_some_linear_solver("levenberg_marquardt"));
  optimizer->optimize(plain);
  optimizer->optimize(robust);
  // What the robust estimate says of the odometry, which is all good: its residuals must be
  // smaller.
  const auto odometry = [](const Graph& g) {
    const std::vector<double> norms = squared_norms(g);
    const std::vector<bool> closes_loop = loop_closures(g);
    double sum = 0.0;
    for (int k = 0; k < g.factor_count(); ++k) sum += closes_loop[k] ? 0.0 : norms[k];
    return sum;
  };
  EXPECT_LT(odometry(robust), odometry(plain));
}

}  // namespace
}  // namespace cairn::test
