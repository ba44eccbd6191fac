// SPDX-License-Identifier: BSD-3-Clause
// cairn sparsify GRAPH.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "cairn/io/format.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/linear/linearizer.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/sparsification/sparsification.hpp"
#include "integration/process.hpp"

namespace cairn::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::SizeIs;

class Sparsify : public testing::Test {
 protected:
  void SetUp() override {
    if (!Registry().has("sparsifier", "sparsify")) GTEST_SKIP() << "no sparsifier sparsify";
  }
  boost::json::value report(Arguments arguments) {
    arguments.insert(arguments.begin(), "sparsify");
    arguments.emplace_back("--quiet");
    return report_of(arguments);
  }
  boost::json::value study(Arguments arguments, const std::string& name = "sparsify") {
    arguments.insert(arguments.begin(), {"study", name});
    arguments.emplace_back("--quiet");
    return report_of(arguments);
  }
  TemporaryFolder folder_;
};

double number(const boost::json::value& value) { return value.to_number<double>(); }

TEST_F(Sparsify, WithoutOptionsTakesOutHalfAndSaysWhatItDid) {
  const std::string in = folder_.file("in.g2o"), out = folder_.file("out.g2o");
  ASSERT_EQ(cairn({"generate", "manhattan:poses=400", "-o", in}).exit_code, 0);
  const Outcome run = cairn({"sparsify", in, "-o", out, "--quiet"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, AllOf(HasSubstr("removed"), HasSubstr("left"), HasSubstr("KLD"),
                             HasSubstr("time"), HasSubstr(out)));
  // Any tool for g2o files can read the result: its tags are those of the input.
  for (const std::string& line : lines(read_text(out))) {
    EXPECT_TRUE(line.starts_with("VERTEX_SE2 ") || line.starts_with("EDGE_SE2 ") ||
                line.starts_with("FIX ") || line.starts_with("#"))
        << line;
  }
  const boost::json::value info = parse_json(cairn({"info", out, "--json", "-"}).out);
  EXPECT_EQ(info.at("graph").at("variables").as_int64(), 200);
  // It is at its minimum.
  const boost::json::value best = report_of({"optimize", out, "--quiet"});
  EXPECT_NEAR(number(best.at("chi2").at("initial")), number(best.at("chi2").at("final")), 1e-4);
}

TEST_F(Sparsify, AllPairsOfSmallBlanketsLoseNothing) {
  // A chain's blankets have two nodes, which one factor describes.
  const boost::json::value told =
      report({"@manhattan:poses=60,loop_density=0", "--keep-every", "3"});
  EXPECT_NEAR(number(told.at("kld")), 0.0, 1e-6);
  EXPECT_EQ(told.at("poses").at("kept").as_int64(), 21);  // the newest too
  EXPECT_EQ(told.at("factors").at("out").as_int64(), 20);
}

// Without the edge's angle, what the node tells of its neighbours leaves their angle open.
TEST_F(Sparsify, LeavesANodeInWhoseEdgesDoNotRelateItsNeighbours) {
  const std::string in = folder_.file("in.g2o"), out = folder_.file("out.g2o");
  write_text(in,
             "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 2 0 0\nVERTEX_SE2 3 3 0.1 0\n"
             "VERTEX_SE2 4 4 0.1 0\nVERTEX_SE2 5 5 0.1 0\nFIX 0\n"
             "EDGE_SE2 0 1 1 0 0 100 0 0 100 0 100\n"
             "EDGE_SE2 1 2 1 0 0 100 0 0 100 0 0\n"
             "EDGE_SE2 2 3 1 0 0 100 0 0 100 0 100\n"
             "EDGE_SE2 3 4 1 0 0 100 0 0 100 0 100\n"
             "EDGE_SE2 4 5 1 0 0 100 0 0 100 0 100\n"
             "EDGE_SE2 0 5 5.01 0 0 100 0 0 100 0 100\n");
  const Outcome run = cairn({"sparsify", in, "--keep-every", "2", "-o", out});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, AllOf(HasSubstr("not taken out: VERTEX_SE2 2"), HasSubstr("rank 2 of 3")));
  const std::string left = read_text(out);
  EXPECT_THAT(left, AllOf(HasSubstr("EDGE_SE2 1 2 1 0 0 100 0 0 100 0 0\n"),
                          HasSubstr("VERTEX_SE2 2 "), Not(HasSubstr("nan"))));
  EXPECT_THAT(left, Not(HasSubstr("VERTEX_SE2 4 ")));
}

TEST_F(Sparsify, MoreFactorsLoseLess) {
  const auto kld = [&](const std::string& population) {
    return number(
        report({"@manhattan:poses=150,streets=4", "--keep-every", "4", "--population", population})
            .at("kld"));
  };
  const double tree = kld("tree:1"), more = kld("tree:2"), most = kld("fill:1");
  EXPECT_LT(more, 0.5 * tree);
  EXPECT_LT(most, 0.5 * more);
  EXPECT_GE(most, -1e-6);
}

TEST_F(Sparsify, ABoundOnTheLossIsKept) {
  const std::string file = folder_.file("problems.json");
  study({"@manhattan:poses=150,streets=4", "--keep-every", "4", "--population", "loss:0.1",
         "--record", file});
  const boost::json::value recorded = parse_json(read_text(file));
  const boost::json::array& problems = recorded.at("problems").as_array();
  ASSERT_THAT(problems, SizeIs(testing::Gt(90U)));
  std::size_t above = 0;
  for (const boost::json::value& problem : problems) above += number(problem.at("kld")) > 0.1;
  // Where even all pairs lose more, there is nothing to be done.
  EXPECT_LT(above, problems.size() / 10);
}

TEST_F(Sparsify, SchemesAndSelectionsTakeOutAsManyAsTheySay) {
  const auto kept = [&](Arguments arguments) {
    arguments.insert(arguments.begin(), "@manhattan:poses=301");
    return report(arguments).at("poses").at("kept").as_int64();
  };
  for (const char* scheme : {"single", "runs", "multi"})
    EXPECT_EQ(kept({"--keep-every", "3", "--scheme", scheme}), 101) << scheme;
  for (const char* selection : {"least_loss", "smallest_blanket", "oldest"})
    EXPECT_EQ(kept({"--select", std::string(selection) + ":part=0.5"}), 151) << selection;
  EXPECT_LT(kept({"--select", "coverage:distance=2"}), 301);
}

TEST_F(Sparsify, ConnectedNodesThatLeaveTogetherAreFewerProblems) {
  const auto problems = [&](const char* scheme) {
    return report({"@manhattan:poses=400", "--keep-every", "5", "--scheme", scheme})
        .at("problems")
        .at("count")
        .as_int64();
  };
  const std::int64_t single = problems("single"), runs = problems("runs"),
                     multi = problems("multi");
  EXPECT_EQ(single, 319);
  EXPECT_EQ(runs, 80);
  EXPECT_LT(multi, runs);
}

TEST_F(Sparsify, OnlineFollowsTheGraphAndRedirectsWhatComesLate) {
  for (const char* redirect : {"late", "early"}) {
    const boost::json::value told = study({"@manhattan:poses=500,streets=4", "--keep-every", "4",
                                           "--online", "50", "--redirect", redirect});
    EXPECT_EQ(told.at("poses").at("kept").as_int64(), 126) << redirect;
    EXPECT_GT(told.at("redirected").as_int64(), 0);
    EXPECT_EQ(told.at("steps").at("count").as_int64(), 500);
    EXPECT_LT(number(told.at("kld")), 5.0);
    EXPECT_GT(number(told.at("kld")), 0.0);
    EXPECT_LT(number(told.at("rmse")), 0.05);
  }
}

TEST_F(Sparsify, EveryEstimatorSparsifiesTheSame) {
  std::vector<double> klds;
  for (const char* estimator : {"incremental_cholesky", "batch"}) {
    klds.push_back(number(report({"@sphere:turns=6,poses_per_turn=12", "--keep-every", "3",
                                  "--online", "24", "--estimator", estimator})
                              .at("kld")));
  }
  EXPECT_NEAR(klds[0], klds[1], 1e-3 * klds[1]);
}

TEST_F(Sparsify, CorrelatedPairsLoseLessThanTheTreeTheyAreMadeOf) {
  const auto told = [&](const char* topology) {
    return report({"@manhattan:poses=300", "--keep-every", "4", "--topology", topology});
  };
  const boost::json::value tree = told("clt"), pairs = told("cliquey");
  EXPECT_LT(number(pairs.at("kld")), 0.8 * number(tree.at("kld")));
  EXPECT_LT(pairs.at("factors").at("out").as_int64(), tree.at("factors").at("out").as_int64());
  EXPECT_EQ(pairs.at("poses").at("kept").as_int64(), tree.at("poses").at("kept").as_int64());
}

TEST_F(Sparsify, ReplaysWhatItRecorded) {
  const std::string file = folder_.file("problems.json");
  const boost::json::value told =
      study({"@manhattan:poses=300", "--keep-every", "4", "--topology", "mi", "--record", file});
  const boost::json::value again = study(
      {file, "--topology", "mi", "--topology", "clt", "--recovery", "ncfd", "--recovery", "ip"},
      "problems");
  EXPECT_EQ(again.at("problems").as_int64(), told.at("problems").at("count").as_int64());
  const boost::json::array& rows = again.at("rows").as_array();
  double all = 0.0;
  for (const boost::json::value& row : rows) {
    EXPECT_EQ(row.at("not_positive").as_int64(), 0);
    EXPECT_EQ(row.at("refused").as_int64(), 0);
    if (row.at("nodes").is_null() && row.at("topology") == "mi" && row.at("recovery") == "ncfd")
      all = number(row.at("kld")) * static_cast<double>(row.at("problems").as_int64());
  }
  EXPECT_NEAR(all, number(told.at("problems").at("kld")), 1e-3 * (1.0 + all));
}

TEST_F(Sparsify, SaysWhatIsWrongAndWhatWouldWork) {
  const auto refused = [](Arguments arguments, int code, const Arguments& command = {"sparsify"}) {
    arguments.insert(arguments.begin(), command.begin(), command.end());
    const Outcome run = cairn(arguments);
    EXPECT_EQ(run.exit_code, code) << run.err;
    return run.err;
  };
  EXPECT_THAT(refused({}, 2), HasSubstr("cairn sparsify"));
  EXPECT_THAT(refused({"@manhattan", "--population", "tree:0.5"}, 2), HasSubstr("tree:2"));
  EXPECT_THAT(refused({"@manhattan", "--topology", "mii"}, 5), HasSubstr("mi"));
  EXPECT_THAT(refused({"@manhattan", "--topology", "mi", "--topology", "clt"}, 2),
              HasSubstr("--topology"));
  EXPECT_THAT(refused({"@manhattan", "--keep-every", "3", "--select", "oldest"}, 2),
              HasSubstr("give one"));
  EXPECT_THAT(refused({"@manhattan", "--redirect", "early"}, 2, {"study", "sparsify"}),
              HasSubstr("--keep-every"));
  EXPECT_THAT(refused({"@manhattan:poses=60", "--topology", "mi", "--recovery", "closed_form"}, 2),
              HasSubstr("ncfd"));
  EXPECT_THAT(
      refused({"@manhattan:poses=60", "--topology", "cliquey", "-o", folder_.file("pairs.g2o")}, 3),
      HasSubstr("CORRELATED_PAIR"));
  EXPECT_THAT(refused({folder_.file("none.json")}, 3, {"study", "problems"}),
              HasSubstr("none.json"));
  write_text(folder_.file("wrong.json"), "{}");
  EXPECT_THAT(refused({folder_.file("wrong.json")}, 3, {"study", "problems"}),
              HasSubstr("--record"));
}

TEST_F(Sparsify, WhatCannotLeaveStaysAndIsNamed) {
  // Poses that have seen a landmark.
  const boost::json::value told = report({"@landmarks2d:poses=80", "--keep-every", "2"});
  const boost::json::array& refused = told.at("refused").as_array();
  ASSERT_GT(refused.size(), 0U);
  EXPECT_THAT(std::string(refused.front().at("reason").as_string()),
              HasSubstr("poses of one kind only"));
  EXPECT_EQ(told.at("poses").at("kept").as_int64() + told.at("problems").at("count").as_int64(),
            told.at("poses").at("in").as_int64());
}

// The measure, against dense algebra --------------------------------------------------------------

/// H of all but the first variable, dense, in the order of the variables.
MatrixXd dense_information(const Graph& graph) {
  std::vector<bool> held(graph.variable_count());
  held[0] = true;
  Linearizer linearizer(graph, held);
  const BlockStructure& structure = linearizer.structure();
  BlockMatrix H(structure);
  VectorXd g(structure.size());
  linearizer.linearize(graph.values(), H, {g.data(), static_cast<std::size_t>(g.size())});
  MatrixXd dense = MatrixXd::Zero(structure.size(), structure.size());
  VectorXd unit = VectorXd::Zero(structure.size()), column(structure.size());
  for (Eigen::Index k = 0; k < dense.cols(); ++k) {
    unit[k] = 1.0;
    H.multiply({unit.data(), static_cast<std::size_t>(unit.size())},
               {column.data(), static_cast<std::size_t>(column.size())});
    dense.col(k) = column;
    unit[k] = 0.0;
  }
  return dense;
}

double log_determinant(const MatrixXd& A) {
  return 2.0 * A.llt().matrixLLT().diagonal().array().log().sum();
}

TEST_F(Sparsify, TheLossOfTheWholeIsThatOfDenseAlgebra) {
  Registry registry;
  for (const std::string kind : {"manhattan:poses=60", "sphere:turns=4,poses_per_turn=8"}) {
    Graph original = registry.make<Generator>(kind)->generate(registry, 3).graph;
    const auto optimizer = registry.make<Optimizer>("levenberg_marquardt");
    optimizer->optimize(original);
    std::vector<int> nodes;
    for (int v = 1; v + 1 < original.variable_count(); ++v) {
      if (v % 3 != 0) nodes.push_back(v);
    }
    const auto sparsifier = registry.make<Sparsifier>("sparsify:population=tree:1");
    Graph sparse = original.clone();
    apply(sparsifier->remove(original, nodes), sparse);
    optimizer->optimize(sparse);
    const auto solver = registry.make<LinearSolver>("block_cholesky");
    const SparsificationError error = sparsification_error(original, sparse, *solver);

    const int t = original.type(0).tangent_size();
    const MatrixXd all = dense_information(original).inverse(), q = dense_information(sparse);
    std::vector<Eigen::Index> rows;
    VectorXd mean(q.rows());
    for (int v = 1; v < sparse.variable_count(); ++v) {
      const int at = *original.find(sparse.id(v));
      for (int k = 0; k < t; ++k) rows.push_back((at - 1) * t + k);
      sparse.type(v).local(1, sparse.state(v).data(), original.state(at).data(),
                           mean.data() + (v - 1) * t);
    }
    const MatrixXd S = all(rows, rows);
    const double covariance = 0.5 * ((q * S).trace() - log_determinant(q) - log_determinant(S) -
                                     static_cast<double>(q.rows()));
    EXPECT_NEAR(error.covariance, covariance, 1e-6 * (1.0 + covariance)) << kind;
    EXPECT_NEAR(error.mean, 0.5 * mean.dot(q * mean), 1e-6) << kind;
    EXPECT_DOUBLE_EQ(error.kld, error.covariance + error.mean);
    EXPECT_GT(error.covariance, 1e-3);
    EXPECT_NEAR(sparsification_error(original, original, *solver).kld, 0.0, 1e-6);
  }
}

TEST_F(Sparsify, AFactorForANodeThatHasLeftSaysTheSameOfAnother) {
  Registry registry;
  Graph graph =
      registry.make<Generator>("sphere:turns=3,poses_per_turn=8")->generate(registry, 1).graph;
  Redirection redirection;
  const int leaving[] = {3, 4, 9};
  redirection.leave(graph, leaving);
  EXPECT_TRUE(redirection.has(graph.id(3)));
  EXPECT_FALSE(redirection.has(graph.id(5)));
  const auto type = graph.type_of_factor(0);
  const auto information = graph.information(0);
  for (const auto& [a, b] : std::vector<std::pair<int, int>>{{3, 20}, {20, 3}, {4, 9}}) {
    // What it measures is where the two are: so it must fit wherever it goes.
    const VariableType& pose = graph.type(a);
    std::vector<double> back(pose.ambient_size()), z(pose.ambient_size());
    pose.lie_group()->inverse(graph.state(a).data(), back.data());
    pose.lie_group()->compose(back.data(), graph.state(b).data(), z.data());
    const auto moved = redirection.redirect(
        {type, {graph.id(a), graph.id(b)}, z, {information.begin(), information.end()}});
    ASSERT_TRUE(moved);
    for (const Id id : moved->variables) EXPECT_FALSE(redirection.has(id));
    Graph check = graph.clone();
    std::vector<int> on;
    for (const Id id : moved->variables) on.push_back(*check.find(id));
    const int added = check.add_factor(type, on, moved->measurement, moved->information);
    EXPECT_NEAR(squared_norms(check)[added], 0.0, 1e-12);
  }
  const auto untouched = redirection.redirect({type,
                                               {graph.id(6), graph.id(7)},
                                               {0, 0, 0, 0, 0, 0, 1},
                                               {information.begin(), information.end()}});
  EXPECT_THAT(untouched->variables, testing::ElementsAre(graph.id(6), graph.id(7)));
  // Where the anchor leaves as well, its followers go on to the next.
  const Id first = redirection.anchor(graph.id(3));
  const int anchor[] = {*graph.find(first)};
  redirection.leave(graph, anchor);
  EXPECT_NE(redirection.anchor(graph.id(3)), first);
  const Id next = redirection.anchor(graph.id(3));
  const std::vector<double> state = redirection.state(graph.id(3), graph.state(*graph.find(next)));
  for (std::size_t k = 0; k < state.size(); ++k) EXPECT_NEAR(state[k], graph.state(3)[k], 1e-9);
}

}  // namespace
}  // namespace cairn::test
