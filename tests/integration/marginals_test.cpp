// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <sstream>

#include <fmt/core.h>
#include <boost/json/serialize.hpp>

#include "cairn/plugin/registry.hpp"
#include "integration/process.hpp"
#include "support/components.hpp"

namespace cairn::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// All numbers of a matrix, row by row.
std::vector<double> numbers(const boost::json::value& matrix) {
  std::vector<double> all;
  for (const auto& row : matrix.as_array()) {
    for (const auto& number : row.as_array()) all.push_back(number.to_number<double>());
  }
  return all;
}

void expect_near(const std::vector<double>& a, const std::vector<double>& b,
                 double relative = 1e-7) {
  ASSERT_EQ(a.size(), b.size());
  double scale = 1e-5;
  for (const double x : b) scale = std::max(scale, std::abs(x));
  for (std::size_t k = 0; k < a.size(); ++k) EXPECT_NEAR(a[k], b[k], relative * scale);
}

using MarginalsCommand = WithGraphFile;

TEST_F(MarginalsCommand, ReportsWhatScriptsRelyOn) {
  const auto report = report_of({"marginals", graph(), "--threads", "2", "--pairs", "17:150,0:3",
                                 "--column", "last", "--diagonal"});
  EXPECT_EQ(report.at("command").as_string(), "marginals");
  EXPECT_EQ(report.at("graph").at("variables").as_int64(), 200);
  EXPECT_EQ(report.at("optimizer").as_string(), "levenberg_marquardt");
  EXPECT_EQ(report.at("linear_solver").as_string(), "block_cholesky");
  EXPECT_EQ(report.at("threads").as_int64(), 2);
  EXPECT_EQ(report.at("status").as_string(), "converged");
  for (const char* part : {"read", "optimize", "factorize", "marginals"})
    EXPECT_TRUE(report.at("seconds").at(part).is_double()) << part;
  const auto& diagonal = report.at("diagonal").as_array();
  const auto& column = report.at("column").at("blocks").as_array();
  ASSERT_EQ(diagonal.size(), 200u);
  ASSERT_EQ(column.size(), 200u);
  EXPECT_EQ(report.at("column").at("id").as_int64(), 199);
  ASSERT_EQ(report.at("pairs").as_array().size(), 2u);
  EXPECT_EQ(report.at("pairs").at(0).at("a").as_int64(), 17);
  EXPECT_EQ(report.at("pairs").at(0).at("b").as_int64(), 150);
  // The first pose is anchored: certain, and so is nothing else.
  EXPECT_THAT(numbers(diagonal[0].at("covariance")), testing::Each(0.0));
  EXPECT_THAT(numbers(report.at("pairs").at(1).at("covariance")), testing::Each(0.0));
  EXPECT_THAT(numbers(column[0].at("covariance")), testing::Each(0.0));
  EXPECT_GT(diagonal[1].at("covariance").at(0).at(0).as_double(), 0.0);
  expect_near(numbers(diagonal[199].at("covariance")), numbers(column[199].at("covariance")));
  const auto position = numbers(diagonal[199].at("position"));
  const auto own = numbers(diagonal[199].at("covariance"));
  EXPECT_NEAR(position[0] + position[3], own[0] + own[4], 1e-8 * (own[0] + own[4]));
}

TEST_F(MarginalsCommand, SayThatTheyAreOfNoEstimate) {
  const std::string file = graph(), json = (folder_.path() / "short.json").string();
  const Outcome run = cairn(
      {"marginals", file, "--initial", "odometry", "--iterations", "1", "--quiet", "--json", json});
  EXPECT_EQ(run.exit_code, 4) << run.err;
  const boost::json::value report = parse_json(read_text(json));
  EXPECT_EQ(report.at("status"), "max_iterations");
  const std::string notes = boost::json::serialize(report.at("notes"));
  EXPECT_THAT(notes, HasSubstr("stopped by --iterations 1 before it converged"));
  EXPECT_THAT(notes, HasSubstr("covariances are of where it stopped"));
  EXPECT_THAT(run.out, HasSubstr("stopped by --iterations 1 before it converged"));
  EXPECT_EQ(report.at("diagonal").as_array().size(), 200u) << "what was computed is there";
  EXPECT_EQ(
      cairn({"marginals", file, "--iterations", "3", "--tolerance", "0", "--quiet"}).exit_code, 0)
      << "that many were asked for";
}

TEST_F(MarginalsCommand, GivesTheDiagonalIfNothingElseIsAskedFor) {
  const std::string file = graph();
  const auto plain = report_of({"marginals", file}).as_object();
  EXPECT_TRUE(plain.contains("diagonal"));
  EXPECT_FALSE(plain.contains("pairs") || plain.contains("column"));
  const auto pairs = report_of({"marginals", file, "--pairs", "1:2"}).as_object();
  EXPECT_FALSE(pairs.contains("diagonal") || pairs.contains("column"));
  const Outcome text = cairn({"marginals", file, "--quiet"});
  EXPECT_THAT(text.out, HasSubstr("standard deviation of"));
  EXPECT_THAT(text.out, HasSubstr("VERTEX_SE2 199"));
  EXPECT_THAT(text.out, HasSubstr("… 170 more …"));
  EXPECT_THAT(text.out, HasSubstr("angle [rad]"));
}

TEST_F(MarginalsCommand, EverySolverThatCanGivesTheSame) {
  const std::string file = graph();
  const auto of = [&](const std::string& solver) {
    return report_of({"marginals", file, "--linear-solver", solver, "--pairs", "5:5,190:20",
                      "--diagonal", "--column", "77"});
  };
  const auto expected = of("block_cholesky");
  Registry registry;
  for (const char* solver : {"cholmod", "eigen", "lapack", "spqr", "schur"}) {
    if (!registry.has("linear_solver", solver)) continue;
    SCOPED_TRACE(solver);
    const auto found = of(solver);
    for (const std::size_t k : {std::size_t{0}, std::size_t{1}}) {
      expect_near(numbers(found.at("pairs").at(k).at("covariance")),
                  numbers(expected.at("pairs").at(k).at("covariance")));
    }
    for (std::size_t v = 0; v < 200; v += 13) {
      expect_near(numbers(found.at("diagonal").at(v).at("covariance")),
                  numbers(expected.at("diagonal").at(v).at("covariance")));
      expect_near(numbers(found.at("column").at("blocks").at(v).at("covariance")),
                  numbers(expected.at("column").at("blocks").at(v).at("covariance")));
    }
  }
}

TEST_F(MarginalsCommand, IsOfTheStatesAsGivenIfToldSo) {
  const std::string file = graph();
  const std::string best = folder_.file("best.g2o");
  report_of({"optimize", file, "-o", best});
  const auto first = report_of({"marginals", file, "--pairs", "199:199"});
  const auto as_given = report_of({"marginals", best, "--pairs", "199:199", "--as-given"});
  EXPECT_TRUE(as_given.at("optimizer").is_null());
  EXPECT_EQ(as_given.at("seconds").at("optimize").to_number<double>(), 0.0);
  expect_near(numbers(as_given.at("pairs").at(0).at("covariance")),
              numbers(first.at("pairs").at(0).at("covariance")));
}

TEST_F(MarginalsCommand, WritesAFileThatHoldsTheSameNumbers) {
  const std::string file = graph(), text = folder_.file("out.cov");
  const auto report = report_of({"marginals", file, "--pairs", "17:150", "--diagonal", "-o", text});
  std::istringstream in(read_text(text));
  std::string line;
  std::getline(in, line);
  EXPECT_EQ(line, "# cairn covariances 1");
  int blocks = 0;
  while (std::getline(in, line)) {
    if (line.starts_with('#')) continue;
    std::istringstream words(line);
    std::string tag;
    int a = 0, b = 0, rows = 0, columns = 0;
    words >> tag >> a >> b >> rows >> columns;
    EXPECT_EQ(tag, "COVARIANCE");
    std::vector<double> values(static_cast<std::size_t>(rows * columns));
    for (double& value : values) words >> value;
    EXPECT_TRUE(words);
    const auto& expected = blocks < 200
                               ? report.at("diagonal").at(std::size_t(blocks)).at("covariance")
                               : report.at("pairs").at(0).at("covariance");
    // The parser of JSON rounds the last digit in its own way.
    expect_near(values, numbers(expected), 1e-14);
    ++blocks;
  }
  EXPECT_EQ(blocks, 201);
  const Outcome piped = cairn({"marginals", file, "--pairs", "17:150", "-o", "-", "--quiet"});
  EXPECT_TRUE(piped.out.starts_with("# cairn covariances 1\n"));
  EXPECT_THAT(piped.out, Not(HasSubstr("time")));
}

/// Of a matrix of rows, of 3 × 3 or 6 × 6 numbers.
double log_determinant(std::vector<double> A) {
  const auto n = static_cast<std::size_t>(std::lround(std::sqrt(double(A.size()))));
  double sum = 0.0;
  for (std::size_t k = 0; k < n; ++k) {  // Gaussian elimination of a positive definite matrix
    sum += std::log(A[k * n + k]);
    for (std::size_t r = k + 1; r < n; ++r) {
      const double factor = A[r * n + k] / A[k * n + k];
      for (std::size_t c = k; c < n; ++c) A[r * n + c] -= factor * A[k * n + c];
    }
  }
  return sum;
}

TEST_F(MarginalsCommand, MutualInformationIsThatOfTheBlocks) {
  const auto report = report_of({"marginals", graph(), "--mutual-information", "17:150,40+41:120",
                                 "--pairs", "17:17,150:150,17:150"});
  EXPECT_FALSE(report.as_object().contains("diagonal"));
  const auto& all = report.at("mutual_information").as_array();
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].at("a").as_array().at(0).as_int64(), 17);
  EXPECT_EQ(all[0].at("b").as_array().at(0).as_int64(), 150);
  EXPECT_EQ(all[1].at("a").as_array().size(), 2u);
  EXPECT_EQ(all[1].at("a").at(1).as_int64(), 41);
  const auto block = [&](std::size_t k) {
    return numbers(report.at("pairs").at(k).at("covariance"));
  };
  const std::vector<double> a = block(0), b = block(1), ab = block(2);
  std::vector<double> joint(36);
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = 0; c < 3; ++c) {
      joint[6 * r + c] = a[3 * r + c];
      joint[6 * (r + 3) + c + 3] = b[3 * r + c];
      joint[6 * r + c + 3] = joint[6 * (c + 3) + r] = ab[3 * r + c];
    }
  }
  const double expected = 0.5 * (log_determinant(a) + log_determinant(b) - log_determinant(joint));
  EXPECT_NEAR(all[0].at("nats").as_double(), expected, 1e-6 * (1.0 + expected));
  EXPECT_GT(expected, 1e-3);
  EXPECT_GT(all[1].at("nats").as_double(), 1e-3);
  const Outcome text = cairn({"marginals", graph(), "--mutual-information", "40+41:120"});
  EXPECT_EQ(text.exit_code, 0) << text.err;
  EXPECT_THAT(text.out, HasSubstr("mutual information of"));
  EXPECT_THAT(text.out, HasSubstr("40+41, 120"));
  EXPECT_THAT(text.out, Not(HasSubstr("standard deviation")));
}

TEST_F(MarginalsCommand, AnAnchoredPoseSharesNoInformation) {
  const Outcome outcome =
      cairn({"marginals", graph(), "--mutual-information", "0:150", "--json", "-"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(parse_json(outcome.out).at("mutual_information").at(0).at("nats").as_double(), 0.0);
  EXPECT_THAT(unfolded(outcome.err), HasSubstr("VERTEX_SE2 0 is constant"));
}

TEST_F(MarginalsCommand, SaysWhichSetsAreNone) {
  const std::string file = graph();
  const auto refusal = [&](const std::string& sets, int exit_code, const char* says) {
    const Outcome outcome = cairn({"marginals", file, "--mutual-information", sets});
    EXPECT_EQ(outcome.exit_code, exit_code) << sets;
    EXPECT_THAT(unfolded(outcome.err), HasSubstr(says)) << sets;
  };
  refusal("3", 2, "expected A:B, or A+B:C+D");
  refusal("3:", 2, "'' is not an id");
  refusal("3+:5", 2, "'' is not an id");
  refusal("3:3", 2, "names 3 twice");
  refusal("3+4:5+4", 2, "names 4 twice");
  refusal("3:4711", 3, "no variable 4711; the ids of its ");
  const Outcome file_of_none =
      cairn({"marginals", file, "--mutual-information", "3:5", "-o", folder_.file("none.cov")});
  EXPECT_EQ(file_of_none.exit_code, 2);
  EXPECT_THAT(unfolded(file_of_none.err), HasSubstr("add --diagonal, --pairs or --column"));
}

TEST_F(MarginalsCommand, RefusesASolverThatCannotBeforeItReadsTheGraph) {
  Registry registry;
  for (const char* solver : {"pcg", "jacobi", "gauss_seidel"}) {
    if (!registry.has("linear_solver", solver)) continue;
    const Outcome outcome = cairn({"marginals", "nowhere.g2o", "--linear-solver", solver});
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.err,
                HasSubstr(std::string("linear solver '") + solver + "' gives no covariances"));
    EXPECT_THAT(outcome.err, HasSubstr("block_cholesky"));
    EXPECT_THAT(outcome.err, Not(HasSubstr("pcg,")));
    EXPECT_THAT(cairn({"plugins", solver}).out, Not(HasSubstr("marginals")));
  }
  EXPECT_THAT(cairn({"plugins", "block_cholesky"}).out, HasSubstr("marginals"));
}

TEST_F(MarginalsCommand, SaysWhichIdItDoesNotKnow) {
  const std::string file = graph();
  const Outcome unknown = cairn({"marginals", file, "--pairs", "3:4711"});
  EXPECT_EQ(unknown.exit_code, 3);
  EXPECT_THAT(unknown.err, HasSubstr("4711"));
  for (const char* pair : {"3", "3:", "a:4", "3:4x"})
    EXPECT_EQ(cairn({"marginals", file, "--pairs", pair}).exit_code, 2) << pair;
  EXPECT_EQ(cairn({"marginals", file, "--column", "first"}).exit_code, 2);
}

TEST_F(MarginalsCommand, TheBytesAreTheSameForAnyNumberOfThreads) {
  const std::string file = folder_.file("sphere.g2o");
  ASSERT_EQ(cairn({"generate", "sphere", "-o", file}).exit_code, 0);
  std::vector<std::string> files;
  for (const char* threads : {"1", "2", "3"}) {
    const Outcome outcome = cairn({"marginals", file, "--as-given", "--diagonal", "--column",
                                   "last", "-o", "-", "--threads", threads, "--quiet"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    files.push_back(outcome.out);
  }
  EXPECT_TRUE(files[0] == files[1]);
  EXPECT_TRUE(files[0] == files[2]);
}

TEST_F(MarginalsCommand, SaysWhichVariableMakesHSingular) {
  const std::string file = folder_.file("loose.g2o");
  write_text(file,
             "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_XY 2 1 1\nFIX 0\n"
             "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\nEDGE_SE2_XY 1 2 0 1 1 0 1\n");
  EXPECT_EQ(cairn({"marginals", file, "--as-given"}).exit_code, 0);
  write_text(file, "VERTEX_XY 0 0 0\nVERTEX_SE2 1 1 0 0\nFIX 0\nEDGE_SE2_XY 1 0 -1 0 1 0 1\n");
  const Outcome outcome = cairn({"marginals", file, "--as-given"});
  EXPECT_EQ(outcome.exit_code, 4);
  EXPECT_THAT(outcome.err, HasSubstr("no covariances"));
  EXPECT_THAT(outcome.err, HasSubstr("VERTEX_SE2 1"));
}

/// A closed trajectory whose only prior is one of a position: it may be turned about that, which
/// the factorisation need not notice.
TEST_F(MarginalsCommand, SaysWhereHIsSingularToRoundingWhateverTheSolver) {
  std::string text;
  constexpr int kPoses = 30;
  constexpr double kTurn = 2.0 * std::numbers::pi / kPoses;
  for (int k = 0; k < kPoses; ++k) {
    text += fmt::format("VERTEX_SE2 {} {} {} {}\n", k, 5.0 * std::sin(k * kTurn),
                        5.0 - 5.0 * std::cos(k * kTurn), k * kTurn);
    text += fmt::format("EDGE_SE2 {} {} {} {} {} 100 0 0 100 0 400\n", k, (k + 1) % kPoses,
                        5.0 * std::sin(kTurn), 5.0 - 5.0 * std::cos(kTurn), kTurn);
  }
  text += "EDGE_PRIOR_SE2 3 7 9 0 1 0 0 1 0 0\n";
  const std::string file = folder_.file("turns.g2o");
  write_text(file, text);
  for (const char* solver : {"block_cholesky", "cholmod", "eigen", "lapack", "spqr", "schur"}) {
    if (!Registry().has("linear_solver", solver)) continue;
    const Outcome outcome = cairn({"marginals", file, "--linear-solver", solver});
    EXPECT_EQ(outcome.exit_code, 4) << solver;
    EXPECT_THAT(outcome.err, testing::ContainsRegex(
                                 "1 (gauge freedom is likely|direction is hardly determined)"))
        << solver;
  }
}

// cairn optimize --covariance
// -----------------------------------------------------------------------

TEST_F(MarginalsCommand, OptimizeReportsTheSameBlocksAndThePageDrawsThem) {
  const std::string file = graph(), best = folder_.file("best.g2o"),
                    json = folder_.file("run.json");
  const Outcome run =
      cairn({"optimize", file, "-o", best, "--covariance", "blocks", "--json", json});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("covariance"));
  const auto report = parse_json(read_text(json));
  const auto& covariance = report.at("covariance");
  EXPECT_EQ(covariance.at("linear_solver").as_string(), "block_cholesky");
  EXPECT_TRUE(covariance.at("seconds").at("marginals").is_double());
  ASSERT_EQ(covariance.at("blocks").as_array().size(), 200u);
  const auto expected = report_of({"marginals", best, "--as-given"});
  for (const std::size_t v : {std::size_t{0}, std::size_t{77}, std::size_t{199}}) {
    expect_near(numbers(covariance.at("blocks").at(v).at("covariance")),
                numbers(expected.at("diagonal").at(v).at("covariance")));
  }
  Registry registry;
  if (!registry.has("picture", "html")) return;
  for (const Arguments& files : {Arguments{file, json}, Arguments{file, best, json}}) {
    const std::string page = folder_.file("page.html");
    Arguments view{"view", "-o", page, "--quiet"};
    view.insert(view.end(), files.begin(), files.end());
    const Outcome shown = cairn(view);
    EXPECT_EQ(shown.exit_code, 0) << shown.err;
    EXPECT_THAT(read_text(page), HasSubstr("\"covariance\":{\"variable\":"));
  }
}

TEST_F(MarginalsCommand, OptimizeKeepsItsEstimateWhereThereAreNoCovariances) {
  CAIRN_NEEDS("types", "slam2d");
  const std::string file = folder_.file("loose.g2o"), best = folder_.file("best.g2o");
  write_text(file, "VERTEX_XY 0 0 0\nVERTEX_SE2 1 1 0 0\nFIX 0\nEDGE_SE2_XY 1 0 -1 0.5 1 0 1\n");
  const Outcome outcome =
      cairn({"optimize", file, "-o", best, "--covariance", "blocks", "--json", "-"});
  EXPECT_EQ(outcome.exit_code, 4);
  const auto report = parse_json(outcome.out);
  EXPECT_EQ(report.at("status").as_string(), "converged");
  EXPECT_TRUE(report.at("covariance").is_null());
  EXPECT_THAT(boost::json::serialize(report.at("notes")), HasSubstr("no covariances: H is not"));
  EXPECT_TRUE(std::filesystem::exists(best));
}

TEST_F(MarginalsCommand, OptimizeReportsNullUnlessAskedFor) {
  EXPECT_TRUE(report_of({"optimize", graph()}).at("covariance").is_null());
}

TEST_F(MarginalsCommand, OptimizeRefusesCovariancesThatNobodyCanGiveBeforeItReadsTheGraph) {
  CAIRN_NEEDS("linear_solver", "block_cholesky");
  Registry registry;
  if (registry.has("linear_solver", "pcg")) {
    const Outcome pcg =
        cairn({"optimize", "nowhere.g2o", "--covariance", "blocks", "--linear-solver", "pcg"});
    EXPECT_EQ(pcg.exit_code, 2);
    EXPECT_THAT(pcg.err, HasSubstr("block_cholesky"));
  }
  if (registry.has("optimizer", "ceres")) {
    const Outcome ceres =
        cairn({"optimize", "nowhere.g2o", "--covariance", "blocks", "--optimizer", "ceres"});
    EXPECT_EQ(ceres.exit_code, 2);
    EXPECT_THAT(ceres.err, HasSubstr("optimizer 'ceres' solves with linear solvers of its own"));
  }
}

}  // namespace
}  // namespace cairn::test
