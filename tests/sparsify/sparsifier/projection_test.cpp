// SPDX-License-Identifier: BSD-3-Clause
// BlanketProjection in which the dense Gaussian is N(0, I).
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "blanket_matrices.hpp"
#include "cairn/runtime/error.hpp"
#include "recovery.hpp"
#include "sparsify/sparsifier/blankets.hpp"
#include "topologies.hpp"

namespace cairn::sparsify {
namespace {

using testing::DoubleNear;
using testing::Gt;
using testing::Lt;

class Projections : public testing::Test {
 protected:
  /// Blankets of simulated worlds and random ones, in the plane and in space.
  std::vector<DenseBlanket> some() {
    std::vector<DenseBlanket> all =
        blankets(solved(registry, "manhattan:poses=300,loop_density=0.5"), 1, 9, 2, 9);
    for (DenseBlanket& one :
         blankets(solved(registry, "sphere:turns=6,poses_per_turn=12"), 2, 7, 2, 8))
      all.push_back(std::move(one));
    Draw draw(1);
    for (const int dimension : {2, 3}) {
      for (int nodes = 2; nodes < 7; ++nodes)
        all.push_back(random_blanket(registry, dimension, nodes, draw, nodes));
    }
    return all;
  }
  Registry registry;
};

TEST_F(Projections, TheDenseGaussianIsTheUnitOne) {
  const std::vector<DenseBlanket> all = some();
  EXPECT_THAT(all.size(), Gt(40U));
  for (const DenseBlanket& blanket : all) {
    const Matrix L = information(blanket);
    const int r = blanket.size() - blanket.node_sizes.front();
    for (const Projection projection : {Projection::eigen, Projection::node}) {
      const BlanketProjection found(blanket, projection);
      const Matrix T = coordinates(found, blanket.size());
      ASSERT_EQ(found.rank, r);
      ASSERT_EQ(T.rows(), blanket.size());
      EXPECT_THAT(apart(T.transpose() * L * T, Matrix::Identity(r, r)), Lt(1e-8));
      // Nothing of Λ is lost: Λ T Tᵀ Λ = Λ.
      EXPECT_THAT(apart(L * T * T.transpose() * L, L), Lt(1e-8));
    }
  }
}

TEST_F(Projections, GiveTheSameKld) {
  for (const DenseBlanket& blanket : some()) {
    const int nodes = static_cast<int>(std::ssize(blanket.node_sizes));
    const std::vector<FactorChoice> topology =
        MutualInformation(TopologyOptions{}).choose(blanket, 2 * (nodes - 1));
    const auto kld = [&](Projection projection) {
      return InteriorPoint({.recovery = {.tolerance = 1e-6}})
          .recover(BlanketProjection(blanket, projection).problem(blanket, topology))
          .kld;
    };
    EXPECT_THAT(kld(Projection::eigen), DoubleNear(kld(Projection::node), 1e-8));
  }
}

/// The recovered factors, put back into the nodes' own coordinates, are as far from Λ.
TEST_F(Projections, TheKldIsThatOfTheNodes) {
  for (const DenseBlanket& blanket : some()) {
    const int d = blanket.size(), t = blanket.node_sizes.front(), r = d - t;
    const std::vector<FactorChoice> topology = ChowLiuTree(TopologyOptions{}).choose(blanket, 0);
    const RecoveryResult result = ClosedForm().recover(
        BlanketProjection(blanket, Projection::eigen).problem(blanket, topology));
    Matrix sparse = Matrix::Zero(d, d);
    for (std::size_t k = 0; k < topology.size(); ++k) {
      const FactorModel& model = blanket.models[topology[k].front()];
      const auto J = jacobian(model, d);
      sparse += J.transpose() * information(result, static_cast<int>(k), model.size) * J;
    }
    // The last node held instead of the first.
    const Matrix dense = information(blanket).topLeftCorner(r, r);
    const Matrix held = sparse.topLeftCorner(r, r);
    const double expected = 0.5 * (dense.ldlt().solve(held).trace() - log_determinant_of(held) +
                                   log_determinant_of(dense) - r);
    EXPECT_THAT(result.kld, DoubleNear(expected, 1e-7));
  }
}

TEST_F(Projections, OffDiagonalBlocksAreTheInformationWhereAllPairsAreFactors) {
  Draw draw(7);
  for (const int dimension : {2, 3}) {
    DenseBlanket blanket = random_blanket(registry, dimension, 5, draw);
    const std::vector<FactorChoice> all = every_model(blanket);
    std::vector<Matrix> Omega;
    for (const FactorModel& model : blanket.models)
      Omega.push_back(10.0 * draw.definite(model.size));
    set_information(blanket, all, Omega);
    const RecoveryProblem problem =
        BlanketProjection(blanket, Projection::eigen).problem(blanket, all);
    for (std::size_t k = 0; k < all.size(); ++k) {
      const RecoveryProblem::Factor& factor = problem.factors[k];
      ASSERT_FALSE(factor.off_diagonal.empty());
      const Eigen::Map<const Matrix> guess(factor.off_diagonal.data(), factor.size, factor.size);
      EXPECT_THAT(apart(guess, Omega[k]), Lt(1e-8));
    }
  }
}

TEST_F(Projections, RefuseWhatTheyCannotDo) {
  Draw draw(8);
  DenseBlanket nothing = random_blanket(registry, 2, 3, draw);
  std::ranges::fill(nothing.information, 0.0);
  EXPECT_THROW(BlanketProjection(nothing, Projection::eigen), Error);
  EXPECT_THROW(BlanketProjection(nothing, Projection::node), Error);
  // Two nodes are related, the third is not.
  DenseBlanket parts = random_blanket(registry, 2, 3, draw);
  set_information(parts, {{0}}, {draw.definite(3)});
  EXPECT_EQ(BlanketProjection(parts, Projection::eigen).rank, 3);
  EXPECT_THROW(BlanketProjection(parts, Projection::node), Error);
}

}  // namespace
}  // namespace cairn::sparsify
