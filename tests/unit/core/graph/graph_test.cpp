// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/graph/graph.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/resource.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "cairn/graph/factors_by_variable.hpp"
#include "cairn/lie/se2.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/types/define_variable.hpp"
#include "support/planar_graph.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const std::vector<double> kUnit = {1, 0, 0, 1, 0, 1};

class GraphTest : public ::testing::Test {
 protected:
  std::string refusal(const std::function<void()>& call) {
    try {
      call();
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::input);
      return error.what();
    }
    return "";
  }
  int add_pose(Id id, double x = 0.0) {
    return graph_.add_variable(types_.pose, id, std::array{x, 0.0, 0.0});
  }
  void connect(int a, int b, std::vector<double> information = kUnit) {
    graph_.add_factor(types_.relative_pose, std::array{a, b}, std::array{1.0, 0.0, 0.0},
                      information);
  }
  test::PlanarTypes types_;
  Graph graph_;
};

TEST_F(GraphTest, KnowsVariablesByIdAndIndex) {
  EXPECT_EQ(add_pose(10), 0);
  EXPECT_EQ(graph_.add_variable(types_.point, -3, std::array{1.0, 2.0}), 1);
  EXPECT_EQ(graph_.find(-3), 1);
  EXPECT_EQ(graph_.find(3), std::nullopt);
  EXPECT_EQ(graph_.describe_variable(1), "VERTEX_XY -3");
  EXPECT_THAT(graph_.state(1), ElementsAre(1.0, 2.0));
  EXPECT_EQ(graph_.tangent_size(), 5);
}

TEST_F(GraphTest, RefusesBadVariables) {
  add_pose(1);
  EXPECT_THAT(refusal([&] { add_pose(1); }),
              HasSubstr("VERTEX_SE2 1: the id is already that of VERTEX_SE2 1"));
  EXPECT_THAT(refusal([&] { graph_.add_variable(types_.pose, 2, std::array{1.0}); }),
              HasSubstr("has 1 numbers, expected 3"));
  EXPECT_THAT(refusal([&] { add_pose(2, std::numeric_limits<double>::quiet_NaN()); }),
              HasSubstr("not finite"));
  EXPECT_EQ(graph_.variable_count(), 1);
  EXPECT_EQ(graph_.values().pools[0].size(), 3U);
}

TEST_F(GraphTest, RefusesBadFactorsAndStaysAsItWas) {
  add_pose(0);
  add_pose(1);
  graph_.add_variable(types_.point, 2, std::array{0.0, 0.0});
  EXPECT_THAT(refusal([&] { connect(0, 0); }),
              HasSubstr("EDGE_SE2 0 0: joins variable 0 with itself"));
  EXPECT_THAT(refusal([&] { connect(0, 7); }), HasSubstr("no such variable"));
  EXPECT_THAT(refusal([&] { connect(0, 2); }),
              HasSubstr("variable 2 is a VERTEX_XY, expected a VERTEX_SE2"));
  EXPECT_THAT(refusal([&] {
                connect(0, 1, {1, 0, 0, 1, 0, -1});
              }),
              HasSubstr("EDGE_SE2 0 1: the information matrix is not positive semidefinite"));
  EXPECT_THAT(refusal([&] {
                connect(0, 1, {1, 2, 0, 1, 0, 1});
              }),
              HasSubstr("not positive semidefinite"));
  EXPECT_THAT(refusal([&] {
                connect(0, 1, {1, 0, 0});
              }),
              HasSubstr("upper triangle of an information matrix, 6"));
  EXPECT_THAT(refusal([&] { connect(0, 1, {INFINITY, 0, 0, 1, 0, 1}); }), HasSubstr("not finite"));
  EXPECT_EQ(graph_.factor_count(), 0);
  connect(0, 1);
  EXPECT_EQ(graph_.factor_pools()[0].measurements.size(), 3U);
  EXPECT_EQ(graph_.factor_pools()[0].sqrt_information.size(), 6U);
}

TEST_F(GraphTest, KeepsInformationAsGivenAndItsSquareRoot) {
  add_pose(0);
  add_pose(1);
  const std::vector<double> omega = {4, 1, 0.5, 3, 0.2, 2};
  connect(0, 1, omega);
  EXPECT_THAT(graph_.information(0), ::testing::ElementsAreArray(omega));
  const GrowingArray<double>& u = graph_.factor_pools()[0].sqrt_information;
  Eigen::Matrix3d U = Eigen::Matrix3d::Zero(), Omega;
  U << u[0], u[1], u[2], 0, u[3], u[4], 0, 0, u[5];
  Omega << 4, 1, 0.5, 1, 3, 0.2, 0.5, 0.2, 2;
  EXPECT_LT((U.transpose() * U - Omega).norm(), 1e-14);
}

/// Its arrays move while they grow, several times up to the size at which they are mappings.
TEST_F(GraphTest, TakesTheNumbersOfOneOfItsOwnFactors) {
  add_pose(0);
  add_pose(1);
  const std::vector<double> omega = {4, 1, 0.5, 3, 0.2, 2};
  connect(0, 1, omega);
  constexpr int kCount = 40000;  // 2 MB of information
  for (int f = 0; f + 1 < kCount; ++f) {
    graph_.add_factor(types_.relative_pose, graph_.factor_variables(f), graph_.measurement(f),
                      graph_.information(f));
  }
  for (int f = 0; f < kCount; ++f) {
    ASSERT_THAT(graph_.information(f), ::testing::ElementsAreArray(omega)) << f;
    ASSERT_THAT(graph_.factor_variables(f), ElementsAre(0, 1)) << f;
    ASSERT_THAT(graph_.measurement(f), ElementsAre(1.0, 0.0, 0.0)) << f;
  }
}

TEST_F(GraphTest, RefusesToReserveMoreThanItCanHave) {
  EXPECT_THROW(graph_.reserve(0, std::size_t{1} << 31U), Error);
  EXPECT_THROW(graph_.reserve(~std::size_t{0}, 0), Error);
  graph_.reserve(1000, 100000);
  add_pose(0);
  add_pose(1);
  connect(0, 1);
  EXPECT_EQ(graph_.factor_count(), 1);
}

TEST_F(GraphTest, HasRoomForWhatWasReservedOnceATypeHasMany) {
  graph_.reserve(1000, 100000);
  add_pose(0);
  add_pose(1);
  connect(0, 1);
  const FactorPool& pool = graph_.factor_pools()[0];
  EXPECT_LT(pool.sequence.capacity(), 1000U) << "others may be of another type";
  while (graph_.factor_count() < 1000) connect(0, 1);
  EXPECT_GE(pool.sequence.capacity(), 100000U);
  EXPECT_LT(pool.information.capacity(), 1000U) << "all have the same";
}

TEST_F(GraphTest, HasRoomForAsManyInformationMatricesAsMostFactorsNeed) {
  graph_.reserve(1000, 100000);
  add_pose(0);
  add_pose(1);
  for (int f = 0; f < 1000; ++f) connect(0, 1, {1.0 + f, 0, 0, 1, 0, 1});
  EXPECT_GE(graph_.factor_pools()[0].information.capacity(), 600000U);
}

TEST_F(GraphTest, FactorsWithEqualInformationShareIt) {
  add_pose(0);
  add_pose(1);
  const std::vector<double> one = {4, 1, 0.5, 3, 0.2, 2}, other = {9, 0, 0, 9, 0, 9};
  for (int f = 0; f < 10; ++f) connect(0, 1, f % 3 == 0 ? other : one);
  const FactorPool& pool = graph_.factor_pools()[0];
  EXPECT_EQ(pool.information.size(), 12U);
  EXPECT_EQ(pool.sqrt_information.size(), 12U);
  EXPECT_THAT(pool.uses, ElementsAre(4, 6));
  for (int f = 0; f < 10; ++f) {
    EXPECT_THAT(graph_.information(f), ::testing::ElementsAreArray(f % 3 == 0 ? other : one));
    EXPECT_EQ(graph_.information_rank(f), 3);
    EXPECT_EQ(graph_.sqrt_information(f)[0], f % 3 == 0 ? 3.0 : 2.0);
  }
}

TEST_F(GraphTest, AFactorWhoseInformationChangesLeavesThatOfTheOthers) {
  add_pose(0);
  add_pose(1);
  for (int f = 0; f < 3; ++f) connect(0, 1, {4, 0, 0, 4, 0, 4});
  const std::array z{1.0, 0.0, 0.0};
  for (int change = 1; change <= 100; ++change) {
    const double w = change % 7 == 0 ? 4.0 : 1.0 / change;
    graph_.set_measurement(1, z, std::array{w, 0.0, 0.0, w, 0.0, w});
    ASSERT_EQ(graph_.information(1)[0], w);
    ASSERT_EQ(graph_.information(0)[0], 4.0);
    ASSERT_EQ(graph_.information(2)[0], 4.0);
  }
  EXPECT_EQ(graph_.factor_pools()[0].uses.size(), 2U) << "one of its own, however often it changes";
  connect(0, 1, {4, 0, 0, 4, 0, 4});
  EXPECT_EQ(graph_.information(3)[0], 4.0);
  graph_.set_measurement(1, z, graph_.information(0));  // of the graph itself
  EXPECT_EQ(graph_.information(1)[0], 4.0);
}

TEST_F(GraphTest, RemovesInformationWithTheLastFactorThatHasIt) {
  add_pose(0);
  add_pose(1);
  for (int f = 0; f < 12; ++f) {
    const double w = f % 4 + 1;
    connect(0, 1, {w, 0, 0, w, 0, w});
  }
  std::vector<bool> leaves(12, false);
  for (const int f : {1, 5, 9, 2, 0}) leaves[static_cast<std::size_t>(f)] = true;
  graph_.remove(leaves, {false, false});
  const FactorPool& pool = graph_.factor_pools()[0];
  EXPECT_THAT(pool.uses, ElementsAre(2, 2, 3));
  std::vector<double> weights;
  for (int f = 0; f < graph_.factor_count(); ++f) weights.push_back(graph_.information(f)[0]);
  EXPECT_THAT(weights, ElementsAre(4, 1, 3, 4, 1, 3, 4));  // of 3, 4, 6, 7, 8, 10, 11
  connect(0, 1, {2, 0, 0, 2, 0, 2});
  EXPECT_EQ(graph_.information(7)[0], 2.0);
  EXPECT_EQ(graph_.information(1)[0], 1.0);
}

/// Equal and different in turn: factors that are linearised together have them as they please.
TEST_F(GraphTest, WhitensByTheInformationThatEachFactorHas) {
  for (Id id = 0; id < 50; ++id) add_pose(id);
  std::mt19937 random(1);
  for (int f = 0; f < 200; ++f) {
    const double w = f < 40 ? 1.0 : f < 80 ? f : static_cast<double>(random() % 3 + 1);
    connect(f % 49, f % 49 + 1, {w, 0, 0, 2 * w, 0, 3 * w});
  }
  const std::vector<double> norms = squared_norms(graph_);
  for (int f = 0; f < 200; ++f) {
    Graph alone;
    for (const int v : {f % 49, f % 49 + 1}) alone.add(graph_.variable(v));
    alone.add(graph_.factor(f));
    EXPECT_EQ(norms[static_cast<std::size_t>(f)], squared_norms(alone)[0]) << f;
  }
}

TEST_F(GraphTest, IsAGraphAsAnyOtherWhereRoomIsRefused) {
#if defined(CAIRN_SANITIZED)
  GTEST_SKIP() << "sanitizers refuse it by ending the process";
#endif
  const auto fill = [&] {
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    rlimit limit{};
    ::getrlimit(RLIMIT_AS, &limit);
    limit.rlim_cur = pages * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE)) + (rlim_t{256} << 20);
    if (::setrlimit(RLIMIT_AS, &limit) != 0) std::_Exit(2);
    graph_.reserve(std::size_t{1} << 30, std::size_t{1} << 30);
    add_pose(0);
    add_pose(1);
    while (graph_.factor_count() < 2000)
      connect(0, 1, {1.0 + graph_.factor_count(), 0, 0, 1, 0, 1});
    std::_Exit(graph_.factor_pools()[0].information.capacity() < 100000 ? 0 : 3);
  };
  EXPECT_EXIT(fill(), ::testing::ExitedWithCode(0), "");
}

TEST_F(GraphTest, ReplacesAMeasurement) {
  add_pose(0);
  add_pose(1);
  connect(0, 1);
  graph_.set_measurement(0, std::array{5.0, 6.0, 0.5}, std::array{9.0, 0.0, 0.0, 9.0, 0.0, 9.0});
  EXPECT_THAT(graph_.measurement(0), ElementsAre(5.0, 6.0, 0.5));
  EXPECT_EQ(graph_.factor_pools()[0].sqrt_information[0], 3.0);
  EXPECT_THAT(refusal([&] { graph_.set_measurement(0, std::array{1.0}); }),
              HasSubstr("EDGE_SE2 0 1"));
}

TEST_F(GraphTest, TellsLoopClosuresFromOdometryByTheOrderOfIds) {
  for (const Id id : {30, 10, 20}) add_pose(id);  // indices 0, 1, 2
  graph_.add_variable(types_.point, 15, std::array{0.0, 0.0});
  connect(1, 2);  // 10 → 20: neighbours, since 15 is no pose
  connect(0, 2);  // 30 → 20: backwards, but neighbours
  connect(1, 0);  // 10 → 30
  graph_.add_factor(types_.point_seen, std::array{1, 3}, std::array{0.0, 0.0},
                    std::array{1.0, 0.0, 1.0});
  EXPECT_THAT(loop_closures(graph_), ElementsAre(false, false, true, false));
}

TEST_F(GraphTest, ACloneIsIndependent) {
  add_pose(0);
  add_pose(1);
  connect(0, 1);
  Graph copy = graph_.clone();
  copy.set_state(1, std::array{9.0, 9.0, 0.0});
  copy.set_fixed(0);
  EXPECT_EQ(graph_.state(1)[0], 0.0);
  EXPECT_FALSE(graph_.fixed(0));
  EXPECT_EQ(copy.factor_count(), 1);
}

TEST_F(GraphTest, RefusesStatesOfAnotherGraph) {
  add_pose(0);
  EXPECT_THROW(graph_.set_values(Values{}), Error);
}

TEST_F(GraphTest, SquaredNormsAreByPositionAcrossPools) {
  const Graph graph = test::random_graph(types_, 20, 6, 1);
  const std::vector<double> norms = squared_norms(graph);
  std::vector<const double*> x;
  for (int f = 0; f < graph.factor_count(); ++f) {
    const FactorRef ref = graph.ref(f);
    const FactorPool& pool = graph.factor_pools()[ref.pool];
    const int n = pool.type->residual_size();
    x.clear();
    for (const std::int32_t v : graph.factor_variables(f)) x.push_back(graph.state(v).data());
    Eigen::VectorXd r(n);
    pool.type->evaluate(x.data(), graph.measurement(f).data(), graph.sqrt_information(f).data(),
                        r.data(), nullptr);
    EXPECT_NEAR(norms[f], r.squaredNorm(), 1e-12 * (1.0 + norms[f]));
  }
}

TEST_F(GraphTest, RemovesFactorsAndVariables) {
  for (int k = 0; k < 5; ++k) add_pose(10 + k, k);
  graph_.add_variable(types_.point, 20, std::array{5.0, 6.0});
  for (int k = 1; k < 5; ++k) connect(k - 1, k);
  graph_.add_factor(types_.prior, std::array{2}, std::array{2.0, 0.0, 0.0}, kUnit);
  graph_.add_factor(types_.point_seen, std::array{4, 5}, std::array{1.0, 2.0},
                    std::array{1.0, 0.0, 1.0});
  graph_.set_fixed(3);
  const auto version = graph_.structure_version();

  // Variable 11 with its two factors, and the prior.
  const Renumbering numbers = graph_.remove({true, true, false, false, true, false},
                                            {false, true, false, false, false, false});
  EXPECT_THAT(numbers.variable, ElementsAre(0, -1, 1, 2, 3, 4));
  EXPECT_THAT(numbers.factor, ElementsAre(-1, -1, 0, 1, -1, 2));
  EXPECT_NE(graph_.structure_version(), version);
  ASSERT_EQ(graph_.variable_count(), 5);
  ASSERT_EQ(graph_.factor_count(), 3);
  EXPECT_EQ(graph_.find(11), std::nullopt);
  EXPECT_EQ(graph_.find(13), 2);
  EXPECT_TRUE(graph_.fixed(2));
  EXPECT_THAT(graph_.state(2), ElementsAre(3.0, 0.0, 0.0));
  EXPECT_THAT(graph_.state(4), ElementsAre(5.0, 6.0));
  EXPECT_EQ(graph_.describe_factor(0), "EDGE_SE2 12 13");
  EXPECT_EQ(graph_.describe_factor(2), "EDGE_SE2_XY 14 20");
  EXPECT_THAT(graph_.measurement(2), ElementsAre(1.0, 2.0));
  EXPECT_EQ(graph_.factor_pools().size(), 2U);  // the one of priors has gone
  EXPECT_EQ(squared_norms(graph_).size(), 3U);

  // What is freed can be used again.
  EXPECT_EQ(add_pose(11), 5);
  connect(5, 1);
  EXPECT_EQ(graph_.describe_factor(3), "EDGE_SE2 11 12");
}

TEST_F(GraphTest, RemovesNoVariableThatAFactorNeeds) {
  add_pose(0);
  add_pose(1);
  connect(0, 1);
  try {
    graph_.remove({false}, {false, true});
    ADD_FAILURE() << "it was removed";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::usage);
    EXPECT_THAT(error.what(), HasSubstr("VERTEX_SE2 1 cannot be removed: EDGE_SE2 0 1 is on it"));
  }
  EXPECT_EQ(graph_.variable_count(), 2);
  EXPECT_THROW(graph_.remove({}, {false, true}), Error);
}

struct Halving final : Loss {
  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override {
    for (std::size_t k = 0; k < rho.size(); ++k) rho[k] = 0.5 * s[k];
    for (double& w : weight) w = 0.5;
  }
  double second_derivative(double) const override { return 0.0; }
};

TEST_F(GraphTest, KeepsTheLossOfEachFactorWhenOthersLeave) {
  for (Id id = 0; id < 4; ++id) add_pose(id);
  for (int v = 0; v < 3; ++v) connect(v, v + 1);
  connect(1, 3);
  connect(0, 3);
  const auto halving = std::make_shared<Halving>();
  graph_.set_loss(halving, FactorSelector::loops());
  const auto robust = [&] {
    std::vector<bool> result;
    for (int f = 0; f < graph_.factor_count(); ++f) result.push_back(graph_.loss(f) != nullptr);
    return result;
  };
  EXPECT_THAT(robust(), ElementsAre(false, false, false, true, true));
  graph_.erase(2);  // 1-3 joins neighbours from now on, and was a loop closure when it was chosen
  EXPECT_THAT(robust(), ElementsAre(false, true, true));
  EXPECT_EQ(graph_.describe_factor(1), "EDGE_SE2 1 3");
  graph_.erase_factor(1);
  EXPECT_THAT(robust(), ElementsAre(false, true));
  EXPECT_EQ(graph_.clone().loss(1), halving.get());
  graph_.set_loss(nullptr);
  EXPECT_THAT(robust(), ElementsAre(false, false));
  graph_.set_loss(halving, FactorSelector::tag("EDGE_SE2"));
  EXPECT_THAT(robust(), ElementsAre(true, true));
  graph_.set_loss(halving, FactorSelector::where([](const Graph&, int f) { return f == 1; }));
  EXPECT_THAT(robust(), ElementsAre(false, true));
  graph_.set_loss(0, std::make_shared<Halving>());
  EXPECT_THAT(robust(), ElementsAre(true, true));
  EXPECT_EQ(graph_.losses().size(), 3U);
}

TEST_F(GraphTest, SumsEachFactorsOwnLoss) {
  add_pose(0);
  add_pose(1, 3.0);
  connect(0, 1);  // measured 1, is 3
  connect(0, 1);
  EXPECT_DOUBLE_EQ(chi2(graph_), 8.0);
  graph_.set_loss(1, std::make_shared<Halving>());
  EXPECT_DOUBLE_EQ(chi2(graph_), 6.0);
}

TEST_F(GraphTest, TakesVariablesAndFactorsAsValues) {
  graph_.add(Variable{types_.pose, 20, {1, 0, 0}, true});
  graph_.add(Variable{types_.pose, 10, {2, 0, 0}});
  const auto halving = std::make_shared<Halving>();
  graph_.add(Factor{types_.relative_pose, {10, 20}, {1, 2, 0.5}, kUnit, halving});
  EXPECT_THAT(graph_.factor_variables(0), ElementsAre(1, 0));  // by id, whatever the order
  const Factor factor = graph_.factor(0);
  EXPECT_THAT(factor.variables, ElementsAre(10, 20));
  EXPECT_THAT(factor.measurement, ElementsAre(1, 2, 0.5));
  EXPECT_EQ(factor.information, kUnit);
  EXPECT_EQ(factor.loss, halving);
  EXPECT_EQ(factor.type, types_.relative_pose);
  const Variable variable = graph_.variable(0);
  EXPECT_TRUE(variable.fixed);
  EXPECT_THAT(variable.state, ElementsAre(1, 0, 0));
  EXPECT_EQ(variable.id, 20);
  EXPECT_THAT(graph_.factors_of(1), ElementsAre(0));
  const FactorsByVariable factors(graph_);
  EXPECT_THAT(factors[0], ElementsAre(0));
  EXPECT_THAT(factors[1], ElementsAre(0));
  EXPECT_THAT(refusal([&] {
                graph_.add(Factor{types_.relative_pose, {10, 30}, {1, 2, 0.5}, kUnit});
              }),
              HasSubstr("EDGE_SE2 10 30: there is no variable 30"));
}

/// A pose whose normalize() spoils it.
struct Spoilt : Se2 {
  static constexpr std::string_view kTag = "SPOILT";
  static std::string normalize(Vector<double, 3>& x) {
    x[2] = std::nan("");
    return {};
  }
};

TEST_F(GraphTest, ATypeThatLeavesNanIsWrong) {
  const double state[] = {0.0, 0.0, 0.0};
  Graph graph;
  try {
    graph.add_variable(define_variable<Spoilt>(), 0, state);
    ADD_FAILURE() << "NaN was taken";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::plugin);
    EXPECT_THAT(error.what(), HasSubstr("SPOILT: its normalize() left a number"));
  }
  EXPECT_EQ(graph.variable_count(), 0);
}

TEST_F(GraphTest, ARefusalLeavesNothingBehind) {
  const Values before = graph_.values();
  refusal([&] { graph_.add_variable(types_.pose, 1, std::array{1.0}); });
  EXPECT_TRUE(graph_.variable_pools().empty());
  add_pose(0);
  add_pose(1);
  refusal([&] { connect(0, 1, {1, 0, 0, -1, 0, 1}); });
  refusal([&] { connect(0, 7); });
  EXPECT_TRUE(graph_.factor_pools().empty());
  const std::uint64_t version = graph_.structure_version();
  const Values values = graph_.values();
  refusal([&] { graph_.add_variable(types_.point, 5, std::array{1.0, std::nan("")}); });
  EXPECT_EQ(graph_.structure_version(), version);
  graph_.set_values(values);  // still those of this graph
  EXPECT_EQ(graph_.variable_count(), 2);
}

TEST_F(GraphTest, InformationMayBeSemidefinite) {
  add_pose(0);
  add_pose(1, 3.0);
  connect(0, 1, {1, 0, 0, 0, 0, 0});  // x alone
  connect(0, 1, {1, 1, 0, 1, 0, 0});  // x + y
  connect(0, 1, {4, 2, 2, 1, 1, 1});  // of full rank but one: 2 x + y + yaw
  EXPECT_EQ(graph_.information_rank(0), 1);
  EXPECT_EQ(graph_.information_rank(1), 1);
  EXPECT_EQ(graph_.information_rank(2), 1);
  for (int f = 0; f < 3; ++f) {
    const std::span<const double> u = graph_.sqrt_information(f), omega = graph_.information(f);
    const double U[3][3] = {{u[0], u[1], u[2]}, {0, u[3], u[4]}, {0, 0, u[5]}};
    std::size_t k = 0;
    for (int row = 0; row < 3; ++row) {
      for (int column = row; column < 3; ++column, ++k) {
        double sum = 0.0;
        for (const auto& line : U) sum += line[row] * line[column];
        EXPECT_NEAR(sum, omega[k], 1e-15);
      }
    }
  }
  EXPECT_DOUBLE_EQ(chi2(graph_), 4.0 + 4.0 + 16.0);
  EXPECT_THAT(refusal([&] { connect(0, 1, {1, 2, 0, 1, 0, 1}); }), HasSubstr("semidefinite"));
  EXPECT_THAT(refusal([&] { connect(0, 1, {0, 1, 0, 0, 0, 0}); }), HasSubstr("semidefinite"));
  EXPECT_THAT(refusal([&] { connect(0, 1, {0, 0, 0, 0, 0, 0}); }), HasSubstr("zero"));
}

TEST_F(GraphTest, APriorCountsForTheGaugeWhatItsInformationMeasures) {
  add_pose(0);
  const auto prior = [&](std::vector<double> information) {
    graph_.add_factor(types_.prior, std::array{0}, std::array{0.0, 0.0, 0.0}, information);
    return graph_.absolute_size(graph_.factor_count() - 1);
  };
  EXPECT_EQ(prior(kUnit), 3);
  EXPECT_EQ(prior({1, 0, 0, 1, 0, 0}), 2);
  EXPECT_EQ(prior({0, 0, 0, 0, 0, 1}), 1);
}

}  // namespace
}  // namespace cairn
