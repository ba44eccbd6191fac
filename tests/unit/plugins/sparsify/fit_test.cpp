// SPDX-License-Identifier: BSD-3-Clause
// The covariance that the information of new factors is fitted to: of the blanket alone, or in the
// whole graph. Against dense algebra of whole graphs.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "cairn/runtime/error.hpp"
#include "unit/plugins/sparsify/world.hpp"

namespace cairn::sparsify {
namespace {

using testing::DoubleNear;
using testing::Gt;
using testing::HasSubstr;
using testing::Lt;

class FitToTheGraph : public testing::TestWithParam<int> {
 protected:
  /// Poses in a row that are related to the next two, with loop closures; 4 sees others besides,
  /// and all see the landmarks.
  static void fill(World& world, bool landmarks, bool absolute = false) {
    constexpr Id kPoses = 9;
    for (Id id = 0; id < kPoses; ++id) world.pose(id);
    for (Id id = 0; id + 1 < kPoses; ++id) world.relate(id, id + 1);
    for (const Id id : {0, 1, 7, 8}) world.relate(id, 4);
    world.relate(0, 8);
    world.relate(1, 7);
    if (landmarks) {
      for (const Id id : {100, 101}) {
        world.landmark(id);
        for (Id pose = 0; pose < kPoses; ++pose) world.observe(pose, id);
      }
    }
    if (absolute) world.place(4);
  }
  static std::string with(const std::string& fit, const std::string& more = "") {
    return "sparsify:fit=" + fit + ",recovery=ncfd:tolerance=1e-9,topology=clt" + more;
  }
  /// tr Λ̆ Λ⁺ / r: the expected squared error of the sparse graph in units of its information, for
  /// each degree of freedom.
  static double expected_error(const Graph& whole, const Graph& sparse) {
    const Matrix L = marginal_of(whole, sparse), approximated = marginal_of(sparse, sparse);
    const Eigen::SelfAdjointEigenSolver<Matrix> eigen(L);
    double sum = 0.0, rank = 0.0;
    for (Eigen::Index k = 0; k < L.rows(); ++k) {
      if (eigen.eigenvalues()[k] < 1e-9 * eigen.eigenvalues()[L.rows() - 1]) continue;
      const Vector v = eigen.eigenvectors().col(k);
      sum += v.dot(approximated * v) / eigen.eigenvalues()[k];
      rank += 1.0;
    }
    return sum / rank;
  }
  static double divergence(const Graph& whole, const Graph& sparse) {
    return dense_divergence(marginal_of(whole, sparse), marginal_of(sparse, sparse));
  }
};

// One node leaves; the tree is not exact, and what the rest of the graph knows is not what the
// blanket does.
TEST_P(FitToTheGraph, ScaledIsAsCertainAsTheWholeWas) {
  for (const bool landmarks : {false, true}) {
    double apart = 0.0;
    for (unsigned seed = 1; seed < 6; ++seed) {
      World world(GetParam(), seed);
      fill(world, landmarks);
      EXPECT_THAT(expected_error(world.graph, world.without({4}, with("scaled"))),
                  DoubleNear(1.0, 1e-9));
      apart += std::abs(expected_error(world.graph, world.without({4}, with("blanket"))) - 1.0);
    }
    EXPECT_THAT(apart, Gt(0.01)) << landmarks;
  }
}

TEST_P(FitToTheGraph, HasTheLeastDivergenceOfTheWhole) {
  for (const bool absolute : {false, true}) {
    for (unsigned seed = 1; seed < 6; ++seed) {
      World world(GetParam(), seed);
      fill(world, seed % 2 == 0, absolute);
      const double own = divergence(world.graph, world.without({4}, with("blanket"))),
                   scaled = divergence(world.graph, world.without({4}, with("scaled")));
      Graph best = world.without({4}, with("graph"));
      const double least = divergence(world.graph, best);
      EXPECT_THAT(least, Lt(own)) << seed;
      EXPECT_THAT(least, Lt(scaled)) << seed;
      // No new factor can be given more or less information, and the divergence be less.
      const Graph removed = world.graph.clone();
      for (int f = 0; f < best.factor_count(); ++f) {
        const auto old = best.information(f);
        const std::vector<double> information(old.begin(), old.end());
        bool fresh = true;
        for (int k = 0; fresh && k < removed.factor_count(); ++k)
          fresh = !std::ranges::equal(removed.information(k), information);
        if (!fresh) continue;
        for (const double scale : {0.99, 1.01}) {
          std::vector<double> other = information;
          for (double& x : other) x *= scale;
          Graph changed;
          for (int v = 0; v < best.variable_count(); ++v)
            changed.add_variable(best.variable(v).type, best.id(v), best.state(v));
          for (int k = 0; k < best.factor_count(); ++k) {
            changed.add_factor(best.factor(k).type, best.factor_variables(k), best.measurement(k),
                               k == f ? std::span<const double>(other) : best.information(k));
          }
          EXPECT_THAT(divergence(world.graph, changed), Gt(least)) << seed << " " << f;
        }
      }
    }
  }
}

// Where there is no rest of the graph all are the same.
TEST_P(FitToTheGraph, IsThatOfTheBlanketWhereNothingElseIsMeasured) {
  World world(GetParam(), 3);
  for (Id id = 0; id < 5; ++id) world.pose(id);
  for (Id id = 1; id < 5; ++id) world.relate(0, id);
  world.relate(1, 2);
  const double own = divergence(world.graph, world.without({0}, with("blanket")));
  EXPECT_THAT(own, Gt(1e-3));
  for (const char* fit : {"scaled", "graph"})
    EXPECT_THAT(divergence(world.graph, world.without({0}, with(fit))), DoubleNear(own, 1e-6))
        << fit;
}

TEST_P(FitToTheGraph, IsNotForMethodsThatKnowNoRest) {
  World world(GetParam(), 1);
  fill(world, false);
  for (const char* recovery : {"ip", "pqn", "closed_form", "ncfd:conservative=true"}) {
    try {
      world.without({4}, std::string("sparsify:fit=graph,topology=clt,recovery=") + recovery);
      ADD_FAILURE() << recovery;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::usage);
      EXPECT_THAT(error.what(), HasSubstr("fit=graph"));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(PlaneAndSpace, FitToTheGraph, testing::Values(2, 3));

}  // namespace
}  // namespace cairn::sparsify
