// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/linear/linearizer.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "cairn/graph/gauge.hpp"
#include "cairn/runtime/threads.hpp"
#include "support/block_systems.hpp"
#include "support/planar_graph.hpp"

namespace cairn {
namespace {

/// ρ(s) = c² ln(1 + s/c²)
class Cauchy final : public Loss {
 public:
  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override {
    for (std::size_t k = 0; k < s.size(); ++k) {
      if (!rho.empty()) rho[k] = kC2 * std::log1p(s[k] / kC2);
      if (!weight.empty()) weight[k] = 1.0 / (1.0 + s[k] / kC2);
    }
  }
  double second_derivative(double s) const override {
    return -1.0 / (kC2 * (1.0 + s / kC2) * (1.0 + s / kC2));
  }

 private:
  static constexpr double kC2 = 4.0;
};

/// H, g and chi2 factor by factor in dense algebra.
struct Oracle {
  Eigen::MatrixXd H;
  Eigen::VectorXd g;
  double chi2 = 0.0;

  Oracle(const Graph& graph, const Linearizer& linearizer) {
    const BlockStructure& s = linearizer.structure();
    H = Eigen::MatrixXd::Zero(s.size(), s.size());
    g = Eigen::VectorXd::Zero(s.size());
    for (int f = 0; f < graph.factor_count(); ++f) {
      const FactorRef ref = graph.ref(f);
      const FactorPool& pool = graph.factor_pools()[ref.pool];
      const int n = pool.type->residual_size(), arity = pool.type->arity();
      std::vector<const double*> x;
      std::vector<Eigen::MatrixXd> J;
      std::vector<double*> J_data;
      for (int a = 0; a < arity; ++a) {
        x.push_back(graph.state(graph.factor_variables(f)[a]).data());
        J.emplace_back(n, pool.type->tangent_size(a));
      }
      for (Eigen::MatrixXd& j : J) J_data.push_back(j.data());
      Eigen::VectorXd r(n);
      pool.type->evaluate(x.data(), graph.measurement(f).data(), graph.sqrt_information(f).data(),
                          r.data(), J_data.data());
      double rho = r.squaredNorm(), weight = 1.0;
      if (const Loss* loss = graph.loss(f)) {
        const double squared = rho;
        loss->evaluate({&squared, 1}, {&rho, 1}, {&weight, 1});
      }
      chi2 += rho;
      for (int a = 0; a < arity; ++a) {
        const int ba = linearizer.block_of(graph.factor_variables(f)[a]);
        if (ba < 0) continue;
        g.segment(s.offsets()[ba], s.block_size(ba)) -= weight * J[a].transpose() * r;
        for (int b = 0; b < arity; ++b) {
          const int bb = linearizer.block_of(graph.factor_variables(f)[b]);
          if (bb < 0) continue;
          H.block(s.offsets()[ba], s.offsets()[bb], s.block_size(ba), s.block_size(bb)) +=
              weight * J[a].transpose() * J[b];
        }
      }
    }
  }
};

class LinearizerTest : public ::testing::TestWithParam<int> {
 protected:
  void SetUp() override {
    before_ = threads();
    set_threads(GetParam());
  }
  void TearDown() override { set_threads(before_); }
  static void expect_oracle(const Graph& graph) {
    Linearizer linearizer(graph, resolve_gauge(graph).held);
    BlockMatrix H(linearizer.structure());
    Eigen::VectorXd g(linearizer.structure().size());
    const double chi2 =
        linearizer.linearize(graph.values(), H, {g.data(), static_cast<std::size_t>(g.size())});
    const Oracle oracle(graph, linearizer);
    EXPECT_LT((test::dense(H) - oracle.H).norm(), 1e-12 * oracle.H.norm());
    EXPECT_LT((g - oracle.g).norm(), 1e-12 * oracle.g.norm());
    EXPECT_NEAR(chi2, oracle.chi2, 1e-12 * oracle.chi2);
    EXPECT_NEAR(linearizer.chi2(graph.values()), oracle.chi2, 1e-12 * oracle.chi2);
  }
  test::PlanarTypes types_;
  int before_ = 0;
};

TEST_P(LinearizerTest, GivesTheNormalEquationsOfDenseAlgebra) {
  for (unsigned seed = 0; seed < 5; ++seed) expect_oracle(test::random_graph(types_, 40, 12, seed));
}

TEST_P(LinearizerTest, LeavesHeldVariablesOut) {
  Graph graph = test::random_graph(types_, 30, 8, 6);
  graph.set_fixed(3);
  graph.set_fixed(33);
  expect_oracle(graph);
}

TEST_P(LinearizerTest, WeighsByTheLossOnAllFactorsOrOnLoopClosures) {
  Graph graph = test::random_graph(types_, 40, 12, 3);
  graph.set_loss(std::make_shared<Cauchy>());
  expect_oracle(graph);
  graph.set_loss(std::make_shared<Cauchy>(), FactorSelector::loops());
  expect_oracle(graph);
}

TEST_P(LinearizerTest, FillsEveryBlockAnewEachTime) {
  const Graph graph = test::random_graph(types_, 30, 5, 8);
  Linearizer linearizer(graph, resolve_gauge(graph).held);
  BlockMatrix first(linearizer.structure()), again(linearizer.structure());
  std::vector<double> g(linearizer.structure().size());
  linearizer.linearize(graph.values(), first, g);
  std::fill(again.values().begin(), again.values().end(), 1e300);
  linearizer.linearize(graph.values(), again, g);
  EXPECT_TRUE(std::ranges::equal(first.values(), again.values()));
}

TEST_P(LinearizerTest, RetractsEveryVariableByItsOwnStep) {
  Graph graph = test::random_graph(types_, 12, 4, 2);
  graph.set_fixed(5);
  const Linearizer linearizer(graph, resolve_gauge(graph).held);
  std::vector<double> delta(linearizer.structure().size());
  for (std::size_t k = 0; k < delta.size(); ++k) delta[k] = 0.01 * static_cast<double>(k);
  Values moved;
  linearizer.retract(graph.values(), delta, moved);
  Graph after = graph.clone();
  after.set_values(std::move(moved));
  for (int v = 0; v < graph.variable_count(); ++v) {
    std::vector<double> step(graph.type(v).tangent_size());
    graph.type(v).local(1, graph.state(v).data(), after.state(v).data(), step.data());
    for (std::size_t k = 0; k < step.size(); ++k) {
      const int block = linearizer.block_of(v);
      EXPECT_NEAR(step[k], block < 0 ? 0.0 : delta[linearizer.structure().offsets()[block] + k],
                  1e-12);
    }
  }
}

TEST_P(LinearizerTest, RefusesAGraphThatHasChanged) {
  Graph graph = test::random_graph(types_, 12, 4, 2);
  Linearizer linearizer(graph, resolve_gauge(graph).held);
  graph.set_fixed(2);
  EXPECT_THROW(linearizer.chi2(graph.values()), std::logic_error);
}

INSTANTIATE_TEST_SUITE_P(OneTwoThreeThreads, LinearizerTest, ::testing::Values(1, 2, 3));

TEST(LinearizerDeterminism, GivesTheSameBitsForAnyNumberOfThreads) {
  const test::PlanarTypes types;
  Graph graph = test::random_graph(types, 2000, 300, 5);
  graph.set_loss(std::make_shared<Cauchy>());
  const int before = threads();
  std::vector<double> H_values[3], g_values[3];
  double chi2[3];
  for (int count = 1; count <= 3; ++count) {
    set_threads(count);
    Linearizer linearizer(graph, resolve_gauge(graph).held);
    BlockMatrix H(linearizer.structure());
    std::vector<double>& g = g_values[count - 1];
    g.resize(linearizer.structure().size());
    chi2[count - 1] = linearizer.linearize(graph.values(), H, g);
    H_values[count - 1].assign(H.values().begin(), H.values().end());
  }
  set_threads(before);
  for (int k = 1; k < 3; ++k) {
    EXPECT_EQ(H_values[0], H_values[k]);
    EXPECT_EQ(g_values[0], g_values[k]);
    EXPECT_EQ(chi2[0], chi2[k]);
  }
}

TEST(LinearizerDeterminism, FollowsAChangeOfTheNumberOfThreadsAndClearsWhatNoFactorTouches) {
  const test::PlanarTypes types;
  Graph graph = test::random_graph(types, 2000, 300, 5);
  const int alone = graph.add_variable(types.pose, 1 << 20, std::vector{1.0, 2.0, 3.0});
  const int before = threads();
  set_threads(1);
  Linearizer linearizer(graph, std::vector<bool>(graph.variable_count(), false));
  const std::size_t size = linearizer.structure().size();
  BlockMatrix H(linearizer.structure()), again(linearizer.structure());
  std::vector<double> g(size, 7.0), g_again(size, 9.0);
  std::ranges::fill(H.values(), 7.0);
  linearizer.linearize(graph.values(), H, g);
  const double* diagonal =
      H.block(linearizer.structure().column_begin()[linearizer.block_of(alone)]);
  EXPECT_EQ(std::vector<double>(diagonal, diagonal + 9), std::vector<double>(9, 0.0));
  for (const int count : {3, 2, 1}) {
    set_threads(count);
    std::ranges::fill(again.values(), 9.0);
    linearizer.linearize(graph.values(), again, g_again);
    EXPECT_TRUE(std::ranges::equal(H.values(), again.values())) << count;
    EXPECT_EQ(g, g_again) << count;
  }
  set_threads(before);
}

}  // namespace
}  // namespace cairn
