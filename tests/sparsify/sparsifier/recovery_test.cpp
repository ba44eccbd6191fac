// SPDX-License-Identifier: BSD-3-Clause
// Factor recovery: all methods end at the same minimum, which is one.
#include "recovery.hpp"

#include <functional>
#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "cairn/runtime/error.hpp"
#include "sparsify/sparsifier/blankets.hpp"
#include "topologies.hpp"

namespace cairn::sparsify {
namespace {

using testing::DoubleNear;
using testing::Ge;
using testing::Gt;
using testing::Le;
using testing::Lt;

std::unique_ptr<FactorRecovery> method(const std::string& name, const RecoveryOptions& options) {
  if (name == "fd") return std::make_unique<FactorDescent>(options, false);
  if (name == "ncfd") return std::make_unique<FactorDescent>(options, true);
  if (name == "ip")
    return std::make_unique<InteriorPoint>(InteriorPointOptions{.recovery = options});
  return std::make_unique<ProjectedQuasiNewton>(ProjectedQuasiNewtonOptions{.recovery = options});
}
const std::vector<std::string> kMethods{"fd", "ncfd", "ip", "pqn"};

std::vector<FactorChoice> populated(const DenseBlanket& blanket, double times = 2.0) {
  const auto tree = static_cast<double>(blanket.node_sizes.size() - 1);
  return MutualInformation(TopologyOptions{}).choose(blanket, static_cast<int>(times * tree));
}

RecoveryProblem problem_of(const DenseBlanket& blanket, const std::vector<FactorChoice>& topology) {
  return BlanketProjection(blanket, Projection::eigen).problem(blanket, topology);
}

class Recovery : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    registry = std::make_unique<Registry>();
    blankets_ = std::make_unique<std::vector<DenseBlanket>>();
    const auto take = [&](std::vector<DenseBlanket> some, std::size_t most) {
      for (std::size_t k = 0; k < std::min(most, some.size()); ++k)
        blankets_->push_back(std::move(some[k]));
    };
    const Graph streets = solved(*registry, "manhattan:poses=600,loop_density=0.5");
    take(blankets(streets, 1, 2, 3, 12), 80);
    take(blankets(streets, 3, 5, 4, 12), 70);
    const Graph globe = solved(*registry, "sphere:turns=8,poses_per_turn=14");
    take(blankets(globe, 1, 3, 3, 6), 25);
    take(blankets(globe, 2, 3, 4, 8), 25);
  }
  static void TearDownTestSuite() {
    blankets_.reset();
    registry.reset();
  }
  static std::unique_ptr<Registry> registry;
  static std::unique_ptr<std::vector<DenseBlanket>> blankets_;
};
std::unique_ptr<Registry> Recovery::registry;
std::unique_ptr<std::vector<DenseBlanket>> Recovery::blankets_;

void expect_possible(const RecoveryProblem& problem, const RecoveryResult& result) {
  const std::vector<Matrix> Omega = informations(problem, result);
  const ScaledProblem scaled(problem);
  for (int k = 0; k < scaled.factors(); ++k) {
    EXPECT_EQ(apart(Omega[k], Omega[k].transpose()), 0.0);
    EXPECT_EQ(Omega[k].llt().info(), Eigen::Success);
    EXPECT_THAT(least_eigenvalue(scaled.scaled(k, Omega[k])), Ge(0.5 * kFloor));
  }
  EXPECT_THAT(result.kld, Ge(-1e-10));
  EXPECT_THAT(result.kld, DoubleNear(dense_kld(problem, Omega), 1e-8));
}

TEST_F(Recovery, AllMethodsFindTheSameMinimum) {
  ASSERT_EQ(blankets_->size(), 200U);
  for (std::size_t b = 0; b < blankets_->size(); ++b) {
    const DenseBlanket& blanket = (*blankets_)[b];
    const RecoveryProblem problem = problem_of(blanket, populated(blanket));
    SCOPED_TRACE(testing::Message() << "blanket " << b << " of " << blanket.node_sizes.size()
                                    << " nodes, d = " << blanket.size());
    const double kld = method("ip", {.tolerance = 1e-6})->recover(problem).kld;
    for (const std::string& name : kMethods) {
      const double tolerance = name == "pqn" ? 1e-5 : 1e-6;
      const RecoveryResult result =
          method(name, {.tolerance = tolerance, .iterations = 100000})->recover(problem);
      SCOPED_TRACE(name);
      EXPECT_TRUE(result.converged);
      EXPECT_THAT(result.gradient, Le(tolerance));
      EXPECT_THAT(result.kld, DoubleNear(kld, name == "pqn" ? 1e-4 : 1e-6));
      expect_possible(problem, result);
    }
  }
}

TEST_F(Recovery, DoesNotDependOnTheInitialGuess) {
  for (std::size_t b = 0; b < blankets_->size(); b += 5) {
    const DenseBlanket& blanket = (*blankets_)[b];
    const RecoveryProblem problem = problem_of(blanket, populated(blanket));
    const double kld = method("ip", {.tolerance = 1e-6})->recover(problem).kld;
    for (const auto& [initial, from] : enum_names(InitialInformation{})) {
      for (const std::string name : {"ip", "ncfd"}) {
        SCOPED_TRACE(testing::Message() << "blanket " << b << ", " << name << " from " << from);
        const RecoveryResult result =
            method(name, {.initial = initial, .tolerance = 1e-6, .iterations = 100000})
                ->recover(problem);
        EXPECT_TRUE(result.converged);
        EXPECT_THAT(result.kld, DoubleNear(kld, 1e-6));
      }
    }
  }
}

/// Newton's method, and a barrier that leads away from the boundary wherever it begins.
TEST_F(Recovery, InteriorPointTakesFewSteps) {
  for (std::size_t b = 0; b < blankets_->size(); b += 4) {
    const DenseBlanket& blanket = (*blankets_)[b];
    const RecoveryProblem problem = problem_of(blanket, populated(blanket));
    for (const auto& [initial, from] : enum_names(InitialInformation{})) {
      SCOPED_TRACE(testing::Message() << "blanket " << b << " from " << from);
      const RecoveryOptions options{.initial = initial};
      EXPECT_THAT(InteriorPoint({.recovery = options}).recover(problem).iterations, Le(80));
      EXPECT_THAT(
          InteriorPoint({.recovery = options, .conservative = true}).recover(problem).iterations,
          Le(120));
    }
  }
}

/// Where no more can be gained than rounding hides, a method ends, however much is asked for.
TEST_F(Recovery, EndsWhereOnlyRoundingIsLeft) {
  for (std::size_t b = 0; b < blankets_->size(); b += 10) {
    const DenseBlanket& blanket = (*blankets_)[b];
    const RecoveryProblem problem = problem_of(blanket, populated(blanket));
    const double kld = method("ip", {.tolerance = 1e-6})->recover(problem).kld;
    for (const std::string& name : kMethods) {
      SCOPED_TRACE(testing::Message() << name << ", blanket " << b);
      const RecoveryResult result =
          method(name, {.tolerance = 0.0, .iterations = 20000})->recover(problem);
      EXPECT_THAT(result.iterations, Lt(20000));
      EXPECT_THAT(result.gradient, Lt(1e-6));
      EXPECT_THAT(result.kld, DoubleNear(kld, 1e-9));
    }
  }
}

/// The minimum's factors are then not unique, its KLD is.
TEST_F(Recovery, MoreFactorsThanFreedomsHaveOneKld) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    Draw draw(seed);
    const RecoveryProblem problem = full_problem(draw, 3, 9 + draw.integer(6), 20);
    const double kld = method("ip", {.tolerance = 1e-6})->recover(problem).kld;
    for (const std::string& name : kMethods) {
      const RecoveryResult result = method(name, {.tolerance = 1e-4})->recover(problem);
      EXPECT_TRUE(result.converged) << name << ", seed " << seed;
      EXPECT_THAT(result.kld, DoubleNear(kld, 1e-4)) << name << ", seed " << seed;
      expect_possible(problem, result);
    }
  }
}

TEST_F(Recovery, BeginsWhereItIsTold) {
  const DenseBlanket& blanket = blankets_->front();
  const RecoveryProblem problem = problem_of(blanket, every_model(blanket));
  const ScaledProblem scaled(problem);
  Approximation at(scaled);
  begin(problem, InitialInformation::identity, at);
  for (int k = 0; k < scaled.factors(); ++k) {
    const int m = scaled.size(k);
    EXPECT_THAT(apart(scaled.information(k, at.W(k)), Matrix::Identity(m, m)), Lt(1e-9));
  }
  const double identity = at.kld();
  begin(problem, InitialInformation::ffd, at);
  EXPECT_THAT(at.kld(), Lt(identity));
  begin(problem, InitialInformation::scaled, at);
  EXPECT_THAT(approximated(problem,
                           [&] {
                             std::vector<Matrix> Omega;
                             for (int k = 0; k < scaled.factors(); ++k)
                               Omega.push_back(scaled.information(k, at.W(k)));
                             return Omega;
                           }())
                  .trace(),
              DoubleNear(problem.rank, 1e-8));
  begin(problem, InitialInformation::odb, at);
  for (int k = 0; k < scaled.factors(); ++k) {
    const int m = scaled.size(k);
    const Eigen::Map<const Matrix> guess(problem.factors[k].off_diagonal.data(), m, m);
    const Matrix symmetric = scaled.scaled(k, 0.5 * (guess + guess.transpose()));
    if (least_eigenvalue(symmetric) < 0.01) continue;
    EXPECT_THAT(apart(at.W(k), symmetric), Lt(1e-8));
  }
}

TEST_F(Recovery, ClosedFormIsTheMinimumOfATree) {
  for (std::size_t b = 0; b < blankets_->size(); b += 2) {
    const DenseBlanket& blanket = (*blankets_)[b];
    const RecoveryProblem problem =
        problem_of(blanket, ChowLiuTree(TopologyOptions{}).choose(blanket, 0));
    const RecoveryResult closed = ClosedForm().recover(problem);
    EXPECT_TRUE(closed.converged);
    expect_possible(problem, closed);
    for (const std::string name : {"fd", "ncfd"}) {
      for (const auto& [initial, from] : enum_names(InitialInformation{})) {
        const RecoveryResult result = method(name, {.initial = initial})->recover(problem);
        EXPECT_TRUE(result.converged);
        EXPECT_EQ(result.iterations, 0);
        EXPECT_THAT(result.kld, DoubleNear(closed.kld, 1e-9));
      }
    }
    EXPECT_THAT(method("ip", {.tolerance = 1e-6})->recover(problem).kld,
                DoubleNear(closed.kld, 1e-9));
  }
}

ErrorCode code_of(const std::function<void()>& what) {
  try {
    what();
  } catch (const Error& error) {
    return error.code();
  }
  ADD_FAILURE() << "nothing was thrown";
  return ErrorCode::plugin;
}

TEST_F(Recovery, ClosedFormRefusesOtherTopologies) {
  for (const DenseBlanket& blanket : *blankets_) {
    const std::vector<FactorChoice> topology = populated(blanket);
    if (topology.size() < blanket.node_sizes.size()) continue;
    const RecoveryProblem problem = problem_of(blanket, topology);
    EXPECT_EQ(code_of([&] { ClosedForm().recover(problem); }), ErrorCode::usage);
  }
}

/// As many factors as a tree has, but three of them in a ring and a node left over.
TEST_F(Recovery, WhatDoesNotConnectAllNodesIsRefused) {
  Draw draw(11);
  for (int times = 0; times < 60; ++times) {
    const DenseBlanket blanket = random_blanket(*registry, 2 + times % 2, 4 + times % 3, draw, 4);
    const int alone = draw.integer(static_cast<int>(blanket.node_sizes.size()));
    std::vector<FactorChoice> topology;
    for (int k = 0; k < static_cast<int>(std::ssize(blanket.models)); ++k) {
      const std::vector<int>& nodes = blanket.models[k].nodes;
      if (nodes[0] != alone && nodes[1] != alone) topology.push_back({k});
    }
    const RecoveryProblem problem = problem_of(blanket, topology);
    for (const std::string& name : kMethods) {
      for (const EnumName<InitialInformation>& from : enum_names(InitialInformation{})) {
        SCOPED_TRACE(testing::Message() << name << " from " << from.name << ", " << times);
        EXPECT_EQ(code_of([&] { method(name, {.initial = from.value})->recover(problem); }),
                  ErrorCode::numerical);
      }
    }
    EXPECT_EQ(code_of([&] { ClosedForm().recover(problem); }), ErrorCode::usage);
  }
}

TEST_F(Recovery, AConservativeOneClaimsNothingThatTheDenseOneDoesNot) {
  int overconfident = 0;
  for (std::size_t b = 0; b < blankets_->size(); b += 4) {
    const DenseBlanket& blanket = (*blankets_)[b];
    const RecoveryProblem problem = problem_of(blanket, populated(blanket, 1.5));
    const int r = problem.rank;
    const RecoveryResult free = InteriorPoint({.recovery = {.tolerance = 1e-5}}).recover(problem);
    const RecoveryResult held =
        InteriorPoint({.recovery = {.tolerance = 1e-5}, .conservative = true}).recover(problem);
    EXPECT_TRUE(held.converged);
    expect_possible(problem, held);
    const Matrix I = Matrix::Identity(r, r);
    EXPECT_THAT(least_eigenvalue(I - approximated(problem, informations(problem, held))),
                Ge(-1e-9));
    EXPECT_THAT(held.kld, Ge(free.kld - 1e-8));
    overconfident +=
        least_eigenvalue(I - approximated(problem, informations(problem, free))) < -1e-3;
  }
  EXPECT_THAT(overconfident, Gt(10));
}

/// Within the constraint, no worse than one scale for all factors, and no better than the optimum
/// under it.
TEST_F(Recovery, ConservativeFactorDescentIsBetweenOneScaleAndTheOptimum) {
  int better = 0;
  for (std::size_t b = 0; b < blankets_->size(); b += 4) {
    const DenseBlanket& blanket = (*blankets_)[b];
    const RecoveryProblem problem = problem_of(blanket, populated(blanket, 1.5));
    const Matrix I = Matrix::Identity(problem.rank, problem.rank);
    for (const bool greedy : {false, true}) {
      const RecoveryOptions options{.tolerance = 1e-5};
      const RecoveryResult free = FactorDescent(options, greedy).recover(problem);
      const RecoveryResult held = FactorDescent(options, greedy, true).recover(problem);
      expect_possible(problem, held);
      EXPECT_THAT(least_eigenvalue(I - approximated(problem, informations(problem, held))),
                  Ge(-1e-9));
      const Matrix L = approximated(problem, informations(problem, free));
      const double scale = 1.0 / std::max(1.0, -least_eigenvalue(-L));
      const double scaled = dense_kld(scale * L);
      EXPECT_THAT(held.kld, Le(scaled + 1e-5 * (1.0 + scaled)));
      better += held.kld < 0.9 * scaled;
      const RecoveryResult optimum =
          InteriorPoint({.recovery = {.tolerance = 1e-6}, .conservative = true}).recover(problem);
      EXPECT_THAT(held.kld, Ge(optimum.kld - 1e-5));
    }
  }
  EXPECT_THAT(better, Gt(10));
}

TEST_F(Recovery, EndsEarlyWhereItIsTold) {
  for (std::size_t b = 90; b < blankets_->size(); b += 10) {
    const DenseBlanket& blanket = (*blankets_)[b];
    const std::vector<FactorChoice> topology = populated(blanket);
    if (topology.size() < blanket.node_sizes.size() + 1) continue;
    const RecoveryProblem problem = problem_of(blanket, topology);
    for (const std::string& name : kMethods) {
      SCOPED_TRACE(testing::Message() << name << ", blanket " << b);
      const RecoveryResult few =
          method(name,
                 {.initial = InitialInformation::identity, .tolerance = 1e-9, .iterations = 2})
              ->recover(problem);
      EXPECT_FALSE(few.converged);
      EXPECT_EQ(few.iterations, 2);
      expect_possible(problem, few);
      const RecoveryResult none =
          method(name,
                 {.initial = InitialInformation::identity, .tolerance = 1e-9, .seconds = 1e-12})
              ->recover(problem);
      EXPECT_FALSE(none.converged);
      EXPECT_THAT(none.iterations, Le(1));
      expect_possible(problem, none);
    }
  }
}

TEST_F(Recovery, DescentNeverGoesUp) {
  for (std::size_t b = 0; b < blankets_->size(); b += 3) {
    const DenseBlanket& blanket = (*blankets_)[b];
    const RecoveryProblem problem = problem_of(blanket, populated(blanket));
    for (const std::string name : {"fd", "ncfd"}) {
      for (const auto initial : {InitialInformation::odb, InitialInformation::identity}) {
        const auto descent = method(name, {.initial = initial, .tolerance = 1e-5});
        descent->trace(true);
        const RecoveryResult result = descent->recover(problem);
        ASSERT_FALSE(result.trace.empty());
        EXPECT_EQ(static_cast<int>(result.trace.size()), result.iterations + 1);
        for (std::size_t k = 1; k < result.trace.size(); ++k) {
          const double before = result.trace[k - 1].kld;
          EXPECT_THAT(result.trace[k].kld, Le(before + 1e-11 * (1.0 + before)));
          EXPECT_THAT(result.trace[k].seconds, Ge(result.trace[k - 1].seconds));
        }
        EXPECT_THAT(result.trace.back().kld, DoubleNear(result.kld, 1e-9));
        descent->trace(false);
        EXPECT_TRUE(descent->recover(problem).trace.empty());
      }
    }
  }
}

// Exactness ---------------------------------------------------------------------------------------

/// Whatever all pairs together say is found again.
TEST_F(Recovery, AllPairsRepresentWhatIsMadeOfThem) {
  Draw draw(21);
  for (int times = 0; times < 12; ++times) {
    DenseBlanket blanket = random_blanket(*registry, 2 + times % 2, 3 + times % 4, draw);
    const std::vector<FactorChoice> all = every_model(blanket);
    std::vector<Matrix> Omega;
    for (const FactorModel& model : blanket.models)
      Omega.push_back(10.0 * draw.definite(model.size));
    set_information(blanket, all, Omega);
    const RecoveryProblem problem = problem_of(blanket, all);
    for (const std::string name : {"ncfd", "ip", "fd"}) {
      for (const auto& [initial, from] : enum_names(InitialInformation{})) {
        SCOPED_TRACE(testing::Message() << name << " from " << from << ", " << times);
        const RecoveryResult result =
            method(name, {.initial = initial, .tolerance = 1e-6, .iterations = 200000})
                ->recover(problem);
        EXPECT_TRUE(result.converged);
        EXPECT_THAT(result.kld, Lt(1e-9));
        const std::vector<Matrix> found = informations(problem, result);
        for (std::size_t k = 0; k < Omega.size(); ++k)
          EXPECT_THAT((found[k] - Omega[k]).norm(), Lt(1e-3 * Omega[k].norm()));
      }
    }
  }
}

TEST_F(Recovery, ATreeRepresentsWhatIsMadeOfIt) {
  Draw draw(22);
  for (int times = 0; times < 20; ++times) {
    DenseBlanket blanket = random_blanket(*registry, 2 + times % 2, 3 + times % 5, draw);
    // Each node hangs on an earlier one; models are of pairs in rising order.
    std::vector<FactorChoice> tree;
    for (int j = 1; j < static_cast<int>(std::ssize(blanket.node_sizes)); ++j) {
      const std::vector<int> pair{draw.integer(j), j};
      const auto model = std::ranges::find(blanket.models, pair, &FactorModel::nodes);
      tree.push_back({static_cast<int>(model - blanket.models.begin())});
    }
    std::vector<Matrix> Omega;
    for (std::size_t k = 0; k < tree.size(); ++k)
      Omega.push_back(10.0 * draw.definite(blanket.node_sizes.front()));
    set_information(blanket, tree, Omega);
    const RecoveryProblem problem = problem_of(blanket, tree);
    const RecoveryResult closed = ClosedForm().recover(problem);
    EXPECT_THAT(closed.kld, Lt(1e-9));
    for (std::size_t k = 0; k < Omega.size(); ++k)
      EXPECT_THAT(
          apart(information(closed, static_cast<int>(k), problem.factors[k].size), Omega[k]),
          Lt(1e-7));
    EXPECT_THAT(method("ncfd", {})->recover(problem).kld, Lt(1e-9));
    EXPECT_THAT(method("ip", {})->recover(problem).kld, Lt(1e-6));
    // More factors than are needed do no harm: those that are not get nothing to say.
    for (const std::string name : {"ncfd", "ip"}) {
      const RecoveryResult result = method(name, {.tolerance = 1e-6, .iterations = 200000})
                                        ->recover(problem_of(blanket, every_model(blanket)));
      EXPECT_TRUE(result.converged) << name << ", " << times;
      EXPECT_THAT(result.kld, Lt(1e-6)) << name << ", " << times;
    }
  }
}

}  // namespace
}  // namespace cairn::sparsify
