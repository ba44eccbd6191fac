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

#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "sparsify.hpp"
#include "sparsify/sparsifier/world.hpp"

namespace cairn::sparsify {
namespace {

using testing::AllOf;
using testing::DoubleNear;
using testing::Gt;
using testing::HasSubstr;
using testing::IsEmpty;
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

/// Of the factors that came, from what the blanket of node 4 alone says, by dense matrices.
double of_the_blanket_alone(const World& world, const Sparsification& change) {
  Graph alone;
  const LocalProblem local = crop(WorkGraph(world.graph), world.indices({4}));
  for (const int v : local.blanket)
    alone.add_variable(world.graph.variable(v).type, world.graph.id(v), world.graph.state(v));
  for (const Factor& factor : change.factors) {
    std::vector<int> on;
    for (const Id id : factor.variables) on.push_back(alone.find(id).value());
    alone.add_factor(factor.type, on, factor.measurement, factor.information);
  }
  const DenseBlanket blanket = world.blanket({4});
  const Eigen::Map<const Matrix> L(blanket.information.data(), blanket.size(), blanket.size());
  return dense_divergence(L, marginal_of(alone, alone));
}

// Also where all of them have been scaled.
TEST_P(FitToTheGraph, ReportsTheDivergenceOfTheFactorsThatItAdds) {
  for (const bool landmarks : {false, true}) {
    double apart = 0.0;
    for (unsigned seed = 1; seed < 6; ++seed) {
      World world(GetParam(), seed);
      fill(world, landmarks, seed % 2 == 0);
      const Sparsification own = world.removal({4}, with("blanket")),
                           scaled = world.removal({4}, with("scaled")),
                           whole = world.removal({4}, with("graph"));
      for (const Sparsification* change : {&own, &scaled}) {
        const double expected = of_the_blanket_alone(world, *change);
        EXPECT_THAT(change->kld, DoubleNear(expected, 1e-8 * (1.0 + expected))) << seed;
      }
      apart += scaled.kld - own.kld;
      Graph sparse = world.graph.clone();
      apply(whole, sparse);
      const double expected = divergence(world.graph, sparse);
      EXPECT_THAT(whole.kld, DoubleNear(expected, 1e-6 * (1.0 + expected))) << seed;
    }
    EXPECT_THAT(apart, Gt(1e-3)) << landmarks;
  }
}

// The information that was found for the factors alone is the minimum, and what is scaled is not.
TEST_P(FitToTheGraph, ReportsTheGradientOfTheFactorsThatItAdds) {
  World world(GetParam(), 2);
  fill(world, false);
  Registry registry;
  double gradient = 0.0;
  for (const char* fit : {"blanket", "scaled"}) {
    const auto sparsifier = registry.make<Sparsifier>(with(fit));
    sparsifier->observe(
        [&](const SparsificationRecord& record) { gradient = record.recovery->gradient; });
    sparsifier->remove(world.graph, world.indices({4}));
    if (fit == std::string("blanket"))
      EXPECT_THAT(gradient, Lt(1e-8));
    else
      EXPECT_THAT(gradient, Gt(1e-4));
  }
}

// population=loss: the bound is one of what is added.
TEST_P(FitToTheGraph, BoundsTheDivergenceOfTheFactorsThatItAdds) {
  World world(GetParam(), 3);
  fill(world, false);
  const std::string scaled = "sparsify:fit=scaled,population=loss:";
  const double tree = world.removal({4}, scaled + "1000").kld,
               alone = world.removal({4}, "sparsify:population=loss:1000").kld;
  ASSERT_THAT(tree, Gt(alone));
  const double bound = 0.5 * (tree + alone);
  EXPECT_THAT(world.removal({4}, scaled + std::to_string(bound)).kld, Lt(bound));
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

// Before there is a graph.
TEST(Fit, IsRefusedWhereItCannotBeFollowed) {
  Registry registry;
  const auto refusal = [&](const std::string& options) -> std::string {
    try {
      registry.make<Sparsifier>("sparsify:" + options);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::usage) << options;
      return error.what();
    }
    return {};
  };
  for (const char* recovery : {"ip", "pqn", "closed_form", "fd:conservative=true"})
    EXPECT_THAT(refusal(std::string("fit=graph,recovery=") + recovery),
                AllOf(HasSubstr("fit=graph"), HasSubstr(recovery), HasSubstr("take ncfd or fd")));
  for (const char* fit : {"fit=scaled", "fit=graph"}) {
    EXPECT_THAT(refusal(std::string(fit) + ",topology=glc"),
                AllOf(HasSubstr(fit), HasSubstr("leave fit at blanket")));
    EXPECT_THAT(refusal(std::string(fit) + ",linear_solver=jacobi"),
                AllOf(HasSubstr(fit), HasSubstr("take linear_solver=block_cholesky")));
    EXPECT_THAT(refusal(fit), IsEmpty());
  }
  EXPECT_THAT(refusal("fit=scaled,recovery=ip"), IsEmpty());
  EXPECT_THAT(refusal("topology=glc,linear_solver=jacobi"), IsEmpty());
  SparsifyOptions options;
  options.fit = Fit::scaled;
  EXPECT_THROW(Sparsify(registry.make<Topology>("ekld"), registry.make<FactorRecovery>("ncfd"),
                        options, nullptr),
               Error);
}

// Two poses beside the map, all but one number of whose relative pose is open.
TEST_P(FitToTheGraph, NotesWhereItIsThatOfTheBlanket) {
  World world(GetParam(), 1);
  fill(world, false);
  for (const Id id : {20, 21}) world.pose(id);
  EXPECT_THAT(world.removal({4}, with("graph")).notes, IsEmpty());
  const auto type = world.graph.factor(0).type;
  const auto z = world.graph.measurement(0);
  std::vector<double> nothing(world.graph.information(0).size());
  nothing.front() = 1.0;
  world.graph.add_factor(type, world.indices({20, 21}), std::vector<double>(z.begin(), z.end()),
                         nothing);
  for (const char* fit : {"scaled", "graph"}) {
    const Sparsification change = world.removal({4, 1}, with(fit));
    ASSERT_THAT(change.notes, testing::SizeIs(1)) << fit;
    EXPECT_THAT(change.notes[0].text, HasSubstr("the whole graph is singular"));
    EXPECT_EQ(change.notes[0].problems, 2);
    EXPECT_EQ(change.kld, world.removal({4, 1}, with("blanket")).kld);
  }
  EXPECT_THAT(world.removal({4}, with("blanket")).notes, IsEmpty());
}

TEST_P(FitToTheGraph, CountsItsTimeByItself) {
  World world(GetParam(), 1);
  fill(world, false);
  EXPECT_EQ(world.removal({4}, with("blanket")).seconds.covariance, 0.0);
  const SparsificationSeconds seconds = world.removal({4}, with("graph")).seconds;
  EXPECT_THAT(seconds.covariance, Gt(0.0));
  EXPECT_LE(seconds.marginalize + seconds.covariance + seconds.topology + seconds.recovery,
            seconds.total);
}

INSTANTIATE_TEST_SUITE_P(PlaneAndSpace, FitToTheGraph, testing::Values(2, 3));

}  // namespace
}  // namespace cairn::sparsify
