// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/correlated_pair.hpp"

#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <random>
#include <vector>

#include <Eigen/Dense>

#include "cairn/runtime/error.hpp"
#include "support/dense_system.hpp"
#include "support/planar_graph.hpp"

namespace cairn {
namespace {

using Eigen::MatrixXd;

/// Upper triangle, row by row.
std::vector<double> packed(const MatrixXd& A) {
  std::vector<double> upper;
  for (Eigen::Index r = 0; r < A.rows(); ++r) {
    for (Eigen::Index c = r; c < A.cols(); ++c) upper.push_back(A(r, c));
  }
  return upper;
}

Graph three_poses() {
  Graph graph;
  const auto pose = test::PlanarTypes().pose;
  for (int k = 0; k < 3; ++k)
    graph.add_variable(pose, k, std::vector<double>{0.7 * k, 0.3 * k * k, 0.5 - 0.4 * k});
  return graph;
}

const std::vector<double> kFirst{0.9, 0.1, -0.2}, kSecond{0.5, 1.1, 0.3};
const std::vector<double> kBoth{0.9, 0.1, -0.2, 0.5, 1.1, 0.3};

/// Of blocks, a pair is the two factors that it is made of, whichever way these point.
TEST(CorrelatedPair, WithoutCorrelationIsItsTwoFactors) {
  const auto relative = test::PlanarTypes().relative_pose;
  const MatrixXd A = 2.0 * MatrixXd::Identity(3, 3), B = MatrixXd::Ones(3, 3) + A;
  MatrixXd both = MatrixXd::Zero(6, 6);
  both.topLeftCorner(3, 3) = A;
  both.bottomRightCorner(3, 3) = B;
  using Ends = std::array<int, 2>;
  for (const auto& [first, second] : std::vector<std::pair<Ends, Ends>>{
           {{0, 1}, {1, 2}}, {{0, 1}, {0, 2}}, {{1, 0}, {2, 1}}, {{2, 0}, {2, 1}}}) {
    Graph apart = three_poses(), together = three_poses();
    apart.add_factor(relative, first, kFirst, packed(A));
    apart.add_factor(relative, second, kSecond, packed(B));
    together.add_factor(std::make_shared<CorrelatedPair>(relative, first, second),
                        std::vector<int>{0, 1, 2}, kBoth, packed(both));
    const std::vector<bool> held{true, false, false};
    const auto a = test::dense_system(apart, held), b = test::dense_system(together, held);
    EXPECT_LT((a.H - b.H).norm(), 1e-12 * a.H.norm());
    EXPECT_LT((a.g - b.g).norm(), 1e-12 * a.g.norm());
    const std::vector<double> norms = squared_norms(apart);
    EXPECT_NEAR(norms[0] + norms[1], squared_norms(together)[0], 1e-12);
  }
}

TEST(CorrelatedPair, WithCorrelationWeighsAsItsMatrixSays) {
  std::mt19937_64 engine(3);
  std::normal_distribution<double> normal;
  MatrixXd R(6, 6);
  for (double& x : R.reshaped()) x = normal(engine);
  const MatrixXd information = R * R.transpose() + MatrixXd::Identity(6, 6);
  const auto relative = test::PlanarTypes().relative_pose;
  const CorrelatedPair pair(relative, {0, 1}, {1, 2});
  const Graph graph = three_poses();
  const double* const x[] = {graph.state(0).data(), graph.state(1).data(), graph.state(2).data()};
  const std::vector<double> plain = packed(MatrixXd::Identity(6, 6));
  const std::vector<double> root = packed(MatrixXd(information.llt().matrixU()));
  Eigen::VectorXd error(6), residual(6);
  pair.evaluate(x, kBoth.data(), plain.data(), error.data(), nullptr);
  std::array<MatrixXd, 3> J;
  double* out[3];
  for (std::size_t k = 0; k < 3; ++k) {
    J[k].resize(6, 3);
    out[k] = J[k].data();
  }
  pair.evaluate(x, kBoth.data(), root.data(), residual.data(), out);
  EXPECT_NEAR(residual.squaredNorm(), error.dot(information * error), 1e-9);
  // The first measurement has nothing to do with the third pose: before whitening.
  const MatrixXd unwhitened = MatrixXd(information.llt().matrixU()).inverse() * J[2];
  EXPECT_LT(unwhitened.topRows(3).norm(), 1e-12);
}

TEST(CorrelatedPair, PlacesAPoseByEither) {
  const auto relative = test::PlanarTypes().relative_pose;
  const CorrelatedPair pair(relative, {0, 1}, {0, 2});
  const Graph graph = three_poses();
  const double* const x[] = {graph.state(0).data(), graph.state(1).data(), graph.state(2).data()};
  std::vector<double> there(3);
  ASSERT_TRUE(pair.propagate(2, x, kBoth.data(), there.data()));
  const double* const ends[] = {x[0], there.data()};
  const std::vector<double> unit = packed(MatrixXd::Identity(3, 3));
  Eigen::Vector3d r;
  relative->evaluate(ends, kSecond.data(), unit.data(), r.data(), nullptr);
  EXPECT_LT(r.norm(), 1e-12);
}

TEST(CorrelatedPair, RefusesWhatIsNotBetweenThreePoses) {
  const auto relative = test::PlanarTypes().relative_pose;
  using Ends = std::array<int, 2>;
  EXPECT_THROW(CorrelatedPair(relative, Ends{0, 1}, Ends{1, 0}), Error);
  EXPECT_THROW(CorrelatedPair(relative, Ends{0, 0}, Ends{1, 2}), Error);
  EXPECT_THROW(CorrelatedPair(relative, Ends{0, 1}, Ends{1, 3}), Error);
  EXPECT_THROW(CorrelatedPair(test::PlanarTypes().prior, Ends{0, 1}, Ends{1, 2}), Error);
}

}  // namespace
}  // namespace cairn
