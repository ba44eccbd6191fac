// SPDX-License-Identifier: BSD-3-Clause
// cairn online: the protocol of docs/online.md, and what its journal promises.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <random>
#include <sstream>

#include "cairn/plugin/registry.hpp"
#include "integration/process.hpp"
#include "support/components.hpp"

namespace cairn::test {
namespace {

using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;
using testing::StartsWith;

const std::string kBatch = "batch";
const std::string kEdge = " 1 0 0.1 100 0 0 100 0 100";  // measurement and information

Arguments online(Arguments more = {}, const std::string& estimator = kBatch) {
  Arguments arguments{"online", "--estimator", estimator, "--quiet"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

std::string joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

class Online : public testing::Test {
 protected:
  void SetUp() override {
    CAIRN_NEEDS("estimator", kBatch);
    CAIRN_NEEDS("linear_solver", "block_cholesky");
    CAIRN_NEEDS("optimizer", "levenberg_marquardt");
    CAIRN_NEEDS("stream_format", "g2o");
    CAIRN_NEEDS("types", "slam2d");
  }
  TemporaryFolder folder_;
};

TEST_F(Online, AnswersEveryMeasurementWithTheNewestEstimate) {
  const Outcome run = cairn(online(), {},
                            "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nEDGE_SE2 0 1" + kEdge +
                                "\nNEW VERTEX_SE2 2\nEDGE_SE2 1 2" + kEdge + "\n");
  EXPECT_EQ(run.exit_code, 0) << run.err;
  const std::vector<std::string> answers = lines(run.out);
  ASSERT_THAT(answers, SizeIs(5)) << run.out;
  EXPECT_THAT(answers[0], StartsWith("NOTE no variable is fixed: anchored VERTEX_SE2 0"));
  EXPECT_EQ(answers[1], "VERTEX_SE2 1 1 0 0.1");
  EXPECT_EQ(answers[2], "OK 3 variables 2 factors 1 owed 0");
  EXPECT_THAT(answers[3], StartsWith("VERTEX_SE2 2 1.99500416"));
  EXPECT_EQ(answers[4], "OK 5 variables 3 factors 2 owed 0");
}

TEST_F(Online, SolvesWhenAskedTo) {
  const Outcome run = cairn(online({"--solve", "explicit", "--output", "all"}), {},
                            "VERTEX_SE2 0 0 0 0\nFIX 0\nVERTEX_SE2 1 5 5 0\nEDGE_SE2 0 1" + kEdge +
                                "\nESTIMATE 1\nSOLVE\n");
  EXPECT_THAT(lines(run.out), ElementsAre("VERTEX_SE2 1 5 5 0", "OK 5 variables 2 factors 1 owed 0",
                                          "VERTEX_SE2 0 0 0 0", StartsWith("VERTEX_SE2 1 1 "),
                                          "OK 6 variables 2 factors 1 owed 0"));
}

TEST_F(Online, WritesOnlyWhatChanged) {
  const Outcome run = cairn(online({"--output", "changed"}), {},
                            "VERTEX_SE2 0 0 0 0\nFIX 0\nNEW VERTEX_SE2 1\nEDGE_SE2 0 1" + kEdge +
                                "\nNEW VERTEX_SE2 2\nEDGE_SE2 1 2" + kEdge + "\nREMOVE FACTOR 1\n");
  const std::vector<std::string> answers = lines(run.out);
  ASSERT_THAT(answers, SizeIs(testing::Ge(6U))) << run.out;
  EXPECT_EQ(answers[0], "VERTEX_SE2 0 0 0 0");
  EXPECT_EQ(answers[1], "VERTEX_SE2 1 1 0 0.1");
  EXPECT_THAT(answers[3], StartsWith("VERTEX_SE2 2 "));
  EXPECT_THAT(answers.back(), StartsWith("OK 7 "));
  EXPECT_THAT(run.out, Not(HasSubstr("VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0.1\nVERTEX")));
}

TEST_F(Online, SaysWhereThereIsNoCovarianceThatWasAskedFor) {
  const std::string stiff =
      "VERTEX_SE2 0 0 0 0\nFIX 0\nNEW VERTEX_XY 100\nEDGE_SE2_XY 0 100 1 1 1e18 0 1e18\n"
      "NEW VERTEX_SE2 1\nEDGE_SE2 0 1 1 0 0 100 0 0 100 0 400\n"
      "EDGE_SE2_XY 1 100 0 1 1e18 0 1e18\n";
  const Outcome run = cairn(online({"--output", "none", "--marginals", "diagonal"}), {}, stiff);
  EXPECT_THAT(run.out, HasSubstr("NOTE there is no covariance of 1: "));
  EXPECT_THAT(run.out, HasSubstr("rounding takes its digits"));
}

TEST_F(Online, ABadLineIsToldAndNothingOfItStays) {
  const std::string good =
      "VERTEX_SE2 0 0 0 0\nFIX 0\nNEW VERTEX_SE2 1\nEDGE_SE2 0 1" + kEdge + "\n";
  const std::vector<std::string> bad = {"EDGE_SE2 0 1 1 0",
                                        "EDGE_SE2 0 9" + kEdge,
                                        "EDGE_SE2 0 1 1 0 0.1 100 0 0 100 0 -100",
                                        "VERTEX_SE2 1 0 0 0",
                                        "VERTEX_SE3:QUAT 7 0 0 0 0 0 0 0",
                                        "VERTEX_SE2 x 0 0 0",
                                        "NEW VERTEX_SE9 4",
                                        "FIX 0",
                                        "FIX",
                                        "REMOVE FACTOR 7",
                                        "REMOVE 1",
                                        "REMOVE VARIABLE 1 1",
                                        "MARGINALIZE",
                                        "MARGINALIZE 8",
                                        "SPARSIFY",
                                        "SPARSIFY 0",
                                        "SPARSIFY 8",
                                        "SPARSIFY KEEP",
                                        "SPARSIFY KEEP 1",
                                        "CHANGE 0 1",
                                        "CHANGE 4 1 0 0",
                                        "COVARIANCE 0",
                                        "COVARIANCE 0 8",
                                        "ESTIMATE one",
                                        "SAVE nowhere/at/all.g2o",
                                        "SOLVE now",
                                        "EDGE_SE4 0 1" + kEdge,
                                        "WHAT 1"};
  const Outcome run =
      cairn(online({"--output", "none"}), {}, good + joined(bad) + "ESTIMATE ALL\nCHI2\n");
  EXPECT_EQ(run.exit_code, 0);
  const std::vector<std::string> answers = lines(run.out);
  ASSERT_THAT(answers, SizeIs(1 + bad.size() + 5)) << run.out;
  for (std::size_t k = 0; k < bad.size(); ++k) {
    EXPECT_THAT(answers[1 + k], StartsWith("ERROR line " + std::to_string(5 + k) + ": ")) << bad[k];
  }
  EXPECT_THAT(answers[1], HasSubstr("EDGE_SE2 with 4 fields; expected 11 fields"));
  EXPECT_THAT(answers[2], HasSubstr("there is no variable 9"));
  EXPECT_THAT(answers[3], HasSubstr("not positive semidefinite"));
  EXPECT_THAT(answers[bad.size()], HasSubstr("(--skip-unknown leaves such lines out)"));
  EXPECT_EQ(answers[1 + bad.size()], "VERTEX_SE2 0 0 0 0");
  EXPECT_EQ(answers[2 + bad.size()], "VERTEX_SE2 1 1 0 0.1");
  EXPECT_THAT(answers[3 + bad.size()], EndsWith("variables 2 factors 1 owed 0"));
}

TEST_F(Online, ItsJournalIsNotSavedOver) {
  const std::string journal = folder_.file("today.g2o"), link = folder_.file("link.g2o");
  std::filesystem::create_symlink("today.g2o", link);
  const Outcome run = cairn(online({"--journal", journal}), {},
                            "VERTEX_SE2 0 0 0 0\nFIX 0\nSAVE " + journal + "\nSAVE " + link + "\n");
  EXPECT_THAT(run.out, HasSubstr("ERROR line 3: SAVE would replace the journal"));
  EXPECT_THAT(run.out, HasSubstr("ERROR line 4: SAVE would replace the journal"));
  EXPECT_THAT(cairn(online({"--journal", journal}), {}, "CHI2\n").out, HasSubstr("RESTORED 2"));
}

TEST_F(Online, ChangesMarginalizesAndTellsCovariances) {
  const Outcome run =
      cairn(online({"--output", "none", "--marginals", "last"}), {},
            "VERTEX_SE2 0 0 0 0\nFIX 0\nNEW VERTEX_SE2 1\nEDGE_SE2 0 1" + kEdge +
                "\nNEW VERTEX_SE2 2\nEDGE_SE2 1 2" + kEdge +
                "\nCHANGE 0 2 0 0 25 0 0 25 0 25\nESTIMATE 1\nCOVARIANCE 1 1\n"
                "MARGINALIZE 0 1\nCHANGE 2 1\nCHANGE 1 1 0 0\nESTIMATE ALL\nSAVE " +
                folder_.file("all.tum") + "\nSAVE " + folder_.file("all.g2o") + "\n");
  EXPECT_THAT(run.out, HasSubstr("VERTEX_SE2 1 2 "));
  EXPECT_THAT(run.out, testing::ContainsRegex("COVARIANCE 1 1 3 3 0.0(4|3999)[^\n]* 0.0(4|3999)"));
  EXPECT_THAT(run.out, HasSubstr("PRIOR 2\n"));
  EXPECT_THAT(run.out, HasSubstr("there is no factor 2 that can be changed"));  // a prior
  EXPECT_THAT(run.out, HasSubstr("there is no factor 1 that can be changed"));  // is gone
  EXPECT_THAT(run.out, HasSubstr("VERTEX_SE2 2 3 "));
  EXPECT_THAT(run.out, HasSubstr("variables 1 factors 1"));
  EXPECT_THAT(run.out, HasSubstr("format g2o cannot express MARGINAL_PRIOR 2"));
  EXPECT_THAT(folder_.contents(), ElementsAre("all.tum"));
}

TEST_F(Online, KeepsAFixedNumberOfPosesAndWritesThem) {
  CAIRN_NEEDS("sparsifier", "sparsify");
  std::string stream = "VERTEX_SE2 0 0 0 0\nFIX 0\n";
  for (int k = 1; k < 30; ++k) {
    stream += "NEW VERTEX_SE2 " + std::to_string(k) + "\nEDGE_SE2 " + std::to_string(k - 1) + " " +
              std::to_string(k) + kEdge + "\n";
    if (k == 20) stream += "SPARSIFY 19\n";
  }
  const std::string out = folder_.file("map.g2o");
  for (const char* estimator : {"batch", "incremental_cholesky"}) {
    CAIRN_NEEDS("estimator", estimator);
    const Outcome run = cairn(online({"--keep", "12", "-o", out}, estimator), {}, stream);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    EXPECT_THAT(run.out, HasSubstr("REMOVED 19\nFACTOR "));
    EXPECT_THAT(lines(run.out).back(), HasSubstr("variables 12 factors 11"));
    // A chain: the newest pose is where it is in the whole map.
    const std::string whole = lines(cairn(online({}, estimator), {}, stream).out).end()[-2];
    const std::string last = lines(run.out).end()[-2];
    double x[3], y[3];
    ASSERT_EQ(std::sscanf(last.c_str(), "VERTEX_SE2 29 %lf %lf %lf", x, x + 1, x + 2), 3) << last;
    ASSERT_EQ(std::sscanf(whole.c_str(), "VERTEX_SE2 29 %lf %lf %lf", y, y + 1, y + 2), 3);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(x[k], y[k], 1e-6);
    const boost::json::value info = parse_json(cairn({"info", out, "--json", "-"}).out);
    EXPECT_EQ(info.at("graph").at("variables").as_int64(), 12);
    EXPECT_EQ(info.at("graph").at("factors").as_int64(), 11);
  }
}

TEST_F(Online, SparsifiesAsTheDocumentationSays) {
  CAIRN_NEEDS("sparsifier", "sparsify");
  CAIRN_NEEDS("estimator", "incremental_cholesky");
  const std::string page = read_text(source_folder() + "/docs/online.md");
  const std::string begin = "```text\n";
  const std::size_t at = page.find(begin + "> SPARSIFY");
  ASSERT_NE(at, std::string::npos);
  std::string stream = "VERTEX_SE2 0 0 0 0\nFIX 0\n";
  const std::string step = " 1 0 0.1 100 0 0 100 0 400\n";
  for (int k = 1; k < 5; ++k) {
    stream += "NEW VERTEX_SE2 " + std::to_string(k) + "\nEDGE_SE2 " + std::to_string(k - 1) + " " +
              std::to_string(k) + step;
  }
  stream += "EDGE_SE2 1 4 2.9 0.4 0.3 100 0 0 100 0 400\n";
  std::vector<std::string> expected;
  const std::size_t first = at + begin.size();
  for (const std::string& line : lines(page.substr(first, page.find("```", first) - first))) {
    if (line.starts_with("> ")) {
      stream += line.substr(2) + "\n";
    } else {
      expected.push_back(line);
    }
  }
  const std::vector<std::string> all =
      lines(cairn(online({}, "incremental_cholesky"), {}, stream).out);
  ASSERT_GT(all.size(), expected.size());
  const std::vector<std::string> answers(all.end() - std::ssize(expected), all.end());
  for (std::size_t k = 0; k < expected.size(); ++k) {
    std::istringstream got(answers[k]), wanted(expected[k]);
    for (std::string a, b; wanted >> b;) {
      ASSERT_TRUE(got >> a) << answers[k];
      char* rest = nullptr;
      const double number = std::strtod(b.c_str(), &rest);
      if (*rest != 0) {
        EXPECT_EQ(a, b) << answers[k];
      } else {
        EXPECT_NEAR(std::strtod(a.c_str(), nullptr), number, 6e-5) << answers[k];
      }
    }
  }
}

TEST_F(Online, RefusesOptionsOfSparsificationThatCannotBe) {
  const auto refusal = [&](const Arguments& more, int code) {
    const Outcome run = cairn(online(more), {}, "");
    EXPECT_EQ(run.exit_code, code) << run.err;
    return run.err;
  };
  EXPECT_THAT(refusal({"--keep", "1"}, 2), HasSubstr("--keep"));
  EXPECT_THAT(refusal({"--select", "widest"}, 5), HasSubstr("on offer: coverage"));
  for (const char* topology : {"cliquey", "glc"}) {
    EXPECT_THAT(refusal({"--sparsifier", std::string("sparsify:topology=") + topology}, 2),
                HasSubstr("the map could not be saved"));
  }
  EXPECT_THAT(refusal({"--keep", "20", "--policy", "compact_pose:keep=10"}, 2),
              HasSubstr("--keep, and keep=10 among the policy's options: give one"));
  EXPECT_THAT(refusal({"--select", "oldest", "--policy", "compact_pose"}, 2),
              HasSubstr("give --keep N, too"));
  EXPECT_THAT(refusal({"--keep", "20", "--policy", "random_poses"}, 2), HasSubstr("keep"));
  // It gives another map, so the journal is another.
  const std::string journal = folder_.file("log");
  cairn(online({"--journal", journal}), {}, "VERTEX_SE2 0 0 0 0\n");
  EXPECT_THAT(refusal({"--keep", "20", "--journal", journal}, 2), HasSubstr(", keep 20"));
}

TEST_F(Online, EndsWithQuitOrTheInputAndCounts) {
  const std::string json = folder_.file("run.json");
  const Outcome run =
      cairn(online({"--output", "none", "--json", json, "-o", folder_.file("last.g2o")}), {},
            "VERTEX_SE2 0 0 0 0\nNEW VERTEX_SE2 1\nEDGE_SE2 0 1" + kEdge +
                "\nNONSENSE\nQUIT\nEDGE_SE2 0 1" + kEdge + "\n");
  EXPECT_EQ(run.exit_code, 0) << run.err;
  const boost::json::value report = parse_json(read_text(json));
  EXPECT_EQ(report.at("lines").at("read").as_int64(), 5);
  EXPECT_EQ(report.at("lines").at("refused").as_int64(), 1);
  EXPECT_EQ(report.at("solves").as_int64(), 1);
  EXPECT_EQ(report.at("graph").at("factors").as_int64(), 1);
  EXPECT_THAT(read_text(folder_.file("last.g2o")), HasSubstr("EDGE_SE2 0 1 "));
}

TEST_F(Online, SaysWhatIsNotInTheMapItWrites) {
  const std::string map = folder_.file("map.g2o");
  const Outcome run = cairn({"online", "--estimator", kBatch, "-o", map}, {},
                            "VERTEX_SE2 0 0 0 0\nFIX 0\nNEW VERTEX_SE2 1\nEDGE_SE2 0 1" + kEdge +
                                "\nVERTEX_SE2 5 0 0 0\nNEW VERTEX_SE2 6\n");
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err,
              HasSubstr("2 variables wait for a measurement, the first of them VERTEX_SE2 5: "
                        "not in the estimate"));
  EXPECT_THAT(read_text(map), Not(HasSubstr("VERTEX_SE2 5")));
}

TEST_F(Online, SensorOffsetsAreRemembered) {
  const Outcome run =
      cairn(online({"--output", "none"}), {},
            "PARAMS_SE3OFFSET 3 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nFIX 0\n"
            "NEW VERTEX_TRACKXYZ 1\nEDGE_SE3_TRACKXYZ 0 1 3 1 2 3 1 0 0 1 0 1\nESTIMATE 1\n"
            "EDGE_SE3_TRACKXYZ 0 1 4 1 2 3 1 0 0 1 0 1\n");
  EXPECT_THAT(run.out, HasSubstr("VERTEX_TRACKXYZ 1 1 2 3\n"));
  EXPECT_THAT(run.out, HasSubstr("ERROR line 7: EDGE_SE3_TRACKXYZ refers to parameter 4"));
}

// The journal -----------------------------------------------------------------------------------

TEST_F(Online, GoesOnWhereTheJournalEnds) {
  const std::string journal = folder_.file("log");
  const Outcome first =
      cairn(online({"--journal", journal}), {},
            "VERTEX_SE2 0 0 0 0\nNEW VERTEX_SE2 1\nEDGE_SE2 0 1" + kEdge + "\nCHI2\n");
  EXPECT_THAT(lines(first.out)[0], "RESTORED 0 variables 0 factors 0");
  const Outcome second = cairn(online({"--journal", journal}), {}, "ESTIMATE 1\n");
  EXPECT_THAT(lines(second.out),
              ElementsAre("RESTORED 3 variables 2 factors 1", "VERTEX_SE2 1 1 0 0.1",
                          "OK 4 variables 2 factors 1 owed 0"));
}

TEST_F(Online, RefusesAJournalOfOtherOptions) {
  const std::string journal = folder_.file("log");
  cairn(online({"--journal", journal}), {}, "VERTEX_SE2 0 0 0 0\n");
  const Outcome other = cairn(online({"--journal", journal, "--types", "slam3d:metric=g2o"}));
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, HasSubstr("the journal belongs to 'estimator batch, types as they are"));
  EXPECT_THAT(other.err, HasSubstr("types slam3d:metric=g2o"));
  EXPECT_THAT(other.out, IsEmpty());
}

/// A robot's day: a chain of poses with loops, points, and every kind of line.
std::vector<std::string> robots_day(int poses, unsigned seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> noise(-0.05, 0.05);
  const auto pose_edge = [&](int a, int b, double x, double y, double turn) {
    std::ostringstream line;
    line << "EDGE_SE2 " << a << ' ' << b << ' ' << x + noise(rng) << ' ' << y + noise(rng) << ' '
         << turn + noise(rng) << " 100 0 0 100 0 400";
    return line.str();
  };
  std::vector<std::string> day{"VERTEX_SE2 0 0 0 0", "FIX 0"};
  int factors = 0;
  for (int k = 1; k < poses; ++k) {
    day.push_back("NEW VERTEX_SE2 " + std::to_string(k));
    day.push_back(pose_edge(k - 1, k, 1.0, 0.0, k % 4 == 0 ? 1.5708 : 0.0));
    ++factors;
    if (k >= 16 && k % 3 == 0) {  // four sides later it is back where it was
      day.push_back(pose_edge(k - 16, k, 0.0, 0.0, 0.0));
      ++factors;
    }
    if (k % 7 == 0) day.push_back("EDGE_SE2 0 99999" + kEdge);  // refused
    if (k % 11 == 0) day.push_back("# a remark");
    if (k % 13 == 0) day.push_back("CHANGE " + std::to_string(factors - 1) + " 1.02 0.01 0.02");
    if (k == 40) day.push_back("REMOVE FACTOR 20");
    if (k == 35) day.push_back("SPARSIFY 9 21");
    if (k == 45) day.push_back("MARGINALIZE 0 1 2");
    if (k == 50) day.push_back("SPARSIFY KEEP 36");
    if (k % 10 == 0) day.push_back("COVARIANCE " + std::to_string(k) + " " + std::to_string(k));
  }
  day.push_back("FULL");
  return day;
}

std::string estimate_after(const Outcome& run) {
  const std::size_t begin = run.out.rfind("CHI2");
  return begin == std::string::npos ? "nothing: " + run.err : run.out.substr(begin);
}

class OnlineKilled : public Online, public testing::WithParamInterface<std::string> {};

TEST_P(OnlineKilled, NothingAcknowledgedIsLost) {
  const char* wanted = std::getenv("CAIRN_KILLS");
  const int kills = wanted ? std::atoi(wanted) : 20;
  const std::vector<std::string> day = robots_day(60, 7);
  const std::string end = "CHI2\nESTIMATE ALL\n";
  const std::string whole =
      estimate_after(cairn(online({"--output", "none"}, GetParam()), {}, joined(day) + end));
  ASSERT_THAT(whole, StartsWith("CHI2"));

  const unsigned seed = 20260101;
  std::mt19937 rng(seed);
  int done = 0;
  for (int day_number = 0; done < kills; ++day_number) {
    const Arguments arguments =
        online({"--output", "none", "--journal", folder_.file("log" + std::to_string(day_number))},
               GetParam());
    std::size_t acknowledged = 0;  // lines
    const auto rest_from = [&](std::size_t line) {
      return joined({day.begin() + static_cast<std::ptrdiff_t>(line), day.end()});
    };
    std::size_t restored = 0;
    while (done < kills && restored + 1 < day.size()) {
      // What a client does: learn where to go on, and send the rest.
      const Outcome asked = cairn(arguments);
      ASSERT_EQ(std::sscanf(asked.out.c_str(), "RESTORED %zu", &restored), 1) << asked.err;
      ASSERT_GE(restored, acknowledged) << "seed " << seed << ", kill " << done;
      const Outcome killed =
          cairn_killed(arguments, rest_from(restored), 1 + static_cast<int>(rng() % 12),
                       std::chrono::microseconds(rng() % 3000));
      ++done;
      for (const std::string& answer : lines(killed.out)) {
        std::size_t number = 0;
        if (std::sscanf(answer.c_str(), "OK %zu", &number) != 1) continue;
        // A question is answered and not logged: its line may come again.
        if (!day[number - 1].starts_with("COVARIANCE")) acknowledged = number;
      }
    }
    const Outcome asked = cairn(arguments);
    ASSERT_EQ(std::sscanf(asked.out.c_str(), "RESTORED %zu", &restored), 1) << asked.err;
    EXPECT_GE(restored, acknowledged);
    const Outcome last = cairn(arguments, {}, rest_from(restored) + end);
    // Lines have other numbers than in the run that was not interrupted, where questions come
    // again.
    const auto without_numbers = [](const std::string& text) {
      std::string kept;
      for (const std::string& line : lines(text)) {
        if (!line.starts_with("OK")) kept += line + "\n";
      }
      return kept;
    };
    EXPECT_EQ(without_numbers(estimate_after(last)), without_numbers(whole))
        << "seed " << seed << ", after " << done << " kills";
  }
}

INSTANTIATE_TEST_SUITE_P(EveryEstimator, OnlineKilled,
                         testing::ValuesIn(Registry().names("estimator")),
                         [](const auto& named) { return named.param; });
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(OnlineKilled);

}  // namespace
}  // namespace cairn::test
