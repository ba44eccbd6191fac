// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/graph_divergence.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Core>

#include "cairn/graph/gauge.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/sparsification/sparsifier.hpp"
#include "cairn/update/graph_update.hpp"
#include "support/dense_algebra.hpp"
#include "support/dense_system.hpp"

namespace cairn::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using ::testing::HasSubstr;

class MarginalDivergence : public testing::Test {
 protected:
  Graph optimized(const std::string& generator) {
    Graph graph = registry_.make<Generator>(generator)->generate(registry_, 3).graph;
    registry_.make<Optimizer>("levenberg_marquardt")->optimize(graph);
    return graph;
  }
  /// Without every third node, from `first` on.
  Graph thinned(const Graph& graph, int first) {
    std::vector<int> nodes;
    for (int v = first; v + 1 < graph.variable_count(); v += 3) nodes.push_back(v);
    Graph sparse = graph.clone();
    apply(registry_.make<Sparsifier>("sparsify:population=tree:1")->remove(graph, nodes), sparse);
    registry_.make<Optimizer>("levenberg_marquardt")->optimize(sparse);
    return sparse;
  }
  static std::vector<Id> ids(const Graph& graph) {
    std::vector<Id> all;
    for (int v = 0; v < graph.variable_count(); ++v) all.push_back(graph.id(v));
    return all;
  }
  static std::vector<Id> ids(const Graph& a, const Graph& b) {
    std::vector<Id> all = ids(a);
    std::erase_if(all, [&](Id id) { return !b.find(id); });
    return all;
  }
  SparsificationError divergence(const Graph& p, const Graph& q, const std::vector<Id>& nodes,
                                 ComparedAt at = ComparedAt::common) {
    return marginal_divergence(p, q, nodes, *solver_, at);
  }
  void expect_refusal(const std::function<void()>& call, const char* says) {
    try {
      call();
      ADD_FAILURE() << "no error; expected " << says;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::input) << error.what();
      EXPECT_THAT(error.what(), HasSubstr(says));
    }
  }
  Registry registry_;
  std::unique_ptr<LinearSolver> solver_ = registry_.make<LinearSolver>("block_cholesky");
};

// By the blocks of the sparse graph's H, and by dense joint covariances.
TEST_F(MarginalDivergence, OfAllNodesIsThatOfTheSparseGraph) {
  for (const std::string kind : {"manhattan:poses=60", "sphere:turns=4,poses_per_turn=8"}) {
    const Graph original = optimized(kind), sparse = thinned(original, 1);
    for (const ComparedAt at : {ComparedAt::common, ComparedAt::minima}) {
      const SparsificationError whole = sparsification_error(original, sparse, *solver_, at);
      const SparsificationError dense = divergence(original, sparse, ids(sparse), at);
      EXPECT_NEAR(dense.covariance, whole.covariance, 1e-6 * (1.0 + whole.covariance)) << kind;
      EXPECT_NEAR(dense.mean, whole.mean, 1e-6 * (1.0 + whole.mean)) << kind;
      EXPECT_DOUBLE_EQ(dense.kld, dense.covariance + dense.mean);
      EXPECT_NEAR(dense.rmse, whole.rmse, 1e-12);
      EXPECT_GT(whole.covariance, 1e-3);
    }
  }
}

// Each graph has nodes that the other lacks: the formula, by dense algebra.
TEST_F(MarginalDivergence, OfCommonNodesIsThatOfTheMarginals) {
  const Graph original = optimized("manhattan:poses=60");
  const Graph p = thinned(original, 1), q = thinned(original, 2);
  const std::vector<Id> nodes = ids(p, q);
  ASSERT_LT(nodes.size(), static_cast<std::size_t>(p.variable_count()));
  ASSERT_LT(nodes.size(), static_cast<std::size_t>(q.variable_count()));
  Graph at_p = q.clone();
  for (const Id id : nodes) at_p.set_state(*at_p.find(id), p.state(*p.find(id)));
  const auto joint = [&](const Graph& graph) {
    const DenseSystem dense = dense_system(graph);
    std::vector<Eigen::Index> rows;
    for (const Id id : nodes) {
      const auto at = dense.rows.find(id);
      if (at == dense.rows.end()) continue;
      for (Eigen::Index k = 0; k < 3; ++k) rows.push_back(at->second.first + k);
    }
    return MatrixXd(dense.Sigma()(rows, rows));
  };
  const MatrixXd S_p = joint(p), S_q = joint(at_p), L = symmetric_inverse(S_q);
  VectorXd shift(S_p.rows());
  Eigen::Index row = 0;
  for (const Id id : nodes) {
    if (id == 0) continue;  // anchored
    q.type(0).local(1, p.state(*p.find(id)).data(), q.state(*q.find(id)).data(),
                    shift.data() + row);
    row += 3;
  }
  ASSERT_EQ(row, S_p.rows());
  const double covariance = 0.5 * ((L * S_p).trace() + log_determinant_of(S_q) -
                                   log_determinant_of(S_p) - static_cast<double>(S_p.rows()));
  const SparsificationError found = divergence(p, q, nodes);
  EXPECT_NEAR(found.covariance, covariance, 1e-5 * (1.0 + covariance));
  EXPECT_NEAR(found.mean, 0.5 * shift.dot(L * shift), 1e-5 * (1.0 + found.mean));
  EXPECT_GT(covariance, 1e-2);
  EXPECT_NEAR(divergence(p, p, nodes).kld, 0.0, 1e-9);
}

// Marginalising can only make two Gaussians more alike.
TEST_F(MarginalDivergence, FewerNodesDivergeLess) {
  const Graph original = optimized("manhattan:poses=60"), sparse = thinned(original, 1);
  std::vector<Id> nodes = ids(sparse);
  double before = divergence(original, sparse, nodes).covariance;
  for (const std::size_t count : {30U, 12U, 4U}) {
    nodes.resize(count);
    const double now = divergence(original, sparse, nodes).covariance;
    EXPECT_LT(now, before);
    EXPECT_GE(now, 0.0);
    before = now;
  }
}

// The first pose, which would be anchored, is in one of the graphs only.
TEST_F(MarginalDivergence, AnchorsANodeThatIsCompared) {
  const Graph original = optimized("manhattan:poses=60");
  const std::vector<Id> all = ids(original), later(all.begin() + 7, all.end());
  const Graph sparse = thinned(original, 1);
  std::vector<Id> nodes = ids(sparse);
  std::erase_if(nodes, [](Id id) { return id < 7; });
  const double found = divergence(original, sparse, nodes).kld;
  // The same with that node fixed by hand; then the whole is not moved, and the nodes that are not
  // compared are linearised at slightly other states.
  Graph p = original.clone(), q = sparse.clone();
  p.set_fixed(*p.find(nodes.front()));
  q.set_fixed(*q.find(nodes.front()));
  const double fixed = divergence(p, q, nodes).covariance;
  EXPECT_NEAR(divergence(original, sparse, nodes).covariance, fixed, 1e-3 * fixed);
  EXPECT_GT(found, 1e-3);
  EXPECT_NEAR(divergence(original, original, later).kld, 0.0, 1e-9);
}

TEST_F(MarginalDivergence, WhereAWholeGraphLiesIsNoDivergence) {
  const Graph p = optimized("manhattan:poses=60");
  Graph moved = p.clone();
  for (int v = 0; v < moved.variable_count(); ++v) {
    const auto x = p.state(v);  // a quarter turn about the origin
    moved.set_state(v, std::array{-x[1] + 5.0, x[0], x[2] + 1.5707963267948966});
  }
  const std::vector<Id> all = ids(p), some(all.begin() + 10, all.end());
  for (const ComparedAt at : {ComparedAt::common, ComparedAt::minima})
    EXPECT_NEAR(divergence(p, moved, some, at).kld, 0.0, 1e-6);
}

/// Two chains of poses that nothing connects.
Graph two_chains(Registry& registry) {
  Graph graph;
  for (int k = 0; k < 8; ++k) {
    graph.add_variable(registry.variable_type("VERTEX_SE2"), k, std::array{double(k), 0.0, 0.0});
    if (k % 4 == 0) continue;
    graph.add_factor(registry.factor_type("EDGE_SE2"), std::array{k - 1, k},
                     std::array{1.0, 0.0, 0.0}, std::array{50.0, 3.0, 1.0, 80.0, 2.0, 200.0});
  }
  return graph;
}

TEST_F(MarginalDivergence, ThatOfAPoseWhichIsAllThatIsLeftOfItsComponentIsNone) {
  const Graph original = two_chains(registry_);
  Graph sparse;
  for (const int v : {0, 1, 6}) sparse.add_variable(original.type_of(v), v, original.state(v));
  const Factor first = original.factor(0);
  sparse.add_factor(first.type, std::array{0, 1}, first.measurement, first.information);
  EXPECT_NEAR(sparsification_error(original, sparse, *solver_).kld, 0.0, 1e-9);
  EXPECT_NEAR(conservative_margin(original, sparse, *solver_), 0.0, 1e-9);
  EXPECT_NEAR(divergence(original, sparse, {0, 1, 6}).kld, 0.0, 1e-9);
  // Of two poses, how they lie to each other is lost.
  sparse.add_variable(original.type_of(7), 7, original.state(7));
  expect_refusal([&] { sparsification_error(original, sparse, *solver_); },
                 "constant in one of the graphs and free in the other");
}

TEST_F(MarginalDivergence, SaysWhatCannotBeCompared) {
  const Graph original = optimized("manhattan:poses=60"), sparse = thinned(original, 1);
  expect_refusal([&] { divergence(original, sparse, {0, 1}); }, "1 is not in the second graph");
  expect_refusal([&] { divergence(sparse, original, {0, 1}); }, "is not in the first graph");
  expect_refusal([&] { sparsification_error(sparse, original, *solver_); },
                 "is not in the original graph");
  Graph fixed = original.clone();
  fixed.set_fixed(20);
  fixed.set_fixed(0);
  using Both = std::pair<const Graph*, const Graph*>;
  for (const Both& both : {Both{&original, &fixed}, Both{&fixed, &original}}) {
    expect_refusal([&] { sparsification_error(*both.first, *both.second, *solver_); },
                   "constant in one of the graphs and free in the other");
  }
  expect_refusal(
      [&] {
        const Graph large =
            registry_.make<Generator>("manhattan:poses=2100")->generate(registry_, 3).graph;
        divergence(large, large, ids(large));
      },
      "6297 coordinates");
}

// Overconfidence ----------------------------------------------------------------------------------

/// The eigenvalues of Λ − Λ̆ by dense algebra: of the marginals of both graphs at the same states.
VectorXd dense_difference(const Graph& original, const Graph& sparse) {
  Graph at_original = sparse.clone();
  for (int v = 0; v < sparse.variable_count(); ++v)
    at_original.set_state(v, original.state(*original.find(sparse.id(v))));
  const auto held = [&](const Graph& graph) {
    std::vector<bool> all = resolve_gauge(graph).held;
    for (const int v : resolve_gauge(sparse).anchored) all[*graph.find(sparse.id(v))] = true;
    return all;
  };
  const DenseSystem p = dense_system(original, held(original)),
                    q = dense_system(at_original, held(at_original));
  std::vector<Eigen::Index> kept, of_q, left;
  for (const auto& [id, rows] : p.rows) {
    const auto at = q.rows.find(id);
    for (Eigen::Index k = 0; k < rows.size; ++k) {
      (at == q.rows.end() ? left : kept).push_back(rows.first + k);
      if (at != q.rows.end()) of_q.push_back(at->second.first + k);
    }
  }
  const MatrixXd across = p.H(left, kept);
  const MatrixXd marginal =
      p.H(kept, kept) - across.transpose() * symmetric_inverse(p.H(left, left)) * across;
  return eigenvalues_of(marginal - q.H(of_q, of_q));
}

TEST_F(MarginalDivergence, OverconfidenceIsTheLeastEigenvalueOfTheDifference) {
  for (const std::string kind :
       {"manhattan:poses=60", "sphere:turns=4,poses_per_turn=8", "landmarks2d:poses=40"}) {
    for (const std::string options : {"population=tree:1", "population=tree:2",
                                      "resolve=false,recovery=ncfd:conservative=true"}) {
      SCOPED_TRACE(kind + ", " + options);
      const Graph original = optimized(kind);
      std::vector<int> nodes;
      for (int v = 1; v + 1 < original.variable_count(); v += 3) {
        if (original.type(v).tangent_size() >= 3) nodes.push_back(v);
      }
      Graph sparse = original.clone();
      const bool conservative = options.find("conservative") != std::string::npos;
      ComponentSpec spec{"sparsify", {}};
      if (conservative) {
        spec.values = {{"resolve", "false"}, {"recovery", "ncfd:conservative=true"}};
      } else {
        spec.values = {{"population", options.substr(options.find('=') + 1)}};
      }
      apply(registry_.make<Sparsifier>(spec)->remove(original, nodes), sparse);
      const VectorXd eigenvalues = dense_difference(original, sparse);
      const double found = conservative_margin(original, sparse, *solver_);
      const double size = eigenvalues.cwiseAbs().maxCoeff();
      EXPECT_NEAR(found, eigenvalues[0], 1e-5 * std::abs(eigenvalues[0]) + 1e-9 * size);
      if (conservative) {
        EXPECT_GT(found, -1e-8 * size);
      } else {
        EXPECT_LT(found, -1e-3 * size);
      }
    }
  }
}

/// The same graph with all of its information times `scale`.
Graph scaled(const Graph& graph, double scale) {
  Graph result;
  for (int v = 0; v < graph.variable_count(); ++v)
    result.add_variable(graph.type_of(v), graph.id(v), graph.state(v));
  for (int f = 0; f < graph.factor_count(); ++f) {
    Factor factor = graph.factor(f);
    for (double& entry : factor.information) entry *= scale;
    std::vector<int> on;
    for (const Id id : factor.variables) on.push_back(*graph.find(id));
    result.add_factor(factor.type, on, factor.measurement, factor.information);
  }
  return result;
}

// The inverse of an information of 1e-200 is a number, and its square is none.
TEST_F(MarginalDivergence, OverconfidenceScalesWithTheInformation) {
  const Graph original = optimized("manhattan:poses=60"), sparse = thinned(original, 1);
  const double margin = conservative_margin(original, sparse, *solver_);
  for (const int exponent : {-960, -700, -20, 20, 700}) {
    const double scale = std::ldexp(1.0, exponent);
    EXPECT_NEAR(
        conservative_margin(scaled(original, scale), scaled(sparse, scale), *solver_) / scale,
        margin, 1e-6 * std::abs(margin))
        << exponent;
  }
}

}  // namespace
}  // namespace cairn::test
