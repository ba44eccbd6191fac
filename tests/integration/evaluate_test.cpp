// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <utility>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "integration/latex_tabular.hpp"
#include "integration/process.hpp"
#include "support/components.hpp"

namespace cairn::test {
namespace {

using ::testing::AllOf;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;

boost::json::value errors(const std::string& estimate, const std::string& truth) {
  const Outcome outcome = cairn({"evaluate", estimate, truth, "--json", "-"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  return parse_json(outcome.out);
}

double number(const boost::json::value& report, const char* error, const char* part) {
  return report.at(error).at(part).as_double();
}

TEST(EvaluateCommand, OptimisingBringsTheEstimateNearerToTheTruth) {
  const TemporaryFolder folder;
  const std::string graph = folder.file("graph.g2o"), truth = folder.file("truth.g2o"),
                    best = folder.file("best.g2o");
  ASSERT_EQ(
      cairn({"generate", "manhattan:poses=300", "-o", graph, "--ground-truth", truth}).exit_code,
      0);
  ASSERT_EQ(cairn({"optimize", graph, "-o", best}).exit_code, 0);
  const auto before = errors(graph, truth), after = errors(best, truth),
             itself = errors(truth, truth);
  for (const char* error : {"ate", "rpe_all"}) {
    EXPECT_LT(number(after, error, "translation"), number(before, error, "translation")) << error;
    EXPECT_LT(number(after, error, "rotation"), number(before, error, "rotation")) << error;
  }
  for (const char* error : {"ate", "rpe", "rpe_all"}) {
    EXPECT_NEAR(number(itself, error, "translation"), 0.0, 1e-9) << error;
  }
  EXPECT_EQ(after.at("poses").at("compared").as_int64(), 300);
}

TEST(EvaluateCommand, ARigidMotionIsNoError) {
  const TemporaryFolder folder;
  write_text(folder.file("a.g2o"), "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 1 2 0\n");
  // The same, turned by a quarter and moved by (5, -3).
  write_text(folder.file("b.g2o"),
             "VERTEX_SE2 0 5 -3 1.5707963267948966\nVERTEX_SE2 1 5 -2 1.5707963267948966\n"
             "VERTEX_SE2 2 3 -2 1.5707963267948966\n");
  const auto report = errors(folder.file("a.g2o"), folder.file("b.g2o"));
  EXPECT_NEAR(number(report, "ate", "translation"), 0.0, 1e-12);
  EXPECT_NEAR(number(report, "ate", "rotation"), 0.0, 1e-6);
}

TEST(EvaluateCommand, PosesInOnlyOneOfTheFilesAreTold) {
  const TemporaryFolder folder;
  write_text(folder.file("a.g2o"), "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 1 2 0\n");
  write_text(folder.file("b.g2o"),
             "VERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 1 2 0\nVERTEX_SE2 8 1 2 0\nVERTEX_SE2 9 1 2 0\n");
  const Outcome outcome = cairn({"evaluate", folder.file("a.g2o"), folder.file("b.g2o")});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("1 pose of " + folder.file("a.g2o")));
  EXPECT_THAT(outcome.err, HasSubstr("2 poses of " + folder.file("b.g2o")));
  EXPECT_THAT(outcome.out, HasSubstr("2 poses compared"));
  const auto report = errors(folder.file("a.g2o"), folder.file("b.g2o"));
  EXPECT_EQ(report.at("poses").at("only_in_truth").as_int64(), 2);
}

TEST(EvaluateCommand, NothingInCommonIsAnError) {
  const TemporaryFolder folder;
  write_text(folder.file("a.g2o"), "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\n");
  write_text(folder.file("b.g2o"), "VERTEX_SE2 5 0 0 0\nVERTEX_SE2 6 1 0 0\n");
  EXPECT_EQ(cairn({"evaluate", folder.file("a.g2o"), folder.file("b.g2o")}).exit_code, 3);
}

// Divergence --------------------------------------------------------------------------------------

class EvaluateDivergence : public ::testing::Test {
 protected:
  void SetUp() override {
    CAIRN_NEEDS("sparsifier", "sparsify");
    report_of({"generate", "manhattan:poses=120", "-o", raw_});
    report_of({"optimize", raw_, "-o", best_});
    from_sparsify_ = report_of({"sparsify", best_, "--as-given", "--keep-every", "3",
                                "--population", "tree:1", "-o", sparse_});
  }
  boost::json::value report(const std::string& estimate, const std::string& truth,
                            Arguments more = {}) {
    more.insert(more.begin(), {"evaluate", estimate, truth, "--kld"});
    return report_of(more);
  }
  void expect_refusal(const Arguments& arguments, int exit_code, const char* says) {
    const Outcome outcome = cairn(arguments);
    EXPECT_EQ(outcome.exit_code, exit_code) << outcome.err;
    EXPECT_THAT(unfolded(outcome.err), HasSubstr(says));
  }
  TemporaryFolder folder_;
  std::string raw_ = folder_.file("raw.g2o"), best_ = folder_.file("best.g2o"),
              sparse_ = folder_.file("sparse.g2o");
  boost::json::value from_sparsify_;
};

TEST(EvaluateCommand, APlanarEstimateBesideASpatialTruthIsSaid) {
  CAIRN_NEEDS("variable", "VERTEX_SE3:QUAT");
  const TemporaryFolder folder;
  const std::string plane = folder.file("plane.g2o"), space = folder.file("space.g2o"),
                    flat = folder.file("flat.g2o");
  write_text(plane, "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 2 1 0\n");
  const std::string level = " 0 0 0 1\n";
  write_text(space, "VERTEX_SE3:QUAT 0 0 0 0" + level + "VERTEX_SE3:QUAT 1 1 0 0.5" + level +
                        "VERTEX_SE3:QUAT 2 2 1 0.1" + level);
  write_text(flat, "VERTEX_SE3:QUAT 0 0 0 0" + level + "VERTEX_SE3:QUAT 1 1 0 0" + level +
                       "VERTEX_SE3:QUAT 2 2 1 0" + level);
  EXPECT_THAT(cairn({"evaluate", plane, space}).err,
              HasSubstr("plane.g2o is of the plane and space.g2o in space: heights, roll"));
  EXPECT_THAT(cairn({"evaluate", space, plane}).err, HasSubstr("plane.g2o is of the plane and "));
  for (const Arguments& quiet :
       {Arguments{"evaluate", plane, space, "--planar"}, Arguments{"evaluate", plane, flat},
        Arguments{"evaluate", space, flat}, Arguments{"evaluate", plane, plane}}) {
    EXPECT_EQ(cairn(quiet).err, "") << quiet[1] << " " << quiet[2];
  }
}

TEST_F(EvaluateDivergence, IsATableOfLatexToo) {
  const std::string latex = folder_.file("errors.tex");
  const Outcome outcome = cairn({"evaluate", sparse_, best_, "--kld", "--latex", latex});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  std::ifstream file(latex);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const std::string ate =
      fmt::format("{:.6g}", errors(sparse_, best_).at("ate").at("translation").to_number<double>());
  EXPECT_THAT(text, HasSubstr("\\begin{tabular}{lrr}\n\\hline\n"));
  EXPECT_THAT(text, HasSubstr(" & translation [m] & rotation [deg] \\\\\n\\hline\n"));
  EXPECT_THAT(text, HasSubstr("ATE (absolute, after rigid alignment) & " + ate + " & "));
  EXPECT_THAT(text, HasSubstr("\\begin{tabular}{lr}\n"));
  EXPECT_THAT(text, EndsWith("\\hline\n\\end{tabular}\n"));
  const Outcome printed = cairn({"evaluate", sparse_, best_, "--latex", "-"});
  EXPECT_THAT(latex_tabular(printed.out).rows, SizeIs(4));
}

TEST_F(EvaluateDivergence, OfASparseGraphIsWhatSparsifyReports) {
  const auto found = report(sparse_, best_);
  const double expected = from_sparsify_.at("kld").as_double();
  EXPECT_GT(expected, 0.01);
  EXPECT_NEAR(found.at("kld").as_double(), expected, 1e-4 * expected);
  EXPECT_NEAR(found.at("kld_parts").at("covariance").as_double() +
                  found.at("kld_parts").at("mean").as_double(),
              found.at("kld").as_double(), 1e-9);
  EXPECT_EQ(found.at("kld_of").at("compared_at").as_string(), "common");
  EXPECT_EQ(found.at("kld_of").at("linear_solver").as_string(), "block_cholesky");
  EXPECT_EQ(found.at("kld_of").at("variables").as_int64(),
            from_sparsify_.at("poses").at("kept").as_int64());
  EXPECT_TRUE(found.as_object().contains("ate"));
  // The reverse: the marginal of the larger graph on the nodes of the smaller.
  const double back = report(best_, sparse_).at("kld").as_double();
  EXPECT_GT(back, 0.01);
  EXPECT_NE(back, found.at("kld").as_double());
  EXPECT_NEAR(report(best_, best_).at("kld").as_double(), 0.0, 1e-6);
  EXPECT_FALSE(errors(sparse_, best_).as_object().contains("kld"));
  const Outcome text = cairn({"evaluate", sparse_, best_, "--kld"});
  EXPECT_THAT(text.out, HasSubstr("at the states of TRUTH"));
  EXPECT_THAT(text.out, HasSubstr("divergence"));
}

TEST_F(EvaluateDivergence, AtTheMinimaOfBothIsAnother) {
  const std::string moved = folder_.file("moved.g2o");
  const auto study = report_of({"study", "sparsify", best_, "--as-given", "--keep-every", "3",
                                "--population", "tree:1", "--compared-at", "minima", "-o", moved});
  const auto found = report(moved, best_, {"--compared-at", "minima"});
  EXPECT_EQ(found.at("kld_of").at("compared_at").as_string(), "minima");
  const double expected = study.at("kld").as_double();
  EXPECT_NEAR(found.at("kld").as_double(), expected, 1e-4 * expected);
  EXPECT_THAT(cairn({"evaluate", sparse_, best_, "--kld", "--compared-at", "minima"}).out,
              HasSubstr("at the states of each"));
}

TEST_F(EvaluateDivergence, OfGraphsWithNodesOfTheirOwnIsOfThoseOfBoth) {
  const std::string other = folder_.file("other.g2o");
  report_of({"sparsify", best_, "--as-given", "--keep-every", "2", "-o", other});
  const auto found = report(sparse_, other);
  EXPECT_GT(found.at("kld").as_double(), 0.0);
  EXPECT_LT(found.at("kld_of").at("variables").as_int64(),
            from_sparsify_.at("poses").at("kept").as_int64());
}

TEST_F(EvaluateDivergence, SaysWhatCannotBeCompared) {
  write_text(folder_.file("poses.g2o"), "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 3 1 0 0\n");
  expect_refusal({"evaluate", folder_.file("poses.g2o"), best_, "--kld"}, 3, "has no factors");
  expect_refusal({"evaluate", sparse_, best_, "--kld", "--offset", "1"}, 2,
                 "--kld compares variables by id; leave out --offset");
  expect_refusal({"evaluate", sparse_, best_, "--kld", "--compared-at", "home"}, 2, "common");
  write_text(folder_.file("fixed.g2o"), read_text(best_) + "FIX 0\nFIX 60\n");
  expect_refusal({"evaluate", folder_.file("fixed.g2o"), best_, "--kld"}, 3,
                 "constant in one of the graphs and free in the other");
  report_of({"generate", "sphere", "-o", folder_.file("space.g2o")});
  expect_refusal({"evaluate", sparse_, folder_.file("space.g2o"), "--kld"}, 3,
                 "VERTEX_SE2 0 of ESTIMATE is VERTEX_SE3:QUAT 0 in TRUTH");
}

TEST_F(EvaluateDivergence, RefusesASolverThatCannotBeforeItReadsAFile) {
  CAIRN_NEEDS("linear_solver", "pcg");
  expect_refusal({"evaluate", "no.g2o", "where.g2o", "--kld", "--linear-solver", "pcg"}, 2,
                 "linear solver 'pcg' gives no determinants and covariances");
}

// Time --------------------------------------------------------------------------------------------

/// A drive round a curve, a pose every `step` seconds from `begin`, its stamps `late`.
std::string tum_drive(int poses, double begin, double step, double late) {
  std::ostringstream text;
  text.precision(17);
  for (int k = 0; k < poses; ++k) {
    const double time = begin + k * step;
    text << time + late << ' ' << std::cos(time) << ' ' << std::sin(time) << ' ' << 0.1 * time
         << " 0 0 " << std::sin(0.5 * time) << ' ' << std::cos(0.5 * time) << '\n';
  }
  return text.str();
}

class EvaluateByTime : public ::testing::Test {
 protected:
  EvaluateByTime() {
    write_text(estimate_, tum_drive(20, 1.5, 0.25, 0.0));
    write_text(truth_, tum_drive(200, 1.0, 0.05, 0.004));
  }
  boost::json::value report(Arguments options) {
    options.insert(options.begin(), {"evaluate", estimate_, truth_});
    return report_of(options);
  }
  void expect_refusal(Arguments options, int exit_code, const std::string& says) {
    options.insert(options.begin(), {"evaluate", estimate_, truth_, "--quiet"});
    const Outcome outcome = cairn(options);
    EXPECT_EQ(outcome.exit_code, exit_code) << outcome.out;
    EXPECT_THAT(outcome.err, HasSubstr(says));
  }

  TemporaryFolder folder_;
  std::string estimate_ = folder_.file("estimate.tum"), truth_ = folder_.file("truth.tum");
};

TEST_F(EvaluateByTime, FilesOfOtherRatesAreMatchedByStamp) {
  const auto errors = report({});
  EXPECT_NEAR(number(errors, "ate", "translation"), 0.0, 1e-12);
  EXPECT_NEAR(number(errors, "rpe", "rotation"), 0.0, 1e-6);
  EXPECT_EQ(errors.at("association").at("by").as_string(), "stamp");
  EXPECT_EQ(errors.at("association").at("max_time_difference").as_double(), 0.01);
  EXPECT_NEAR(number(errors, "association", "largest_time_difference"), 0.004, 1e-9);
  EXPECT_EQ(errors.at("poses").at("compared").as_int64(), 20);
  EXPECT_EQ(errors.at("poses").at("only_in_truth").as_int64(), 180);
  EXPECT_THAT(cairn({"evaluate", estimate_, truth_}).out, HasSubstr("matched by time"));
}

TEST_F(EvaluateByTime, MatchingByIdGoesByRow) {
  const auto errors = report({"--match", "id"});
  EXPECT_EQ(errors.at("association").at("by").as_string(), "id");
  EXPECT_GT(number(errors, "rpe", "translation"), 0.1);
}

TEST_F(EvaluateByTime, AnOffsetIsAddedToTheEstimate) {
  write_text(estimate_, tum_drive(20, 1.5, 0.25, 1000.004));
  expect_refusal({}, 3, "--offset -1000.5 ");
  const auto errors = report({"--offset", "-1000", "--max-time-difference", "1e-5"});
  EXPECT_EQ(errors.at("poses").at("compared").as_int64(), 20);
  EXPECT_NEAR(number(errors, "ate", "translation"), 0.0, 1e-12);
}

TEST_F(EvaluateByTime, TooLittleDifferenceIsAnErrorThatNamesTheNearest) {
  expect_refusal({"--max-time-difference", "0.001"}, 3, "the nearest two are 0.004 s apart");
}

TEST_F(EvaluateByTime, KittiFilesHaveTheirStampsBesideThem) {
  const std::string kitti = folder_.file("drive.kitti"), times = folder_.file("times.txt");
  ASSERT_EQ(cairn({"convert", estimate_, kitti}).exit_code, 0);
  std::string text;
  for (int k = 0; k < 20; ++k) text += std::to_string(1.5 + k * 0.25) + "\n";
  write_text(times, text);
  const auto errors = report_of({"evaluate", kitti, truth_, "--stamps", times});
  EXPECT_NEAR(number(errors, "ate", "translation"), 0.0, 1e-9);
  EXPECT_EQ(errors.at("association").at("by").as_string(), "stamp");
  const auto swapped = report_of({"evaluate", truth_, kitti, "--truth-stamps", times});
  EXPECT_NEAR(number(swapped, "ate", "translation"), 0.0, 1e-9);
  EXPECT_EQ(swapped.at("poses").at("compared").as_int64(), 20);

  write_text(times, text + "9\n");
  const Outcome outcome = cairn({"evaluate", kitti, truth_, "--stamps", times});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("times.txt: 21 stamps for 20 poses"));
}

TEST_F(EvaluateByTime, WhatCannotBeDoneWithoutStampsSaysWhereTheyGo) {
  write_text(truth_, "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\n");
  EXPECT_EQ(cairn({"evaluate", estimate_, truth_, "--match", "id"}).exit_code, 0);  // by row
  expect_refusal({"--offset", "1"}, 2, "--truth-stamps FILE");
  expect_refusal({"--match", "stamp"}, 2, "--truth-stamps FILE");
  expect_refusal({"--match", "id", "--offset", "1"}, 2, "leave out --offset");
  expect_refusal({"--offset", "nan"}, 2, "'nan' is not a finite number");
  expect_refusal({"--max-time-difference=-1"}, 2, "'-1' is not a finite number of 0 or more");
}

// Key frames with ids beside a truth with times: pose k is not row k.
TEST_F(EvaluateByTime, IdsAreNotComparedWithRowNumbersInSilence) {
  std::string frames, times;
  for (int k = 0; k < 8; ++k) {
    const double t = 1.0 + k;
    frames += fmt::format("VERTEX_SE3:QUAT {} {:.17g} {:.17g} {:.17g} 0 0 {:.17g} {:.17g}\n", k,
                          std::cos(t), std::sin(t), 0.1 * t, std::sin(0.5 * t), std::cos(0.5 * t));
    times += fmt::format("{}\n", t + 0.004);
  }
  const std::string graph = folder_.file("frames.g2o"), clock = folder_.file("frames.txt");
  write_text(graph, frames);
  write_text(clock, times);
  const Outcome refused = cairn({"evaluate", graph, truth_});
  EXPECT_EQ(refused.exit_code, 3) << refused.out;
  EXPECT_THAT(unfolded(refused.err),
              AllOf(HasSubstr("truth.tum: has times and no ids, so that pose k would be compared "
                              "with row k, and 192 poses left without a partner"),
                    HasSubstr("--stamps FILE, the times of " + graph),
                    HasSubstr("--match id compares by row")));
  const auto timed = report_of({"evaluate", graph, truth_, "--stamps", clock});
  EXPECT_NEAR(number(timed, "ate", "translation"), 0.0, 1e-12);
  EXPECT_EQ(timed.at("poses").at("compared").as_int64(), 8);
  // The other way round it is the truth that has no times.
  EXPECT_THAT(unfolded(cairn({"evaluate", truth_, graph}).err),
              HasSubstr("--truth-stamps FILE, the times of " + graph));
  // As asked for, it is said in the results.
  const Outcome by_row = cairn({"evaluate", graph, truth_, "--match", "id"});
  EXPECT_EQ(by_row.exit_code, 0);
  EXPECT_THAT(by_row.out, HasSubstr("8 poses compared, id k with row k"));
  EXPECT_TRUE(report_of({"evaluate", graph, truth_, "--match", "id"})
                  .at("association")
                  .at("row_numbers")
                  .as_bool());
  EXPECT_THAT(cairn({"evaluate", graph, graph}).out, HasSubstr("8 poses compared, matched by id"));
}

TEST_F(EvaluateByTime, RowsOfAsManyPosesOrWithoutTimesAreComparedWithANote) {
  const std::string graph = folder_.file("rows.g2o"), kitti = folder_.file("rows.kitti");
  std::string poses, rows;
  for (int k = 0; k < 20; ++k) {
    poses += fmt::format("VERTEX_SE2 {} {} 0 0\n", k, k);
    rows += fmt::format("1 0 0 {} 0 1 0 0 0 0 1 0\n", k);
  }
  write_text(graph, poses);
  write_text(kitti, rows);
  const Outcome as_many = cairn({"evaluate", graph, estimate_});
  EXPECT_EQ(as_many.exit_code, 0);
  EXPECT_THAT(unfolded(as_many.err),
              HasSubstr("has no ids, and pose k is compared with row k of as many; --stamps FILE"));
  EXPECT_THAT(unfolded(cairn({"evaluate", graph, kitti}).err), Not(HasSubstr("has no ids")));
  write_text(kitti, rows + rows);
  const Outcome more = cairn({"evaluate", graph, kitti});
  EXPECT_EQ(more.exit_code, 0);
  EXPECT_THAT(unfolded(more.err),
              AllOf(HasSubstr("rows.kitti: has no ids, and pose k is compared with row k, with 20 "
                              "poses left without a partner: right if ids are row numbers"),
                    HasSubstr("--match id")));
  EXPECT_THAT(cairn({"evaluate", graph, kitti, "--match", "id"}).err, Not(HasSubstr("row k")));
  EXPECT_THAT(more.out, HasSubstr("id k with row k"));
}

TEST_F(EvaluateByTime, AnInstantThatIsThereTwiceIsComparedOnce) {
  const std::string drive = tum_drive(200, 1.0, 0.05, 0.004);
  const std::size_t line = drive.find('\n') + 1;
  write_text(truth_, drive.substr(0, line) + drive);  // the first row twice
  const Outcome outcome = cairn({"evaluate", estimate_, truth_});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(unfolded(outcome.err), HasSubstr("1 row has the stamp of an earlier row"));
  const auto errors = report({});
  EXPECT_EQ(errors.at("poses").at("compared").as_int64(), 20);
  EXPECT_NEAR(number(errors, "ate", "translation"), 0.0, 1e-12);
}

/// The same drive as EuRoC has it: commas, nanoseconds, w first, and columns for what moves it.
std::string euroc_drive(int poses, double begin, double step) {
  std::string text =
      "#timestamp [ns], p_x [m], p_y [m], p_z [m], q_w [], q_x [], q_y [], q_z [], v_x, "
      "v_y, v_z\n";
  for (int k = 0; k < poses; ++k) {
    const double t = begin + k * step;
    text += fmt::format("{}{:09},{:.17g},{:.17g},{:.17g},{:.17g},0,0,{:.17g},0,0,0\n", 1403715524,
                        std::llround(t * 1e7), std::cos(t), std::sin(t), 0.1 * t, std::cos(0.5 * t),
                        std::sin(0.5 * t));
  }
  return text;
}

TEST_F(EvaluateByTime, EurocIsComparedWithTumByItsNanoseconds) {
  const std::string euroc = folder_.file("euroc.csv"), nanoseconds = folder_.file("ns.tum");
  write_text(euroc, euroc_drive(100, 1.0, 0.05));
  std::string slow, fast;
  for (int k = 0; k < 20; ++k) {
    const double t = 1.5 + 0.1 * k;
    const std::string pose =
        fmt::format("{:.17g} {:.17g} {:.17g} 0 0 {:.17g} {:.17g}", std::cos(t), std::sin(t),
                    0.1 * t, std::sin(0.5 * t), std::cos(0.5 * t));
    slow += fmt::format("1403715524.{:09} {}\n", std::llround(t * 1e7), pose);
    fast += fmt::format("1403715524{:09} {}\n", std::llround(t * 1e7), pose);
  }
  write_text(estimate_, slow);
  write_text(nanoseconds, fast);
  for (const auto& [a, b] : {std::pair{estimate_, euroc},
                             {euroc, estimate_},
                             {nanoseconds, euroc},
                             {nanoseconds, estimate_}}) {
    const auto errors = report_of({"evaluate", a, b});
    EXPECT_EQ(errors.at("poses").at("compared").as_int64(), 20) << a << " " << b;
    EXPECT_NEAR(number(errors, "ate", "translation"), 0.0, 1e-12);
    EXPECT_NEAR(number(errors, "ate", "rotation"), 0.0, 1e-6);
    EXPECT_EQ(number(errors, "association", "largest_time_difference"), 0.0);
  }
  // Its times stay with it.
  const std::string tum = folder_.file("euroc.tum");
  ASSERT_EQ(cairn({"convert", euroc, tum}).exit_code, 0);
  EXPECT_THAT(read_text(tum), HasSubstr("1403715524.01 "));
  EXPECT_EQ(number(report_of({"evaluate", tum, euroc}), "association", "largest_time_difference"),
            0.0);
}

TEST_F(EvaluateByTime, AnotherUnitIsNamedWhereNoOffsetCanHelp) {
  write_text(estimate_, tum_drive(20, 5e9 + 0.5, 1e8, 0.0));
  expect_refusal({}, 3, "its stamps may be nanoseconds");
  const Outcome outcome = cairn({"evaluate", estimate_, truth_});
  EXPECT_THAT(outcome.err, Not(HasSubstr("--offset")));
}

// Scale -------------------------------------------------------------------------------------------

/// The poses of a wound way, `scale` times as large and off by up to `noise`.
std::string wound_way(int poses, double scale, double noise) {
  std::string text;
  for (int k = 0; k < poses; ++k) {
    const double t = 0.3 * k, wobble = noise * std::sin(17.0 * k * k);
    text += fmt::format("VERTEX_SE3:QUAT {} {:.17g} {:.17g} {:.17g} 0 0 {:.17g} {:.17g}\n", k,
                        scale * 5 * std::cos(t) + wobble, scale * 3 * std::sin(0.7 * t) - wobble,
                        scale * std::sin(2 * t), std::sin(0.5 * t), std::cos(0.5 * t));
  }
  return text;
}

TEST(EvaluateCommand, AScaleIsAlignedWhereItIsAskedForAndSuggestedWhereItExplainsTheError) {
  const TemporaryFolder folder;
  const std::string small = folder.file("small.g2o"), truth = folder.file("truth.g2o"),
                    noisy = folder.file("noisy.g2o"), few = folder.file("few.g2o");
  write_text(truth, wound_way(40, 1.0, 0.0));
  write_text(small, wound_way(40, 1.0 / 2.2, 0.0));
  write_text(noisy, wound_way(40, 0.999, 0.05));
  write_text(few, wound_way(3, 1.0 / 2.2, 0.0));
  const Outcome rigid = cairn({"evaluate", small, truth});
  EXPECT_EQ(rigid.exit_code, 0);
  EXPECT_THAT(unfolded(rigid.err),
              AllOf(HasSubstr("2.2 times as large, the estimate has an ATE of"),
                    HasSubstr("--align-scale")));
  const Outcome scaled = cairn({"evaluate", small, truth, "--align-scale"});
  EXPECT_THAT(scaled.out, AllOf(HasSubstr("ATE (absolute, after alignment with scale)"),
                                HasSubstr("scale of the estimate"), HasSubstr("2.2")));
  EXPECT_EQ(scaled.err, "");
  const auto report = report_of({"evaluate", small, truth, "--align-scale"});
  EXPECT_NEAR(report.at("scale").as_double(), 2.2, 1e-12);
  EXPECT_EQ(report.at("alignment").as_string(), "similarity");
  for (const char* error : {"ate", "rpe", "rpe_all"})
    EXPECT_NEAR(number(report, error, "translation"), 0.0, 1e-12) << error;
  EXPECT_EQ(report_of({"evaluate", small, truth}).at("scale").as_double(), 1.0);
  EXPECT_EQ(cairn({"evaluate", noisy, truth}).err, "");
  EXPECT_THAT(cairn({"evaluate", few, truth}).err, Not(HasSubstr("--align-scale")));
  write_text(few, "VERTEX_SE2 0 1 1 0\nVERTEX_SE2 1 1 1 0\nVERTEX_SE2 2 1 1 0\n");
  const Outcome point = cairn({"evaluate", few, truth, "--align-scale"});
  EXPECT_EQ(point.exit_code, 3);
  EXPECT_THAT(point.err, HasSubstr("are one point"));
}

// Frames ------------------------------------------------------------------------------------------

TEST(EvaluateCommand, AxesOfACameraThatWereForgottenAreNamed) {
  const TemporaryFolder folder;
  const std::string robot = folder.file("robot.g2o"), camera = folder.file("camera.g2o"),
                    kitti = folder.file("camera.kitti");
  write_text(robot, wound_way(12, 1.0, 0.0));
  ASSERT_EQ(cairn({"convert", robot, kitti}).exit_code, 0);
  // What `--axes camera` takes for a camera's is a robot's, three times over.
  ASSERT_EQ(cairn({"convert", kitti, camera, "--axes", "camera"}).exit_code, 0);
  const Outcome outcome = cairn({"evaluate", camera, robot});
  EXPECT_THAT(unfolded(outcome.err), HasSubstr("with --truth-axes camera the ATE in rotation is"));
  EXPECT_THAT(unfolded(cairn({"evaluate", robot, camera}).err),
              HasSubstr("with --axes camera the ATE in rotation is"));
  EXPECT_EQ(cairn({"evaluate", robot, camera, "--axes", "camera"}).err, "");
  EXPECT_NEAR(number(report_of({"evaluate", robot, camera, "--axes", "camera"}), "ate", "rotation"),
              0.0, 1e-6);
}

TEST(EvaluateCommand, QuaternionsWithWAtTheOtherEndAreNamed) {
  const TemporaryFolder folder;
  const std::string truth = folder.file("truth.tum"), first = folder.file("first.tum");
  write_text(truth,
             "0.5 0 0 0 0 0 0 1\n1 1 0 0 0 0 0.6 0.8\n1.5 1 1 0 0 0 0.8 0.6\n"
             "2 0 2 0.5 0 0.6 0.8 0\n");
  write_text(first,
             "0.5 0 0 0 1 0 0 0\n1 1 0 0 0.8 0 0 0.6\n1.5 1 1 0 0.6 0 0 0.8\n"
             "2 0 2 0.5 0 0 0.6 0.8\n");
  for (const bool of_estimate : {true, false}) {
    const std::string err =
        unfolded(cairn({"evaluate", of_estimate ? first : truth, of_estimate ? truth : first}).err);
    EXPECT_THAT(err, AllOf(HasSubstr("first, the ATE in rotation is"),
                           HasSubstr("`cairn convert " + first + " mended.tum --from euroc`")));
  }
  const std::string mended = folder.file("mended.tum");
  ASSERT_EQ(cairn({"convert", first, mended, "--from", "euroc"}).exit_code, 0);
  EXPECT_NEAR(number(report_of({"evaluate", mended, truth}), "ate", "rotation"), 0.0, 1e-5);
  EXPECT_THAT(cairn({"evaluate", truth, truth}).err, Not(HasSubstr("with w of")));
}

// Two metres ahead, then, turned to the left, one metre ahead: in a camera's axes, on a road that
// rises by half a metre.
TEST(EvaluateCommand, ACameraOnARoadIsComparedWithARobotOnAMap) {
  const TemporaryFolder folder;
  const std::string camera = folder.file("camera.txt"), robot = folder.file("robot.g2o");
  write_text(camera,
             "1 0 0 0  0 1 0 0  0 0 1 0\n"
             "0 0 -1 0  0 1 0 0  1 0 0 2\n"
             "0 0 -1 -1  0 1 0 -0.5  1 0 0 2\n");
  write_text(robot,
             "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 2 0 1.5707963267948966\n"
             "VERTEX_SE2 2 2 1 1.5707963267948966\n");
  const auto same = report_of({"evaluate", robot, camera, "--truth-axes", "camera", "--planar"});
  for (const char* error : {"ate", "rpe", "rpe_all"}) {
    EXPECT_NEAR(number(same, error, "translation"), 0.0, 1e-12) << error;
    EXPECT_NEAR(number(same, error, "rotation"), 0.0, 1e-6) << error;
  }
  EXPECT_EQ(same.at("axes").at("truth").as_string(), "camera");
  EXPECT_TRUE(same.at("planar").as_bool());
  // The other way round, and what the map does not show.
  const auto swapped = report_of({"evaluate", camera, robot, "--axes", "camera", "--planar"});
  EXPECT_NEAR(number(swapped, "rpe_all", "translation"), 0.0, 1e-12);
  const auto in_space = report_of({"evaluate", robot, camera, "--truth-axes", "camera"});
  EXPECT_NEAR(number(in_space, "rpe", "translation"), 0.5 / std::sqrt(2.0), 1e-12);
}

}  // namespace
}  // namespace cairn::test
