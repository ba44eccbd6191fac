// SPDX-License-Identifier: BSD-3-Clause
// The covariances that are kept against the inverse of H as the engine holds it.
#include "covariances.hpp"

#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <ostream>
#include <random>
#include <set>
#include <string>
#include <utility>

#include "cairn/plugin/registry.hpp"
#include "dense.hpp"
#include "engine.hpp"
#include "growing_graph.hpp"
#include "support/dense_algebra.hpp"

namespace cairn::incremental {
namespace {

using Eigen::MatrixXd;

struct Case {
  std::string name;
  GrowingTypes types;
  Happenings happenings;
};

std::vector<Case> cases() {
  std::vector<Case> all;
  for (const bool spatial : {false, true}) {
    const GrowingTypes types = spatial ? spatial_types() : planar_types();
    const std::string where = spatial ? "InSpace" : "InThePlane";
    all.push_back({"Loops" + where, types, {}});
    all.push_back({"Points" + where, types, {.points = true, .priors = true}});
    all.push_back({"Cuts" + where, types, {.cuts = true, .priors = true}});
    all.push_back(
        {"PointsNotCompacted" + where, types, {.points = true, .priors = true, .compacts = false}});
    all.push_back(
        {"CutsNotCompacted" + where, types, {.cuts = true, .priors = true, .compacts = false}});
  }
  return all;
}

void PrintTo(const Case& of, std::ostream* out) { *out << of.name; }

class KeptCovariances : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    if (!registry_.has("optimizer", "levenberg_marquardt"))
      GTEST_SKIP() << "there is no optimizer levenberg_marquardt";
    rescuer_->optimizer = registry_.make<Optimizer>("levenberg_marquardt");
  }
  MarginalsBy solve(Engine& engine) {
    UpdateReport report;
    engine.solve(0.0, report);
    EXPECT_TRUE(report.ok);
    relinearized_ = report.relinearized_factors;
    return engine.problem().update_covariances();
  }

  Registry registry_;
  std::shared_ptr<Rescuer> rescuer_ = std::make_shared<Rescuer>();
  int relinearized_ = 0;
};

/// The block of two variables in the inverse; zero where one is held.
MatrixXd block_of(const Engine& engine, const MatrixXd& Sigma, int a, int b) {
  const System& system = engine.problem().system;
  if (engine.problem().held(a) || engine.problem().held(b))
    return MatrixXd::Zero(system.size(a), system.size(b));
  return Sigma.block(system.offset(a), system.offset(b), system.size(a), system.size(b));
}

/// A block of the inverse, which is in the variables' frames, as seen from the poses.
MatrixXd seen_from_poses(Engine& engine, MatrixXd block, int a, int b) {
  const auto turn = [&](int v) -> MatrixXd {
    const int size = engine.problem().system.size(v);
    MatrixXd T = MatrixXd::Identity(size, size);
    if (engine.problem().states.type(v).lie_group())
      engine.problem().states.frame_to_body(v, engine.x(v).data(), T.data());
    return T;
  };
  return turn(a) * block * turn(b).transpose();
}

void expect_kept(Engine& engine, const std::vector<std::pair<int, int>>& crosses,
                 double tolerance) {
  const System& system = engine.problem().system;
  for (int v = 0; v < system.variables(); ++v) {
    if (engine.problem().live_variable(v)) {
      ASSERT_EQ(engine.problem().tree.node_of(v) < 0, engine.problem().held(v)) << v;
    }
  }
  const MatrixXd Sigma = test::inverse_of(dense(system, engine.problem().tree));
  double largest = 0.0;
  for (int v = 0; v < system.variables(); ++v) {
    if (engine.problem().live_variable(v))
      largest = std::max(largest, block_of(engine, Sigma, v, v).cwiseAbs().maxCoeff());
  }
  const auto expect = [&](int a, int b) {
    const double* kept = engine.problem().covariances.kept(a, b);
    ASSERT_NE(kept, nullptr) << a << ' ' << b;
    const MatrixXd wanted = block_of(engine, Sigma, a, b);
    const Eigen::Map<const MatrixXd> block(kept, wanted.rows(), wanted.cols());
    EXPECT_LE((block - wanted).cwiseAbs().maxCoeff(), tolerance * largest) << a << ' ' << b;
    MatrixXd asked(wanted.rows(), wanted.cols());
    ASSERT_TRUE(engine.covariance(a, b, asked.data()));
    const MatrixXd seen = seen_from_poses(engine, wanted, a, b);
    EXPECT_LE((asked - seen).cwiseAbs().maxCoeff(), 10.0 * tolerance * largest) << a << ' ' << b;
  };
  for (int v = 0; v < system.variables(); ++v) {
    if (engine.problem().live_variable(v)) expect(v, v);
  }
  for (const auto& [a, b] : crosses) {
    if (engine.problem().live_variable(a) && engine.problem().live_variable(b)) expect(a, b);
  }
}

TEST_P(KeptCovariances, AreThoseOfTheSystemAfterEveryChange) {
  std::map<MarginalsBy, int> by;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    Engine engine({}, rescuer_);
    engine.problem().covariances.keep(KeptMarginals::diagonal);
    GrowingGraph graph(GetParam().types, GetParam().happenings, seed);
    std::mt19937 rng(seed);
    std::set<std::pair<Id, Id>> crosses;
    for (int step = 0; step < 50; ++step) {
      for (unsigned k = 0; k < 1 + rng() % 2; ++k) graph.grow(engine);
      if (step % 10 == 5) {
        const auto any = [&] {
          const int v =
              static_cast<int>(rng() % static_cast<unsigned>(engine.graph().variable_count()));
          return engine.problem().live_variable(v) ? v : -1;
        };
        const int a = any(), b = any();
        if (a >= 0 && b >= 0 && a != b) {
          engine.problem().covariances.keep(a, b);
          crosses.insert({engine.graph().id(a), engine.graph().id(b)});
        }
      }
      const MarginalsBy now = solve(engine);
      ++by[now];
      std::vector<std::pair<int, int>> pairs;
      for (const auto& [a, b] : crosses) {
        const auto found_a = engine.graph().find(a), found_b = engine.graph().find(b);
        if (found_a && found_b) pairs.emplace_back(*found_a, *found_b);
      }
      expect_kept(engine, pairs, 1e-9);
      ASSERT_FALSE(HasFailure()) << to_string(now) << ", seed " << seed << ", step " << step
                                 << ":\n"
                                 << graph.log();
    }
  }
  EXPECT_GT(by[MarginalsBy::downdate], 0);
  EXPECT_GT(by[MarginalsBy::recomputation], 0);
  EXPECT_EQ(by[MarginalsBy::none], 0);
}

TEST_P(KeptCovariances, AreDowndatedForFewFactorsAndRecomputedForMany) {
  Engine engine({}, rescuer_);
  engine.problem().covariances.keep(KeptMarginals::diagonal);
  GrowingGraph graph(GetParam().types, {}, 3);
  for (int k = 0; k < 40; ++k) graph.add_pose(engine);
  EXPECT_EQ(solve(engine), MarginalsBy::recomputation) << "there was nothing to start from";
  EXPECT_EQ(solve(engine), MarginalsBy::unchanged);
  graph.add_pose(engine);
  EXPECT_EQ(solve(engine), MarginalsBy::downdate) << "one more pose";
  expect_kept(engine, {}, 1e-9);
  int downdates = 0;
  for (int k = 0; k < 20; ++k) {
    graph.add_loop(engine);
    const MarginalsBy by = solve(engine);
    if (relinearized_ > 30) {
      EXPECT_EQ(by, MarginalsBy::recomputation) << k;
    }
    downdates += by == MarginalsBy::downdate;
    expect_kept(engine, {}, 1e-9);
  }
  EXPECT_GT(downdates, 5);
  UpdateReport report;
  engine.solve_fully(report);
  // Near the minimum, what was linearised first does until it is linearised there.
  EXPECT_EQ(report.relinearized_factors, 2 * engine.graph().factor_count());
  EXPECT_GT(report.iterations, 2);
  EXPECT_EQ(engine.problem().update_covariances(), MarginalsBy::recomputation);
  expect_kept(engine, {}, 1e-9);
}

TEST_P(KeptCovariances, AreSolvedForWhereTheyAreNotKept) {
  Engine engine({}, rescuer_);
  GrowingGraph graph(GetParam().types, GetParam().happenings, 4);
  for (int k = 0; k < 40; ++k) {
    graph.grow(engine);
    EXPECT_EQ(solve(engine), MarginalsBy::none);
  }
  const MatrixXd Sigma = test::inverse_of(dense(engine.problem().system, engine.problem().tree));
  const int n = engine.problem().system.variables();
  std::vector<std::int32_t> rows;
  for (int v = 0; v < n; ++v) {
    if (engine.problem().live_variable(v)) rows.push_back(v);
  }
  for (const std::int32_t b : rows) {
    Eigen::Index height = 0;
    for (const std::int32_t a : rows) height += engine.problem().system.size(a);
    MatrixXd column(height, engine.problem().system.size(b));
    ASSERT_TRUE(engine.covariance_column(rows, b, column.data()));
    Eigen::Index row = 0;
    for (const std::int32_t a : rows) {
      const MatrixXd wanted = seen_from_poses(engine, block_of(engine, Sigma, a, b), a, b);
      MatrixXd block(wanted.rows(), wanted.cols());
      ASSERT_TRUE(engine.covariance(a, b, block.data()));
      EXPECT_LE((block - wanted).norm(), 1e-9 * Sigma.norm()) << a << ' ' << b;
      EXPECT_LE((column.middleRows(row, wanted.rows()) - wanted).norm(), 1e-9 * Sigma.norm());
      row += wanted.rows();
    }
  }
}

// Loops far apart change nothing before the first of their poses, and little elsewhere: subtrees
// are left out of a downdate, and what they keep must be as right as the rest, each beside its own
// size.
TEST_P(KeptCovariances, OfALongWalkAreRightWhereDowndatesLeaveThemOut) {
  Engine engine({}, rescuer_);
  engine.problem().covariances.keep(KeptMarginals::diagonal);
  GrowingGraph graph(GetParam().types, {.noise = 0.003}, 5);
  int downdates = 0;
  for (int k = 0; k < 160; ++k) {
    graph.add_pose(engine);
    if (k % 12 == 11) graph.add_loop(engine);
    downdates += solve(engine) == MarginalsBy::downdate;
  }
  EXPECT_GT(downdates, 120);
  const MatrixXd Sigma = test::inverse_of(dense(engine.problem().system, engine.problem().tree));
  for (int v = 0; v < engine.problem().system.variables(); ++v) {
    if (engine.problem().held(v)) continue;
    const MatrixXd wanted = block_of(engine, Sigma, v, v);
    const Eigen::Map<const MatrixXd> kept(engine.problem().covariances.kept(v, v), wanted.rows(),
                                          wanted.cols());
    EXPECT_LE((kept - wanted).norm(), 1e-8 * wanted.norm()) << v;
  }
}

// Where a loop says much more than was known, U has lost its digits.
TEST_P(KeptCovariances, AreRecomputedWhereADowndateIsGivenUp) {
  Engine engine({}, rescuer_);
  engine.problem().covariances.keep(KeptMarginals::diagonal);
  GrowingGraph graph(GetParam().types, {}, 6);
  for (int round = 0; round < 4; ++round) {
    for (int k = 0; k < 15; ++k) graph.add_pose(engine);
    solve(engine);
    graph.add_precise_loop(engine, 1e5);
    EXPECT_EQ(solve(engine), MarginalsBy::recomputation);
    EXPECT_EQ(relinearized_, 0) << "it was given up for the number of rows";
    expect_kept(engine, {}, 1e-7);
    graph.add_precise_loop(engine, 1.0);
    EXPECT_EQ(solve(engine), MarginalsBy::downdate);
    expect_kept(engine, {}, 1e-7);
  }
}

INSTANTIATE_TEST_SUITE_P(Random, KeptCovariances, testing::ValuesIn(cases()),
                         [](const auto& named) { return named.param.name; });

}  // namespace
}  // namespace cairn::incremental
