// SPDX-License-Identifier: BSD-3-Clause
// cairn sparsify GRAPH.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include <fmt/core.h>
#include <boost/json/serialize.hpp>

#include "cairn/plugin/registry.hpp"
#include "cairn/report/number_table.hpp"
#include "integration/latex_tabular.hpp"
#include "integration/process.hpp"
#include "sparsify/commands/sparsify_command.hpp"

namespace cairn::test {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::SizeIs;

TEST_F(Sparsify, WithoutOptionsTakesOutHalfAndSaysWhatItDid) {
  const std::string in = folder_.file("in.g2o"), out = folder_.file("out.g2o");
  const Outcome made = cairn({"generate", "manhattan:poses=400", "-o", in});
  ASSERT_EQ(made.exit_code, 0) << made.err;
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
  EXPECT_EQ(info.at("graph").at("variables").as_int64(),
            201);  // of 400, half of those between the first and the newest
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
  EXPECT_THAT(run.err, AllOf(HasSubstr("not taken out: VERTEX_SE2 1"), HasSubstr("rank 2 of 3")));
  const std::string left = read_text(out);
  EXPECT_THAT(left, AllOf(HasSubstr("EDGE_SE2 1 2 1 0 0 100 0 0 100 0 0\n"),
                          HasSubstr("VERTEX_SE2 1 "), Not(HasSubstr("nan"))));
  EXPECT_THAT(left, Not(HasSubstr("VERTEX_SE2 3 ")));
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

TEST_F(Sparsify, ABoundOnTheLossIsKeptOrANoteSaysWhereNot) {
  for (const char* topology : {"ekld", "clt"}) {
    const std::string file = folder_.file("problems.json");
    const boost::json::value found =
        study({"@manhattan:poses=150,streets=4", "--keep-every", "4", "--topology", topology,
               "--population", "loss:0.1", "--record", file});
    const boost::json::value recorded = parse_json(read_text(file));
    const boost::json::array& problems = recorded.at("problems").as_array();
    EXPECT_THAT(problems, SizeIs(111));
    std::size_t above = 0;
    for (const boost::json::value& problem : problems)
      above += number(problem.at("kld")) > 0.1 + 1e-9;
    const std::string notes = boost::json::serialize(found.at("notes"));
    if (topology == std::string("ekld")) {
      EXPECT_EQ(above, 0U);
      EXPECT_THAT(notes, Not(HasSubstr("loss:0.1")));
    } else {  // trees have no factors to add
      EXPECT_GT(above, 10U);
      EXPECT_THAT(notes, HasSubstr(fmt::format(
                             "{} of 111 blankets: population=loss:0.1 was not reached", above)));
    }
  }
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

/// In the plane and in space, with landmarks, and while the graph grows.
TEST_F(Sparsify, LinearConstraintsLoseNothing) {
  for (const Arguments& what :
       {Arguments{"@manhattan:poses=300", "--keep-every", "3"},
        {"@sphere:turns=6,poses_per_turn=12", "--keep-every", "2"},
        {"@landmarks2d:poses=300", "--nodes", "landmarks", "--keep-every", "4"},
        {"@manhattan:poses=300", "--keep-every", "3", "--online", "50"}}) {
    const auto told = [&](const char* topology) {
      Arguments arguments = what;
      arguments.insert(arguments.end(), {"--topology", topology});
      return report(arguments);
    };
    const boost::json::value tree = told("clt"), dense = told("glc");
    EXPECT_GT(number(tree.at("kld")), 0.1) << what.front();
    EXPECT_EQ(dense.at("status"), "converged");
    EXPECT_LT(dense.at("factors").at("out").as_int64(), tree.at("factors").at("out").as_int64());
    const auto nonzeros = [](const boost::json::value& of, const char* when) {
      return of.at("nonzeros").at(when).at("information").as_int64();
    };
    EXPECT_GT(nonzeros(dense, "after"), nonzeros(tree, "after"));
    // Online the linearisation point is the estimate of that time, and the map moves later.
    const bool online = what.size() > 3 && what[what.size() - 2] == "--online";
    EXPECT_LT(std::abs(number(dense.at("kld"))), online ? 0.1 * number(tree.at("kld")) : 1e-5)
        << what.front();
    if (!online) {
      EXPECT_EQ(nonzeros(dense, "before"), nonzeros(tree, "before"));
    }
  }
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

TEST_F(Sparsify, TheTableOfSolvedProblemsIsATabularOfLatex) {
  const std::string problems = folder_.file("problems.json"), latex = folder_.file("table.tex");
  study({"@manhattan:poses=150", "--keep-every", "4", "--record", problems});
  const boost::json::value told = study({problems, "--topology", "mi", "--topology",
                                         "best:most=100", "--recovery", "ncfd", "--latex", latex},
                                        "problems");
  const LatexTabular table = latex_tabular(read_text(latex));
  EXPECT_EQ(table.alignment, "llrrrrrrrr");
  const boost::json::array& rows = told.at("rows").as_array();
  ASSERT_EQ(table.rows.size(), rows.size() + 1);
  EXPECT_EQ(table.rows[0][2], "nodes");
  std::set<std::string> topologies;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const std::vector<std::string>& cells = table.rows[k + 1];
    ASSERT_EQ(cells.size(), 10U);
    topologies.insert(cells[0]);
    EXPECT_EQ(cells[1], "ncfd");
    EXPECT_EQ(cells[2], rows[k].at("nodes").is_null()
                            ? "all"
                            : std::to_string(rows[k].at("nodes").as_int64()));
    EXPECT_EQ(cells[3], std::to_string(rows[k].at("problems").as_int64()));
    EXPECT_NEAR(std::stod(cells[5]), number(rows[k].at("kld")),
                1e-3 * std::abs(number(rows[k].at("kld"))));
  }
  EXPECT_THAT(topologies, ElementsAre("best:most=100", "mi"));
}

TEST_F(Sparsify, SaysForHowManyBlanketsBestHadTooManyToTry) {
  const std::string file = folder_.file("problems.json");
  for (const Arguments& how : {Arguments{}, Arguments{"--online", "50"}}) {
    Arguments arguments{"@manhattan:poses=150,streets=4",
                        "--keep-every",
                        "3",
                        "--topology",
                        "best:most=100",
                        "--record",
                        file};
    arguments.insert(arguments.end(), how.begin(), how.end());
    const boost::json::value told = study(arguments);
    // As many as have more than 100 topologies of that population.
    const boost::json::value recorded = parse_json(read_text(file));
    std::int64_t large = 0;
    for (const boost::json::value& problem : recorded.at("problems").as_array()) {
      const double nodes = static_cast<double>(problem.at("blanket").as_array().size());
      const double pairs = nodes * (nodes - 1.0) / 2.0, count = std::min(pairs, 2.0 * (nodes - 1));
      large += std::round(std::exp(std::lgamma(pairs + 1) - std::lgamma(count + 1) -
                                   std::lgamma(pairs - count + 1))) > 100.0;
    }
    ASSERT_GT(large, 0);
    ASSERT_LT(large, told.at("problems").at("count").as_int64());
    const boost::json::array& notes = told.at("problems").at("notes").as_array();
    ASSERT_THAT(notes, SizeIs(1));
    EXPECT_EQ(notes[0].at("problems").as_int64(), large);
    // On the screen once.
    const std::string line = std::to_string(large) + " of " +
                             std::to_string(told.at("problems").at("count").as_int64()) +
                             " blankets: ";
    std::int64_t lines = 0;
    for (const boost::json::value& note : told.at("notes").as_array())
      lines += note.as_string().starts_with(line);
    EXPECT_EQ(lines, 1);
  }
  const boost::json::value again = study({file, "--topology", "best:most=100"}, "problems");
  std::int64_t all = 0, by_size = 0;
  for (const boost::json::value& row : again.at("rows").as_array()) {
    for (const boost::json::value& note : row.at("notes").as_array())
      (row.at("nodes").is_null() ? all : by_size) += note.at("problems").as_int64();
  }
  EXPECT_GT(all, 0);
  EXPECT_EQ(all, by_size);
  EXPECT_THAT(
      report({"@manhattan:poses=60", "--topology", "best"}).at("problems").at("notes").as_array(),
      SizeIs(0));
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
  EXPECT_THAT(refused({"@manhattan", "--redirect-to", "next"}, 2, {"study", "sparsify"}),
              HasSubstr("--online"));
  EXPECT_THAT(refused({"@manhattan:poses=60", "--topology", "mi", "--recovery", "closed_form"}, 2),
              HasSubstr("ncfd"));
  EXPECT_THAT(
      refused({"@manhattan:poses=60", "--topology", "cliquey", "-o", folder_.file("pairs.g2o")}, 2),
      HasSubstr("CORRELATED_PAIR"));
  EXPECT_THAT(
      refused({folder_.file("none.g2o"), "--topology", "glc", "-o", folder_.file("glc.g2o")}, 2),
      HasSubstr("(LINEAR_CONSTRAINT), which no format of graphs expresses"));
  EXPECT_THAT(refused({folder_.file("none.g2o"), "--topology", "glc", "--record",
                       folder_.file("problems.json")},
                      2, {"study", "sparsify"}),
              HasSubstr("choose another topology to record problems"));
  EXPECT_THAT(refused({folder_.file("none.json")}, 3, {"study", "problems"}),
              HasSubstr("none.json"));
  write_text(folder_.file("wrong.json"), "{}");
  EXPECT_THAT(refused({folder_.file("wrong.json")}, 3, {"study", "problems"}),
              HasSubstr("--record"));
}

TEST_F(Sparsify, SaysWhereThereIsNothingToTakeOut) {
  const boost::json::value told = report({"@manhattan:poses=60", "--nodes", "landmarks"});
  const boost::json::array& notes = told.at("notes").as_array();
  EXPECT_TRUE(std::ranges::any_of(notes, [](const boost::json::value& note) {
    return note.as_string().find("no landmark that may leave") != std::string::npos;
  }));
}

TEST_F(Sparsify, CurvesEndAtTheMeanOfTheRecoveries) {
  const std::string problems = folder_.file("problems.json"), curves = folder_.file("curves.csv");
  study({"@manhattan:poses=150", "--keep-every", "4", "--record", problems});
  for (const char* against : {"time", "iterations"}) {
    const boost::json::value told =
        study({problems, "--topology", "mi", "--recovery", "ncfd", "--recovery",
               "ip:initial=odb,tolerance=1e-4", "--curves", curves, "--against", against},
              "problems");
    const NumberTable table = read_number_table(read_text(curves), curves);
    int compared = 0;
    for (const boost::json::value& row : told.at("rows").as_array()) {
      if (row.at("nodes").is_null()) continue;
      const std::string name = std::string(row.at("recovery").as_string()) + "@" +
                               std::to_string(row.at("nodes").as_int64());
      const NumberTable::Column* column = table.find(name);
      ASSERT_TRUE(column) << name;
      // While it runs a method keeps the KLD up to date; at its end it is computed anew.
      EXPECT_NEAR(column->values.back(), row.at("kld").to_number<double>(), 1e-7) << name;
      EXPECT_GE(column->values.front(), column->values.back() - 1e-9) << name;
      ++compared;
    }
    EXPECT_GE(compared, 4) << against;
  }
}

TEST_F(Sparsify, WhatCannotLeaveStaysAndIsNamed) {
  // Cameras form no Lie group, and neither do points have another neighbour.
  const boost::json::value told = report({"@bundle", "--nodes", "all", "--keep-every", "2"});
  const boost::json::array& refused = told.at("refused").as_array();
  ASSERT_GT(refused.size(), 0U);
  EXPECT_THAT(std::string(refused.front().at("reason").as_string()),
              HasSubstr("poses of one kind and their landmarks only"));
  EXPECT_EQ(told.at("poses").at("kept"), told.at("poses").at("in"));
}

TEST_F(Sparsify, PosesLandmarksOrBothLeave) {
  const auto told = [&](const char* nodes) {
    return report({"@landmarks2d:poses=80", "--keep-every", "2", "--nodes", nodes});
  };
  const auto left = [](const boost::json::value& of) {
    EXPECT_TRUE(of.at("refused").as_array().empty());
    EXPECT_GE(number(of.at("kld")), -1e-6);
    return of.at("poses").at("in").as_int64() - of.at("poses").at("kept").as_int64();
  };
  const boost::json::value poses = told("poses"), landmarks = told("landmarks"), all = told("all");
  EXPECT_EQ(poses.at("nodes"), "poses");
  EXPECT_EQ(left(poses), 39);  // the newest stays
  EXPECT_GT(left(landmarks), 0);
  EXPECT_GT(left(all), 39);
  const Outcome online = cairn({"sparsify", "@landmarks2d:poses=80", "--keep-every", "2",
                                "--online", "20", "--nodes", "all"});
  EXPECT_EQ(online.exit_code, 2);
  EXPECT_THAT(online.err, HasSubstr("online only poses can be removed"));
}

TEST_F(Sparsify, AConservativeGraphClaimsNothingTooMuch) {
  const auto told = [&](const Arguments& more) {
    Arguments arguments{"@manhattan:poses=200,streets=4", "--keep-every", "4"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return report(arguments);
  };
  const boost::json::value free = told({"--sparsifier", "sparsify:resolve=false"});
  EXPECT_LT(number(free.at("conservative_margin")), -1.0);
  for (const char* recovery : {"fd:conservative=true", "ncfd:conservative=true"}) {
    const boost::json::value held =
        told({"--sparsifier", "sparsify:resolve=false", "--recovery", recovery});
    EXPECT_GT(number(held.at("conservative_margin")), -1e-4) << recovery;
    EXPECT_GT(number(held.at("kld")), number(free.at("kld")));
  }
  EXPECT_TRUE(told({"--no-kld"}).at("conservative_margin").is_null());
}

TEST_F(Sparsify, WhichNodeIsAnchoredIsNoLoss) {
  // The first pose may leave, so that the sparse graph is anchored at another one than the whole.
  const std::string in = folder_.file("in.g2o"), fixed = folder_.file("fixed.g2o");
  const Outcome made = cairn({"generate", "manhattan:poses=300", "--seed", "5", "-o", in});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  write_text(fixed, read_text(in) + "FIX 0\n");
  const double free = number(report({in, "--online", "50"}).at("kld"));
  const double held = number(report({fixed, "--online", "50"}).at("kld"));
  EXPECT_LT(free, 3.0 * held);
}

TEST_F(Sparsify, ALateFactorWithoutACovarianceIsDropped) {
  const std::string in = folder_.file("in.g2o");
  const Outcome made = cairn({"generate", "manhattan:poses=200", "-o", in});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const boost::json::value before = report({in, "--online", "50", "--keep-every", "4"});
  write_text(in, read_text(in) + "EDGE_SE2 10 127 1 0 0 2500 0 0 0 0 0\n");
  const boost::json::value told = report({in, "--online", "50", "--keep-every", "4"});
  EXPECT_EQ(told.at("dropped").as_int64(), before.at("dropped").as_int64() + 1);
}

TEST_F(Sparsify, TheStatusIsThatOfTheOptimizations) {
  const Outcome run = cairn({"sparsify", "@manhattan:poses=200", "--initial", "odometry",
                             "--iterations", "1", "--json", "-", "--quiet"});
  EXPECT_EQ(run.exit_code, 4) << run.err;
  EXPECT_EQ(parse_json(run.out).at("status"), "max_iterations");
}

}  // namespace
}  // namespace cairn::test
