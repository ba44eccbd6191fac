// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include <fmt/format.h>

#include "study_report.hpp"
#include "tables.hpp"
#include "thesis_figures.hpp"

namespace cairn::performance {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// A run that took out half of 100 poses.
std::string run(double kld, double seconds) {
  return fmt::format(
      R"({{"poses": {{"in": 100, "kept": 50}}, "factors": {{"in": 300, "out": 200}},
          "problems": {{"count": 49, "mean_blanket": 2.5, "largest_blanket": 9}}, "kld": {},
          "kld_parts": {{"mean": 0.5}}, "rmse": 0.02, "rmse_aligned": 0.01, "rmse_full": 0.4,
          "seconds": {{"total": {}, "topology": 0.25, "select": 0.125}},
          "steps": {{"median": 0.001, "p99": 0.002, "max": 0.003}}}})",
      kld, seconds);
}

std::string contestant(const std::string& name, const std::string& runs) {
  return fmt::format(R"({{"name": "{}", "in_time": true, "limit": 300, "runs": [{}]}})", name,
                     runs);
}

/// An entry of these contestants, with more members.
std::string entry(const std::string& graph, const std::string& contestants,
                  const std::string& more = R"("part": "")") {
  return fmt::format(R"({{"name": "{}", {}, "contestants": [{}]}})", graph, more, contestants);
}

std::string sets_entry(const std::string& graph, int keep_every, double kld) {
  return entry(graph,
               contestant("clt", run(10.0 * kld, 0.1)) + "," +
                   contestant("ncfd", run(kld, 1.0) + "," + run(kld, 3.0)),
               fmt::format(R"("scheme": "single", "keep_every": {})", keep_every));
}

TEST(ThesisFigures, AreFoundByGraphSchemeAndPartKept) {
  EXPECT_EQ(thesis_counts("M3500", "multi", "mi", 4).problems, 909.0);
  EXPECT_EQ(thesis_loss("MITb", "multi", "ncfd", 10).kld, 0.28);
  EXPECT_EQ(thesis_loss("Intel", "single", "clt", 5).kld, thesis_topology("Intel", "clt").kld);
  EXPECT_TRUE(std::isnan(thesis_loss("M3500", "runs", "ncfd", 5).kld));
  EXPECT_TRUE(std::isnan(thesis_loss("M3500", "single", "ncfd", 7).kld));
}

TEST(SparsifyTables, PutCountsBesideTheThesiss) {
  const boost::json::value sets =
      report("sparsify_sets", sets_entry("M3500", 3, 4.0) + "," + sets_entry("M3500", 5, 4.0) +
                                  "," + sets_entry("city", 5, 4.0));
  const std::string table = section(sets, "sparsify-counts");
  EXPECT_THAT(table, HasSubstr("| M3500 | single | clt | 49 / 2332 | - / 2624 | 49 / 2799 |"));
  EXPECT_THAT(table, HasSubstr("| city | single | mi | - | - | 49 | - |"));
}

TEST(SparsifyTables, PutLossesBesideTheThesiss) {
  const boost::json::value sets =
      report("sparsify_sets", sets_entry("M3500", 5, 5.38) + "," + sets_entry("city", 5, 4.0));
  const std::string table = section(sets, "sparsify-recovery");
  EXPECT_THAT(table, HasSubstr("|  |  |  | ncfd | 5.38 | 2.69 | 2.00 × | 0.0200 | 0.035 | 2.00 | "
                               "3.9 |\n"));
  EXPECT_THAT(table, HasSubstr("|  |  |  | ncfd | 4.00 |  |  | 0.0200 |  | 2.00 |  |\n"));
  const std::string ratios = section(sets, "sparsify-ratios");
  EXPECT_THAT(ratios, HasSubstr("| ncfd | 1 | 2.00 × | 2.00 × | 2.00 × |"));
  EXPECT_THAT(ratios, HasSubstr("| 1.95 × |\n"));
}

TEST(SparsifyTables, CompareLossesAtCommonStates) {
  const std::string more = R"("scheme": "multi", "keep_every": 5)";
  const boost::json::value sets = report(
      "sparsify_sets",
      entry("M3500",
            contestant("common ncfd", run(4.0, 0.5)) + "," + contestant("default", run(3.0, 0.5)),
            more) +
          "," + entry("city", contestant("clt", run(4.0, 0.5)), more));
  const std::string table = section(sets, "sparsify-common");
  EXPECT_THAT(table, HasSubstr("| M3500 | multi | 5 | - | - | 4.00 | 0.0100 | 3.00 | 0.0100 | "
                               "0.400 |\n"));
  EXPECT_THAT(table, Not(HasSubstr("city")));
}

TEST(SparsifyTables, PutTopologiesBesideTheThesiss) {
  const boost::json::value topologies = report(
      "sparsify_topology",
      entry("Intel", contestant("tree:2 odd", run(1.99, 0.5)), R"("part": "topologies")") + "," +
          entry("Intel", contestant("mi:epsilon=0.1", run(5.0, 0.5)),
                R"("part": "regularization")"));
  const std::string table = section(topologies, "sparsify-topology");
  EXPECT_THAT(table, HasSubstr("| Intel | `tree:2 odd` | 1.99 | 3.98 | 0.500 × | 0.0200 | 0.03 | "
                               "0.500 | 5.31 | 0.250 | 0.1 | 200 | 563 |\n"));
  EXPECT_THAT(table, Not(HasSubstr("epsilon")));
  EXPECT_THAT(section(topologies, "sparsify-regularization"),
              HasSubstr("| Intel | `mi` | - | - | 5.00 | - | - | 5.15 |\n"));
}

TEST(SparsifyTables, TellWholeGraphsApart) {
  const boost::json::value whole = report(
      "sparsify_whole",
      entry("sphere", contestant("default", run(3.0, 0.5)) + "," + contestant("clt", run(9.0, 0.1)),
            R"("part": "space", "keep_every": 2)") +
          "," +
          entry("city", contestant("late", run(3.0, 0.5)), R"("part": "large", "keep_every": 5)"));
  EXPECT_THAT(section(whole, "sparsify-space"),
              HasSubstr("| sphere | 2 | default | 50 of 100 | 200 of 300 | 2.50 | 9 | 3.00 | 0.500 "
                        "| 0.0100 | 0.500 |\n|  |  | `clt` |"));
  EXPECT_THAT(section(whole, "sparsify-space"), Not(HasSubstr("city")));
  EXPECT_THAT(section(whole, "sparsify-large"),
              HasSubstr("| city | every 100 poses | 50 of 100 | 200 of 300 | 2.50 | 9 | 3.00 | "
                        "0.500 | 0.0600 | 0.0100 | 0.500 | 10.0 |\n"));
}

TEST(SparsifyTables, CompareStepsWithThoseOfAllNodes) {
  const std::string table =
      section(report("sparsify_online",
                     entry("manhattan", contestant("late", run(3.0, 0.5)),
                           R"("steps_of_all": {"median": 0.004, "p99": 0.005, "max": 0.006})")),
              "sparsify-online");
  EXPECT_THAT(table, HasSubstr("| manhattan | all nodes stay | 100 | 300 |  |  |  |  | 4.00 | 5.00 "
                               "| 6.00 |  |\n"));
  EXPECT_THAT(table, HasSubstr("| 0.400 | 1.00 | 2.00 | 3.00 | 0.500 |\n"));
}

TEST(SparsifyTables, TellWhatSelectingTakes) {
  EXPECT_THAT(section(report("sparsify_selection",
                             entry("M3500", contestant("oldest:part=0.5", run(3.0, 0.5)))),
                      "sparsify-selection"),
              HasSubstr("| M3500 | `oldest:part=0.5` | 50 of 100 | 200 of 300 | 2.50 | 9 | 3.00 | "
                        "0.500 | 0.0100 | 0.125 | 0.500 |\n"));
}

TEST(SparsifyTables, ShowEveryChoiceOfLoopClosures) {
  const auto of = [](double kld, double connectivity, const std::string& bounds) {
    return fmt::format(
        R"({{"loops": {{"in": 40, "kept": 10}}, "kld": {}, "rmse_aligned": 0.25,
            "connectivity": {{"rotation": {{"full": 8, "sparse": {}{}}}}},
            "seconds": {{"select": 1.5}}}})",
        kld, connectivity, bounds);
  };
  const auto made =
      report("sparsify_edges",
             entry("M3500", contestant("mac", of(3.0, 2.0, R"(, "bound": 4)")) + "," +
                                contestant("random", of(5.0, 1.0, "") + "," + of(7.0, 1.0, "") +
                                                         "," + of(4.0, 1.0, ""))));
  EXPECT_THAT(section(made, "sparsify-edges-kld"),
              HasSubstr("| M3500 | 10 of 40 | - | 3.00 | - | - | - | - | 5.00 |\n"));
  EXPECT_THAT(section(made, "sparsify-edges-connectivity"),
              HasSubstr("| M3500 | 10 of 40 | 50 % | 25 % | - | - | - | - | 12 % |\n"));
  EXPECT_THAT(section(made, "sparsify-edges-rmse"), HasSubstr("| 0.250 | - |"));
  EXPECT_THAT(section(made, "sparsify-edges-time"), HasSubstr("| 1.50 | - |"));
}

// Single problems
// ------------------------------------------------------------------------------------------------

std::string row(const std::string& topology, const std::string& recovery, const std::string& nodes,
                double kld, const std::string& more = R"("refused": 0, "not_converged": 0)") {
  return fmt::format(
      R"({{"topology": "{}", "recovery": "{}", "nodes": {}, "problems": 8, "kld": {},
          "kld_deviation": 0.25, "largest_excess": 1e-5, "factors": 5, "iterations": 12, {},
          "not_positive": 0, "seconds": {{"topology": 1e-6, "recovery_median": 2e-6}}}})",
      topology, recovery, nodes, kld, more);
}

boost::json::value problems_report(const std::string& part, const std::string& rows) {
  return report("sparsify_problems",
                fmt::format(R"({{"part": "{}", "recording": "whole", "rows": [{}]}})", part, rows));
}

TEST(SparsifyProblemTables, CompareRecoveriesBySize) {
  const std::string table = section(
      problems_report("recovery", row("mi", "ip", "null", 0.5) + "," + row("mi", "ip", "4", 1e-17) +
                                      "," + row("mi", "fd", "4", 0.25)),
      "sparsify-problems");
  EXPECT_THAT(table, HasSubstr("| whole graph | all | 8 | 5.00 | 0.500 | - | - | 1e-05 | - |"));
  EXPECT_THAT(table, HasSubstr("|  | 4 | 8 | 5.00 | 0 | 1e-05 | - | 1e-05 | - |"));
  EXPECT_THAT(table, HasSubstr("|  | 4 | 12.0 | - | 12.0 | - | 2.00 | - | 2.00 | - |\n"));
  EXPECT_THAT(table, HasSubstr("8 recoveries: all converged"));
}

TEST(SparsifyProblemTables, SayWhoFailed) {
  EXPECT_THAT(section(problems_report("recovery", row("mi", "pqn:memory=3", "null", 0.5,
                                                      R"("refused": 2, "not_converged": 1)")),
                      "sparsify-problems"),
              HasSubstr("10 recoveries; 1 did not converge (`pqn`, to 1e-3); 2 were refused "
                        "(`pqn`, to 1e-3).\n"));
}

TEST(SparsifyProblemTables, CompareInitialGuesses) {
  EXPECT_THAT(
      section(problems_report("initial", row("mi", "fd:initial=odb,iterations=0", "4", 2.0) + "," +
                                             row("mi", "ncfd", "4", 1.0)),
              "sparsify-initial"),
      HasSubstr("| whole graph | 4 | 8 | - ± - | 2.00 ± 0.250 | - ± - | - ± - | "
                "1.00 ± 0.250 |\n"));
}

TEST(SparsifyProblemTables, CompareTopologiesThatDidAllProblems) {
  const std::string table =
      section(problems_report(
                  "topology",
                  row("mi", "ncfd", "4", 2.0) + "," + row("best:most=9", "ncfd", "4", 1.0) + "," +
                      row("mi", "ncfd", "5", 4.0) + "," +
                      row("best:most=9", "ncfd", "5", 3.0, R"("refused": 1, "not_converged": 0)")),
              "sparsify-topologies");
  EXPECT_THAT(table, HasSubstr("| 8 | 5.00 | 2.00 | - | - | - | - | 1.00 | 1.00 |"));
  EXPECT_THAT(table, HasSubstr("| 8 | 5.00 | 4.00 | - | - | - | - | - | 1.00 |"));
}

}  // namespace
}  // namespace cairn::performance
