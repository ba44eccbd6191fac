// SPDX-License-Identifier: BSD-3-Clause
// The sparse extended information filter beside the information filter, and its sparsification
// beside the published formula in dense matrices.
#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "../random_sequence.hpp"
#include "cairn/io/format.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/update/recorded_graph.hpp"
#include "support/components.hpp"
#include "support/data.hpp"
#include "support/sample_graphs.hpp"

namespace cairn::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::Ge;
using testing::Gt;
using testing::Le;
using testing::Lt;

class Seif : public testing::Test {
 protected:
  void SetUp() override {
    CAIRN_NEEDS("estimator", "eif");
    CAIRN_NEEDS("estimator", "seif");
  }
  std::unique_ptr<Estimator> make(const std::string& name) {
    return registry_.make<Estimator>(name);
  }
  Registry registry_;
};

std::vector<Id> free_variables(const Estimator& estimator, const Graph& graph) {
  std::vector<Id> all = estimator.variables();
  std::erase_if(all, [&](Id id) { return graph.fixed(graph.find(id).value()); });
  return all;
}

/// Σ of the variables that are not fixed, in their order.
MatrixXd covariance(Estimator& estimator) {
  const Graph graph = estimator.graph();
  const std::vector<Id> all = free_variables(estimator, graph);
  Eigen::Index n = 0, at = 0;
  for (const Id id : all) n += estimator.type(id)->tangent_size();
  MatrixXd Sigma(n, n);
  for (const Id id : all) {
    const auto size = estimator.type(id)->tangent_size();
    EXPECT_TRUE(estimator.covariance_column(
        id, all, {Sigma.col(at).data(), static_cast<std::size_t>(n * size)}));
    at += size;
  }
  return Sigma;
}

void expect_same_states(Estimator& a, Estimator& b, double tolerance) {
  ASSERT_EQ(a.variables(), b.variables());
  for (const Id id : a.variables()) {
    VectorXd apart(a.type(id)->tangent_size());
    a.type(id)->local(1, a.state(id).data(), b.state(id).data(), apart.data());
    EXPECT_LT(apart.norm(), tolerance) << id;
  }
}

/// By variable in the order of the graph: it, and all factors on it and variables before.
std::vector<GraphUpdate> updates_of(const Graph& graph) {
  std::vector<GraphUpdate> all(static_cast<std::size_t>(graph.variable_count()));
  for (int v = 0; v < graph.variable_count(); ++v) all[v].variables.push_back(graph.variable(v));
  for (int f = 0; f < graph.factor_count(); ++f)
    all[std::ranges::max(graph.factor_variables(f))].factors.push_back(graph.factor(f));
  return all;
}

/// Rows of the identity.
MatrixXd selection(const std::vector<int>& rows, Eigen::Index n) {
  const MatrixXd I = MatrixXd::Identity(n, n);
  return I(rows, Eigen::all);
}

/// H − H Fᵀ (F H Fᵀ)⁻¹ F H, F of the rows that are marginalised.
MatrixXd without(const MatrixXd& H, const std::vector<int>& rows) {
  if (rows.empty()) return H;
  const MatrixXd F = selection(rows, H.rows());
  return H - H * F.transpose() * (F * H * F.transpose()).inverse() * F * H;
}

/// The sparsification in the matrices of Thrun et al. 2004: H¹ − H² + H³.
MatrixXd published(const MatrixXd& H, const std::vector<int>& x, const std::vector<int>& kept,
                   const std::vector<int>& given_up) {
  std::vector<int> all = x, x_and_given_up = x;
  all.insert(all.end(), kept.begin(), kept.end());
  all.insert(all.end(), given_up.begin(), given_up.end());
  x_and_given_up.insert(x_and_given_up.end(), given_up.begin(), given_up.end());
  const MatrixXd F = selection(all, H.rows());
  const MatrixXd H0 = F.transpose() * F * H * F.transpose() * F;  // m⁻ held
  return without(H0, given_up) - without(H0, x_and_given_up) + without(H, x);
}

/// Blocks of the newest variable in Λ, with their strengths, the strongest first.
struct Link {
  double strength;
  std::vector<int> rows;
};
std::vector<Link> links(const MatrixXd& L, const std::vector<std::vector<int>>& rows) {
  const auto whitened = [&](const std::vector<int>& of) {
    return MatrixXd(Eigen::SelfAdjointEigenSolver<MatrixXd>(L(of, of)).operatorInverseSqrt());
  };
  std::vector<Link> all;
  for (std::size_t k = 0; k + 1 < rows.size(); ++k) {
    const MatrixXd block = L(rows.back(), rows[k]);
    if (block.norm() < 1e-9 * L.norm()) continue;
    all.push_back({(whitened(rows.back()) * block * whitened(rows[k])).norm(), rows[k]});
  }
  std::ranges::sort(all, std::greater{}, &Link::strength);
  return all;
}

std::vector<std::vector<int>> rows_of(Estimator& estimator) {
  const Graph graph = estimator.graph();
  std::vector<std::vector<int>> all;
  int at = 0;
  for (const Id id : free_variables(estimator, graph)) {
    auto& rows = all.emplace_back();
    for (int k = 0; k < estimator.type(id)->tangent_size(); ++k) rows.push_back(at++);
  }
  return all;
}

/// A chain of poses, the last of which is also related to some before it.
Graph chain_seen_by_its_end(int poses, const std::vector<int>& seen) {
  const Graph ring = ring_of_poses(poses, 0.05);
  Graph graph;
  for (int v = 0; v < poses; ++v) graph.add(ring.variable(v));
  int chosen = -1;
  for (int f = 0; f < ring.factor_count(); ++f) {
    const auto on = ring.factor_variables(f);
    if (on.size() == 2 && std::abs(on[1] - on[0]) == 1) graph.add(ring.factor(f));
    if (on.size() == 2 && chosen < 0) chosen = f;
  }
  for (const int v : seen) {
    Factor factor = ring.factor(chosen);
    factor.variables = {ring.id(v), ring.id(poses - 1)};
    graph.add(factor);
  }
  graph.set_fixed(0);
  return graph;
}

TEST_F(Seif, IsEifWhereNothingIsGivenUp) {
  for (unsigned seed = 1; seed <= 30; ++seed) {
    const auto seif = make("seif:active=1000"), eif = make("eif");
    RandomSequence(*seif, seed, false).run(20);
    RandomSequence(*eif, seed, false).run(20);
    expect_same_states(*seif, *eif, 1e-12);
    if (eif->variable_count() > 0) {
      EXPECT_EQ(covariance(*seif), covariance(*eif)) << seed;
    }
    ASSERT_FALSE(HasFailure()) << "seed " << seed;
  }
}

TEST_F(Seif, OneSparsificationIsThePublishedFormulaAndKeepsTheMean) {
  for (const int active : {1, 2, 3, 4}) {
    const auto seif = make("seif:active=" + std::to_string(active)), eif = make("eif");
    // All but the last are one update: nothing is sparsified then, since a chain's end has one
    // link.
    const std::vector<GraphUpdate> updates =
        updates_of(chain_seen_by_its_end(14, {2, 4, 5, 8, 10}));
    GraphUpdate before;
    for (std::size_t k = 0; k + 1 < updates.size(); ++k) {
      before.variables.push_back(updates[k].variables[0]);
      before.factors.insert(before.factors.end(), updates[k].factors.begin(),
                            updates[k].factors.end());
    }
    for (Estimator* estimator : {seif.get(), eif.get()}) {
      ASSERT_TRUE(estimator->update(before).ok);
      ASSERT_TRUE(estimator->update(updates.back()).ok);
    }
    const MatrixXd L = covariance(*eif).inverse();
    const std::vector<std::vector<int>> rows = rows_of(*eif);
    const std::vector<Link> linked = links(L, rows);
    ASSERT_THAT(linked.size(), Ge(5U));
    std::vector<int> kept, given_up;
    for (std::size_t k = 0; k < linked.size(); ++k) {
      auto& into = static_cast<int>(k) < active ? kept : given_up;
      into.insert(into.end(), linked[k].rows.begin(), linked[k].rows.end());
    }
    const MatrixXd wanted = published(L, rows.back(), kept, given_up);
    EXPECT_LT((covariance(*seif).inverse() - wanted).norm(), 1e-9 * wanted.norm()) << active;
    EXPECT_GT((wanted - L).norm(), 1e-3 * L.norm());
    expect_same_states(*seif, *eif, 1e-9);
    // What is known of the map is untouched.
    const Eigen::Index m = L.rows() - std::ssize(rows.back());
    const MatrixXd Sigma = covariance(*eif).topLeftCorner(m, m);
    EXPECT_LT((covariance(*seif).topLeftCorner(m, m) - Sigma).norm(), 1e-9 * Sigma.norm());
    // Asking changes nothing, and neither does an update without anything in it.
    const MatrixXd as_it_is = covariance(*seif);
    seif->update({}, {});
    EXPECT_LT((covariance(*seif) - as_it_is).norm(), 1e-9 * as_it_is.norm());
    expect_same_states(*seif, *eif, 1e-9);
  }
}

TEST_F(Seif, TheNewestPoseKeepsAsManyLinksAsItMay) {
  for (const std::size_t active : {1U, 2U}) {
    const auto seif = make("seif:active=" + std::to_string(active)), eif = make("eif");
    std::size_t most = 0;
    // Poses 7 to 12 are each related to others.
    Graph graph = chain_seen_by_its_end(13, {1, 3, 5, 7});
    for (int v = 7; v < 12; ++v) {
      Factor factor = graph.factor(graph.factor_count() - 1);
      for (const int seen : {2, 4, 5}) {
        factor.variables = {graph.id(seen), graph.id(v)};
        graph.add(factor);
      }
    }
    for (const GraphUpdate& update : updates_of(graph)) {
      ASSERT_TRUE(seif->update(update).ok);
      ASSERT_TRUE(eif->update(update).ok);
      if (seif->variable_count() < 3) continue;
      EXPECT_THAT(links(covariance(*seif).inverse(), rows_of(*seif)).size(), Le(active));
      most = std::max(most, links(covariance(*eif).inverse(), rows_of(*eif)).size());
    }
    EXPECT_EQ(most, 5U);
  }
}

TEST_F(Seif, AnAmortisedMeanComesNearAndFullIsExact) {
  Graph graph = ring_of_poses(40, 0.02);
  graph.set_fixed(0);
  const auto amortised = make("seif:active=1000,mean=amortized,steps=10"), exact = make("eif");
  GraphUpdate all;
  for (const GraphUpdate& update : updates_of(graph)) {
    all.variables.push_back(update.variables[0]);
    all.factors.insert(all.factors.end(), update.factors.begin(), update.factors.end());
  }
  ASSERT_TRUE(amortised->update(all).ok);
  ASSERT_TRUE(exact->update(all).ok);
  const auto apart = [&](Estimator& estimator) {
    double sum = 0.0;
    for (const Id id : exact->variables()) {
      VectorXd delta(3);
      exact->type(id)->local(1, exact->state(id).data(), estimator.state(id).data(), delta.data());
      sum += delta.squaredNorm();
    }
    return std::sqrt(sum);
  };
  const double at_first = apart(*amortised);
  EXPECT_THAT(at_first, Gt(1e-3));
  const auto copy = amortised->clone();
  double before = at_first;
  for (int round = 0; round < 5; ++round) {
    for (int k = 0; k < 100; ++k) amortised->update({}, {});
    EXPECT_THAT(apart(*amortised), Lt(before));
    before = apart(*amortised);
  }
  EXPECT_THAT(before, Lt(0.2 * at_first));
  EXPECT_EQ(apart(*copy), at_first);  // the other is by itself
  copy->update({}, {.full = true});
  // But for the order in which a state has moved in its tangent spaces.
  EXPECT_THAT(apart(*copy), Lt(0.01 * at_first)) << at_first;
}

/// Mean of eᵀ Σ⁻¹ e by degree of freedom over worlds and poses: 1 where Σ is that of the errors e.
double nees(Estimator& estimator, Registry& registry) {
  double sum = 0.0;
  int freedom = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    estimator.reset();
    Simulation world = registry.make<Generator>("manhattan:poses=150")->generate(registry, seed);
    world.graph.set_fixed(0);
    for (const Arrival& arrival : arrival_order(world.graph)) {
      GraphUpdate update = arrival_update(world.graph, arrival);
      leave_states_to_factors(update, estimator);
      estimator.update(update);
    }
    for (const Id id : {50, 100, 149}) {
      MatrixXd Sigma(3, 3);
      EXPECT_TRUE(estimator.covariance(id, id, {Sigma.data(), 9}));
      VectorXd error(3);
      estimator.type(id)->local(1, estimator.state(id).data(),
                                world.truth.state(world.truth.find(id).value()).data(),
                                error.data());
      sum += error.dot(Sigma.ldlt().solve(error));
      freedom += 3;
    }
  }
  return sum / freedom;
}

TEST_F(Seif, ItsErrorsAreLargerThanItsCovarianceSays) {
  CAIRN_NEEDS("generator", "manhattan");
  const auto eif = make("eif"), few = make("seif:active=1"), all = make("seif:active=1000");
  const double of_eif = nees(*eif, registry_);
  EXPECT_THAT(of_eif, Lt(2.0));
  EXPECT_EQ(nees(*all, registry_), of_eif);
  EXPECT_THAT(nees(*few, registry_), Gt(4.0 * of_eif));
}

/// √(|Σ| / |Σ of the other|)^(1/n): how much larger its standard deviations are.
double spread_beside(Estimator& estimator, Estimator& other, Id id) {
  double difference = 0.0;
  const int n = estimator.type(id)->tangent_size();
  for (Estimator* each : {&estimator, &other}) {
    MatrixXd block(n, n);
    EXPECT_TRUE(each->covariance(id, id, {block.data(), static_cast<std::size_t>(n * n)}));
    difference += (each == &estimator ? 1.0 : -1.0) * std::log(block.determinant());
  }
  return std::exp(0.5 * difference / n);
}

/// The known fault (Walter, Eustice and Leonard 2007): the figures are those of docs/online.md.
TEST_F(Seif, IsTooCertainOnAPublishedGraph) {
  CAIRN_NEEDS_DATA();
  const Graph graph = read_graph(data_folder() / "pose2d/intel943.g2o", registry_);
  const auto eif = make("eif");
  std::vector<std::unique_ptr<Estimator>> seifs;
  for (const char* active : {"1", "2", "4"})
    seifs.push_back(make(std::string("seif:active=") + active));
  int count = 0;
  for (const Arrival& arrival : arrival_order(graph)) {
    if (++count > 300) break;
    const GraphUpdate update = arrival_update(graph, arrival);
    eif->update(update);
    for (const auto& seif : seifs) seif->update(update);
  }
  std::vector<double> mean;
  for (const auto& seif : seifs) {
    double sum = 0.0;
    int more_certain = 0, poses = 0;
    for (const Id id : eif->variables()) {
      if (id == eif->variables().front()) continue;
      const double spread = spread_beside(*seif, *eif, id);
      sum += std::log(spread);
      more_certain += spread < 1.0 - 1e-9;
      ++poses;
    }
    mean.push_back(std::exp(sum / poses));
    EXPECT_EQ(more_certain, &seif == &seifs.back() ? 0 : poses);
  }
  EXPECT_THAT(mean[0], Lt(0.6));
  EXPECT_THAT(mean[1], Lt(0.95));
  EXPECT_THAT(mean[1], Gt(mean[0]));
  EXPECT_NEAR(mean[2], 1.0, 1e-9);  // no pose has more links
}

}  // namespace
}  // namespace cairn::test
