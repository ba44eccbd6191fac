// SPDX-License-Identifier: BSD-3-Clause
#include "topologies.hpp"

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "cairn/runtime/error.hpp"
#include "recovery.hpp"
#include "sparsify/sparsifier/blankets.hpp"

namespace cairn::sparsify {
namespace {

using testing::DoubleNear;
using testing::Gt;
using testing::HasSubstr;
using testing::Le;
using testing::Lt;

double kld(const DenseBlanket& blanket, const std::vector<FactorChoice>& topology,
           double tolerance = 1e-5) {
  FactorDescent ncfd({.tolerance = tolerance, .iterations = 100000}, /*greedy=*/true);
  return ncfd.recover(BlanketProjection(blanket, Projection::eigen).problem(blanket, topology)).kld;
}

/// All of them, with what they can be told.
std::vector<std::pair<std::string, std::unique_ptr<Topology>>> topologies() {
  std::vector<std::pair<std::string, std::unique_ptr<Topology>>> all;
  const TopologyOptions information{.regularization = Regularization::information};
  all.emplace_back("mi", std::make_unique<MutualInformation>(TopologyOptions{}));
  all.emplace_back("mi:regularization=information",
                   std::make_unique<MutualInformation>(information));
  all.emplace_back("dmi", std::make_unique<DowndatedInformation>(DowndatedInformationOptions{}));
  all.emplace_back("dmi:downdate=exact",
                   std::make_unique<DowndatedInformation>(
                       DowndatedInformationOptions{.downdate = Downdate::exact}));
  all.emplace_back("ekld", std::make_unique<ExpectedDivergence>(TopologyOptions{}));
  all.emplace_back("odd", std::make_unique<OffDiagonalDeterminant>());
  all.emplace_back("l1", std::make_unique<SparseInverse>(SparseInverseOptions{}));
  all.emplace_back("best", std::make_unique<Exhaustive>(ExhaustiveOptions{}));
  return all;
}

class Topologies : public testing::Test {
 protected:
  /// Simulated and random ones.
  std::vector<DenseBlanket> some(int least, int most) {
    std::vector<DenseBlanket> all =
        blankets(solved(registry, "manhattan:poses=300,loop_density=0.5"), 1, 4, least, most);
    for (DenseBlanket& one :
         blankets(solved(registry, "sphere:turns=6,poses_per_turn=12"), 1, 9, least, most))
      all.push_back(std::move(one));
    Draw draw(1);
    for (const int dimension : {2, 3}) {
      for (int nodes = least; nodes <= most; ++nodes)
        all.push_back(random_blanket(registry, dimension, nodes, draw, nodes));
    }
    return all;
  }
  Registry registry;
};

/// Every set of `count` of `all` numbers.
void for_subsets(int all, int count, const std::function<void(const std::vector<int>&)>& visit,
                 std::vector<int> chosen = {}) {
  if (static_cast<int>(std::ssize(chosen)) == count) return visit(chosen);
  const int from = chosen.empty() ? 0 : chosen.back() + 1;
  for (int k = from; k < all; ++k) {
    chosen.push_back(k);
    for_subsets(all, count, visit, chosen);
    chosen.pop_back();
  }
}

/// ½ ln(|Σ_ii| |Σ_jj| / |Σ_pair|) of Σ̂ = (Λ + εI)⁻¹, as it is written.
double mutual_information_of(const DenseBlanket& blanket, int i, int j) {
  const int d = blanket.size(), t = blanket.node_sizes.front();
  const Matrix L = information(blanket);
  const Matrix S =
      Matrix(L + TopologyOptions{}.epsilon * L.trace() / d * Matrix::Identity(d, d)).inverse();
  Matrix pair(2 * t, 2 * t);
  pair << S.block(t * i, t * i, t, t), S.block(t * i, t * j, t, t), S.block(t * j, t * i, t, t),
      S.block(t * j, t * j, t, t);
  return 0.5 * std::log(S.block(t * i, t * i, t, t).determinant() *
                        S.block(t * j, t * j, t, t).determinant() / pair.determinant());
}

TEST_F(Topologies, MutualInformationIsThatOfTheCovariance) {
  for (const DenseBlanket& blanket : some(2, 6)) {
    const Matrix all = mutual_information(blanket, {});
    for (int i = 0; i < all.rows(); ++i) {
      for (int j = 0; j < all.rows(); ++j) {
        if (i == j) continue;
        const double expected = mutual_information_of(blanket, i, j);
        EXPECT_THAT(all(i, j), DoubleNear(expected, 1e-7 * (1.0 + expected)));
      }
    }
  }
}

/// Where Λ is invertible and ε is next to nothing, both forms are the mutual information.
TEST_F(Topologies, BothRegularisationsAgreeWhereNoneIsNeeded) {
  Draw draw(3);
  DenseBlanket blanket = random_blanket(registry, 2, 5, draw, 5);
  const Matrix full = 10.0 * draw.definite(blanket.size());
  blanket.information.assign(full.data(), full.data() + full.size());
  const auto by = [&](Regularization how) {
    return mutual_information(blanket, {.regularization = how, .epsilon = 1e-12});
  };
  EXPECT_THAT(apart(by(Regularization::covariance), by(Regularization::information)), Lt(1e-8));
  EXPECT_THAT(by(Regularization::information)(0, 1), Gt(0.0));
}

TEST_F(Topologies, TheChowLiuTreeHasTheMostMutualInformation) {
  int seen = 0;
  for (const DenseBlanket& blanket : some(5, 5)) {
    for (const Regularization how : {Regularization::covariance, Regularization::information}) {
      const Matrix weights = mutual_information(blanket, {.regularization = how});
      const auto sum = [&](const std::vector<FactorChoice>& tree) {
        double total = 0.0;
        for (const FactorChoice& choice : tree) {
          const std::vector<int>& nodes = blanket.models[choice.front()].nodes;
          total += weights(nodes[0], nodes[1]);
        }
        return total;
      };
      double most = 0.0;
      int trees = 0;
      for_subsets(10, 4, [&](const std::vector<int>& models) {
        std::vector<FactorChoice> topology;
        for (const int model : models) topology.push_back({model});
        if (!connects(blanket, topology)) return;
        ++trees;
        most = std::max(most, sum(topology));
      });
      EXPECT_EQ(trees, 125);  // Cayley: 5³
      const std::vector<FactorChoice> tree =
          ChowLiuTree(TopologyOptions{.regularization = how}).choose(blanket, 9);
      EXPECT_EQ(tree.size(), 4U);
      EXPECT_TRUE(connects(blanket, tree));
      EXPECT_THAT(sum(tree), DoubleNear(most, 1e-9 * (1.0 + most)));
      ++seen;
    }
  }
  EXPECT_THAT(seen, Gt(4));
}

void expect_pairs(const DenseBlanket& blanket, const std::vector<FactorChoice>& topology) {
  EXPECT_TRUE(connects(blanket, topology));
  std::set<std::set<int>> pairs;
  for (const FactorChoice& choice : topology) {
    ASSERT_EQ(choice.size(), 1U);
    const std::vector<int>& nodes = blanket.models[choice.front()].nodes;
    EXPECT_TRUE(pairs.insert({nodes.begin(), nodes.end()}).second) << nodes[0] << " " << nodes[1];
  }
}

TEST_F(Topologies, ConnectAllNodesWithAsManyFactorsAsAreAskedFor) {
  for (const DenseBlanket& blanket : some(2, 5)) {
    const int nodes = static_cast<int>(std::ssize(blanket.node_sizes));
    const int tree = nodes - 1, all = nodes * tree / 2;
    for (const auto& [name, topology] : topologies()) {
      SCOPED_TRACE(testing::Message() << name << ", " << nodes << " nodes");
      for (int population = tree; population <= all; ++population) {
        const std::vector<FactorChoice> chosen = topology->choose(blanket, population);
        EXPECT_EQ(static_cast<int>(chosen.size()), population);
        expect_pairs(blanket, chosen);
      }
      EXPECT_EQ(static_cast<int>(topology->choose(blanket, 1).size()), tree);
      EXPECT_EQ(static_cast<int>(topology->choose(blanket, 10 * all).size()), all);
    }
    EXPECT_EQ(static_cast<int>(ChowLiuTree(TopologyOptions{}).choose(blanket, all).size()), tree);
    expect_pairs(blanket, ChowLiuTree(TopologyOptions{}).choose(blanket, all));
  }
}

/// Those of two models between the same nodes that comes first.
TEST_F(Topologies, TakeOneModelOfAPair) {
  Draw draw(4);
  DenseBlanket blanket = random_blanket(registry, 2, 4, draw, 3);
  const std::vector<FactorModel> once = blanket.models;
  for (FactorModel model : once) {
    for (double& x : model.jacobian) x *= 2.0;
    blanket.models.push_back(std::move(model));
  }
  for (const auto& [name, topology] : topologies()) {
    SCOPED_TRACE(name);
    for (const int population : {3, 5, 6, 12}) {
      const std::vector<FactorChoice> chosen = topology->choose(blanket, population);
      EXPECT_EQ(static_cast<int>(chosen.size()), std::min(population, 6));
      expect_pairs(blanket, chosen);
      for (const FactorChoice& choice : chosen)
        EXPECT_THAT(choice.front(), Lt(static_cast<int>(once.size())));
    }
  }
}

TEST_F(Topologies, SayWhenNodesCannotBeConnected) {
  Draw draw(5);
  for (const bool few : {false, true}) {
    DenseBlanket blanket = random_blanket(registry, 2, 5, draw, 3);
    std::erase_if(blanket.models, [&](const FactorModel& model) {
      return model.nodes[1] == 4 || (few && model.nodes[0] > 0);
    });
    std::vector<std::pair<std::string, std::unique_ptr<Topology>>> all = topologies();
    all.emplace_back("clt", std::make_unique<ChowLiuTree>(TopologyOptions{}));
    all.emplace_back("cliquey", std::make_unique<Cliquey>(TopologyOptions{}));
    for (const auto& [name, topology] : all) {
      for (const int population : {4, 6}) {
        try {
          topology->choose(blanket, population);
          ADD_FAILURE() << name << " connects them";
        } catch (const Error& error) {
          EXPECT_EQ(error.code(), ErrorCode::usage) << name;
          EXPECT_THAT(error.what(), HasSubstr("cannot be connected")) << name;
        }
      }
    }
  }
}

TEST_F(Topologies, NoneIsBetterThanTheBest) {
  int seen = 0;
  for (const DenseBlanket& blanket : some(4, 5)) {
    const int nodes = static_cast<int>(std::ssize(blanket.node_sizes));
    const auto all = topologies();
    for (const int population : {nodes - 1, nodes, nodes + 1}) {
      const std::vector<FactorChoice> best =
          Exhaustive(ExhaustiveOptions{}).choose(blanket, population);
      ASSERT_TRUE(connects(blanket, best));
      const double least = kld(blanket, best);
      for (const auto& [name, topology] : all) {
        if (name == "best") continue;
        EXPECT_THAT(least, Le(kld(blanket, topology->choose(blanket, population)) + 1e-6))
            << name << ", " << nodes << " nodes, " << population << " factors";
      }
      ++seen;
    }
  }
  EXPECT_THAT(seen, Gt(40));
}

TEST_F(Topologies, BestIsThatOfEkldWhereThereAreMoreThanItMayTry) {
  int other = 0;
  for (const DenseBlanket& blanket : some(5, 5)) {
    const std::vector<FactorChoice> ekld = ExpectedDivergence(TopologyOptions{}).choose(blanket, 5);
    // 10 over 5 are 252.
    const std::vector<FactorChoice> tried =
        Exhaustive(ExhaustiveOptions{.most = 252}).choose(blanket, 5);
    EXPECT_EQ(Exhaustive(ExhaustiveOptions{.most = 251}).choose(blanket, 5), ekld);
    other += std::set(tried.begin(), tried.end()) != std::set(ekld.begin(), ekld.end());
  }
  EXPECT_THAT(other, Gt(0));
}

TEST_F(Topologies, BestSaysOfEachBlanketWhetherItWasTooLarge) {
  Draw draw(6);
  const DenseBlanket small = random_blanket(registry, 2, 4, draw, 3);
  const DenseBlanket large = random_blanket(registry, 2, 5, draw, 3);
  Exhaustive best(ExhaustiveOptions{.most = 20});
  EXPECT_EQ(best.note(), "");
  best.choose(small, 3);  // 6 over 3 are 20
  EXPECT_EQ(best.note(), "");
  best.choose(large, 4);
  const std::string note = best.note();
  EXPECT_THAT(note, testing::AllOf(HasSubstr("ekld"), HasSubstr("20"), HasSubstr("most")));
  best.choose(large, 5);  // the same words, so that they can be counted
  EXPECT_EQ(best.note(), note);
  best.choose(small, 3);
  EXPECT_EQ(best.note(), "");
}

TEST_F(Topologies, BestMayRefuseMoreThanItMayTry) {
  Draw draw(6);
  const DenseBlanket blanket = random_blanket(registry, 2, 5, draw, 3);
  try {
    Exhaustive(ExhaustiveOptions{.most = 251, .beyond = Beyond::refuse}).choose(blanket, 5);
    FAIL() << "it tried";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::usage);
    EXPECT_THAT(error.what(), HasSubstr("252"));
    EXPECT_THAT(error.what(), HasSubstr("251"));
  }
}

// In the mean over blankets; one by one it is greedy, and may be wrong.
TEST_F(Topologies, EkldLosesTheLeast) {
  for (const int nodes : {4, 5, 6, 7, 8}) {
    std::map<std::string, double> sums;
    for (const DenseBlanket& blanket : some(nodes, nodes)) {
      for (const auto& [name, topology] : topologies()) {
        if (name != "best") sums[name] += kld(blanket, topology->choose(blanket, 2 * (nodes - 1)));
      }
    }
    for (const auto& [name, sum] : sums)
      EXPECT_LE(sums.at("ekld"), (1.0 + 1e-9) * sum) << name << ", " << nodes << " nodes";
  }
}

TEST_F(Topologies, CliqueyPairsTheEdgesOfTheTree) {
  int paired = 0;
  for (const DenseBlanket& blanket : some(3, 9)) {
    const std::vector<FactorChoice> tree = ChowLiuTree(TopologyOptions{}).choose(blanket, 0);
    const std::vector<FactorChoice> chosen = Cliquey(TopologyOptions{}).choose(blanket, 0);
    std::multiset<int> edges, expected;
    for (const FactorChoice& choice : tree) expected.insert(choice.front());
    for (const FactorChoice& choice : chosen) {
      ASSERT_THAT(choice.size(), Le(2U));
      edges.insert(choice.begin(), choice.end());
      if (choice.size() < 2) continue;
      ++paired;
      const std::vector<int>&a = blanket.models[choice[0]].nodes,
            &b = blanket.models[choice[1]].nodes;
      EXPECT_NE(std::ranges::find_first_of(a, b), a.end());
    }
    EXPECT_EQ(edges, expected);
    const BlanketProjection projection(blanket, Projection::eigen);
    const RecoveryProblem problem = projection.problem(blanket, chosen);
    const RecoveryResult result = ClosedForm().recover(problem);
    EXPECT_THAT(result.kld, Le(ClosedForm().recover(projection.problem(blanket, tree)).kld + 1e-9));
    EXPECT_THAT(result.kld, DoubleNear(kld(blanket, chosen), 1e-9));
    EXPECT_THAT(result.kld, DoubleNear(dense_kld(problem, informations(problem, result)), 1e-8));
  }
  EXPECT_THAT(paired, Gt(40));
}

/// The KLD of a tree in closed form and one more pair, which gets the best it can while the tree
/// stays: Φ − (J Υ⁻¹ Jᵀ)⁻¹ (T 4.13), in coordinates in which both can be diagonal.
double with_one_more(const DenseBlanket& blanket, const std::vector<FactorChoice>& tree,
                     const FactorChoice& more) {
  const int d = blanket.size();
  const BlanketProjection projection(blanket, Projection::eigen);
  const Matrix T = coordinates(projection, d);
  Matrix Upsilon = Matrix::Zero(T.cols(), T.cols());
  for (const FactorChoice& choice : tree) {
    const Matrix J = jacobian(blanket.models[choice.front()], d) * T;
    Upsilon += J.transpose() * (J * J.transpose()).inverse() * J;
  }
  const Matrix J = jacobian(blanket.models[more.front()], d) * T;
  const Matrix B = (J * Upsilon.inverse() * J.transpose()).inverse();
  // A = J Jᵀ: minimise tr(Ω A) − ln |B + Ω|; with A V = B⁻¹ V diag(β), Vᵀ B V = I.
  const Matrix A = J * J.transpose(), B_inverse = B.inverse();
  const Matrix half = B.llt().matrixL();
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(half.transpose() * A * half);
  Vector gains = eigen.eigenvalues();
  // Ω = half V diag(w) Vᵀ halfᵀ: Σ w α − ln(1 + w), least at w = 1/α − 1, or at 0.
  for (double& alpha : gains) alpha = alpha < 1.0 ? 1.0 / alpha - 1.0 : 0.0;
  const Matrix Omega = half * eigen.eigenvectors() * gains.asDiagonal() *
                       eigen.eigenvectors().transpose() * half.transpose();
  return dense_kld(Upsilon + J.transpose() * Omega * J);
}

TEST_F(Topologies, EkldTakesThePairThatGainsMost) {
  int seen = 0;
  for (const DenseBlanket& blanket : some(3, 7)) {
    const std::vector<FactorChoice> tree = ChowLiuTree(TopologyOptions{}).choose(blanket, 0);
    const std::vector<FactorChoice> chosen =
        ExpectedDivergence(TopologyOptions{}).choose(blanket, static_cast<int>(tree.size()) + 1);
    ASSERT_EQ(chosen.size(), tree.size() + 1);
    EXPECT_TRUE(std::equal(tree.begin(), tree.end(), chosen.begin()));
    double least = std::numeric_limits<double>::infinity();
    for (const FactorChoice& choice : every_model(blanket)) {
      if (std::ranges::find(tree, choice) == tree.end())
        least = std::min(least, with_one_more(blanket, tree, choice));
    }
    EXPECT_THAT(with_one_more(blanket, tree, chosen.back()), DoubleNear(least, 1e-8));
    ++seen;
  }
  EXPECT_THAT(seen, Gt(20));
}

/// Taken off by (T 4.23), or exactly: other choices, that keep more than the tree does.
TEST_F(Topologies, BothDowndatesAddToTheTree) {
  int better = 0, all = 0;
  for (const DenseBlanket& blanket : some(4, 6)) {
    const std::vector<FactorChoice> tree = ChowLiuTree(TopologyOptions{}).choose(blanket, 0);
    for (const Downdate how : {Downdate::sum, Downdate::exact}) {
      const std::vector<FactorChoice> chosen =
          DowndatedInformation(DowndatedInformationOptions{.downdate = how})
              .choose(blanket, static_cast<int>(tree.size()) + 2);
      ASSERT_EQ(chosen.size(), tree.size() + 2);
      EXPECT_TRUE(std::equal(tree.begin(), tree.end(), chosen.begin()));
      const double with = kld(blanket, chosen), without = kld(blanket, tree);
      EXPECT_THAT(with, Le(without + 1e-8));
      better += with < without - 1e-6;
      ++all;
    }
  }
  EXPECT_THAT(better, Gt(all / 2));
}

}  // namespace
}  // namespace cairn::sparsify
