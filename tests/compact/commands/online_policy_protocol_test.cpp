// SPDX-License-Identifier: BSD-3-Clause
// cairn online --policy: what it answers to each line, the bad ones included.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <string>

#include "integration/front_end.hpp"
#include "integration/process.hpp"

namespace cairn::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;
using testing::StartsWith;

/// Two numbers that differ in their last digits count as the same word.
void expect_alike(const std::string& said, const std::string& expected) {
  const Lines a = words(said), b = words(expected);
  ASSERT_EQ(a.size(), b.size()) << said << "\nexpected: " << expected;
  for (std::size_t k = 0; k < a.size(); ++k) {
    char* rest = nullptr;
    const double number = std::strtod(b[k].c_str(), &rest);
    if (*rest != 0) {
      EXPECT_EQ(a[k], b[k]) << said;
    } else {
      EXPECT_NEAR(std::strtod(a[k].c_str(), nullptr), number, 2e-6) << said;
    }
  }
}

TEST_F(OnlinePolicy, SaysWhatTheDocumentationSays) {
  const std::string page = read_text(source_folder() + "/docs/online.md");
  const std::string begin = "```text\n> ";
  const std::size_t at = page.find(begin, page.find("## Compact pose SLAM, live"));
  ASSERT_NE(at, std::string::npos);
  const std::size_t first = at + begin.size() - 2;
  Lines told, expected;
  for (const std::string& line : lines(page.substr(first, page.find("```", first) - first))) {
    if (line.starts_with("> ")) {
      told.push_back(line.substr(2));
    } else {
      expected.push_back(line);
    }
  }
  ASSERT_THAT(told, SizeIs(testing::Gt(10U)));
  const Outcome run = cairn(online("compact_pose:range=3,angle=0.5,reuse=true"), {}, joined(told));
  const Lines answers = lines(run.out);
  ASSERT_THAT(answers, SizeIs(expected.size())) << run.out;
  for (std::size_t k = 0; k < expected.size(); ++k) expect_alike(answers[k], expected[k]);
}

TEST_F(OnlinePolicy, TheSameQuestionGetsTheSameAnswerUntilItIsAnswered) {
  Lines told = square();
  told.insert(told.end(), {"NEXT", "ESTIMATE ALL", "NEXT", "NOMATCH 0 4", "NEXT"});
  const Lines answers = lines(
      cairn(online("compact_pose:range=3,angle=0.8", {"--output", "none"}), {}, joined(told)).out);
  Lines matches;
  for (const std::string& line : answers) {
    if (line.starts_with("MATCH")) matches.push_back(line);
  }
  ASSERT_THAT(matches, SizeIs(3)) << joined(answers);
  EXPECT_THAT(matches[0], StartsWith("MATCH 0 4 "));
  EXPECT_EQ(matches[0], matches[1]);
  EXPECT_EQ(matches[2], "MATCH NONE");
}

TEST_F(OnlinePolicy, TakesWhatItDidNotAskFor) {
  Lines told = square();
  told.insert(told.end(), {"EDGE_SE2 4 1 1 0 1.5 400 0 0 400 0 400", "EDGE_SE2 0 4" + kHere,
                           "EDGE_SE2 0 4" + kHere, "DONE", "DONE"});
  const Lines answers = lines(cairn(online(kPolicy, {"--output", "none"}), {}, joined(told)).out);
  ASSERT_THAT(answers, SizeIs(testing::Ge(5U)));
  EXPECT_THAT(Lines(answers.end() - 5, answers.end()),
              ElementsAre(StartsWith("LINKED 1 4 "), StartsWith("LINKED 0 4 "), "KEPT 4",
                          "OK 13 variables 5 factors 7 owed 0",
                          StartsWith("ERROR line 14: there is no pose that is not done")));
}

TEST_F(OnlinePolicy, ADroppedPoseIsKnownUntilTheNextComes) {
  // So exact a motion tells nothing new of where it leads.
  const std::string exact = " 0.1 0 0 1e8 0 0 1e8 0 1e8";
  const Lines told{"NEW VERTEX_SE2 0",
                   "NEW VERTEX_SE2 1",
                   "EDGE_SE2 0 1" + kStep,
                   "NEW VERTEX_SE2 2",
                   "EDGE_SE2 1 2" + exact,
                   "DONE",
                   "ESTIMATE 2",
                   "COVARIANCE 2 2",
                   "NEW VERTEX_SE2 3",
                   "ESTIMATE 2",
                   "EDGE_SE2 2 3" + kStep,
                   "ESTIMATE 2",
                   "DONE",
                   "NEW VERTEX_SE2 4",
                   "EDGE_SE2 3 4" + exact,
                   "EDGE_SE2 2 4" + kHere,
                   "VERTEX_SE2 2 0 0 0",
                   "ESTIMATE ALL"};
  const std::string policy = "compact_pose:range=3,angle=3,pose_gain=1,sensor=0.1 0.1,reuse=false";
  const Outcome run = cairn(online(policy, {"--output", "none"}), {}, joined(told));
  EXPECT_THAT(
      lines(run.out),
      ElementsAre("KEPT 0", StartsWith("OK 2 variables 1 "), "KEPT 1",
                  StartsWith("OK 4 variables 2 "), "DROPPED 2", StartsWith("OK 6 variables 2 "),
                  StartsWith("VERTEX_SE2 2 1.00707"), StartsWith("OK 7 variables 2 "),
                  "ERROR line 8: there is no pose or landmark 2 in the compact graph",
                  StartsWith("VERTEX_SE2 2 1.00707"), StartsWith("OK 10 variables 2 "),
                  StartsWith("ERROR line 12: there is no estimate of 2; expected a pose that was "
                             "kept"),
                  "KEPT 3", StartsWith("OK 13 variables 3 "),
                  StartsWith("ERROR line 16: pose 2 was not kept"),
                  StartsWith("ERROR line 17: VERTEX_SE2 2: the id is already in use"),
                  StartsWith("VERTEX_SE2 0 "), StartsWith("VERTEX_SE2 1 "),
                  StartsWith("VERTEX_SE2 3 "), StartsWith("VERTEX_SE2 4 "),
                  StartsWith("OK 18 variables 3 factors 2 ")))
      << run.out;
}

TEST_F(OnlinePolicy, WritesTheEstimatesAndCovariancesThatAreAskedFor) {
  Lines told = square();
  told.insert(told.end(), {"EDGE_SE2 0 4" + kHere, "DONE"});
  const auto run = [&](const std::string& output, const std::string& marginals) {
    const Lines all = lines(
        cairn(online(kPolicy, {"--output", output, "--marginals", marginals}), {}, joined(told))
            .out);
    const auto last = std::ranges::find_if(
        all, [](const std::string& line) { return line.starts_with("LINKED"); });
    return Lines(last, all.end());
  };
  const auto linked = StartsWith("LINKED 0 4 ");
  const auto end = StartsWith("OK 11 variables 5 factors 5 ");
  EXPECT_THAT(run("last", "last"), ElementsAre(linked, "KEPT 4", StartsWith("VERTEX_SE2 4 "),
                                               StartsWith("COVARIANCE 4 4 3 3 "), end));
  EXPECT_THAT(run("none", "diagonal"),
              ElementsAre(linked, "KEPT 4", StartsWith("COVARIANCE 0 0 "),
                          StartsWith("COVARIANCE 1 1 "), StartsWith("COVARIANCE 2 2 "),
                          StartsWith("COVARIANCE 3 3 "), StartsWith("COVARIANCE 4 4 "), end));
  EXPECT_THAT(run("all", "none"), SizeIs(8));
  // The first pose is held, and does not move.
  EXPECT_THAT(
      run("changed", "none"),
      ElementsAre(linked, "KEPT 4", StartsWith("VERTEX_SE2 1 "), StartsWith("VERTEX_SE2 2 "),
                  StartsWith("VERTEX_SE2 3 "), StartsWith("VERTEX_SE2 4 "), end));
}

TEST_F(OnlinePolicy, KeepsTheNewestPoseAtTheEndAndLeavesOutOneWithoutOdometry) {
  const std::string exact = " 0.1 0 0 1e8 0 0 1e8 0 1e8";
  const std::string policy = "compact_pose:range=3,angle=3,pose_gain=1,sensor=0.1 0.1,reuse=false";
  const Lines told{"NEW VERTEX_SE2 0", "NEW VERTEX_SE2 1", "EDGE_SE2 0 1" + exact,
                   "NEW VERTEX_SE2 2", "QUIT"};
  const Outcome quit = cairn(online(policy, {"--output", "none"}), {}, joined(told));
  EXPECT_THAT(lines(quit.out),
              ElementsAre("KEPT 0", StartsWith("OK 2 "), "DROPPED 1", StartsWith("OK 4 "),
                          StartsWith("NOTE pose 2 is left out: "), "KEPT 1",
                          "OK 5 variables 2 factors 1 owed 0"));
  const Outcome end = cairn(online(policy, {"-o", folder_.file("end.g2o")}), {},
                            joined({told.begin(), told.end() - 2}));
  EXPECT_EQ(end.exit_code, 0) << end.err;
  EXPECT_THAT(read_text(folder_.file("end.g2o")), HasSubstr("EDGE_SE2 0 1 "));
}

TEST_F(OnlinePolicy, ABadLineIsToldAndNothingOfItStays) {
  const std::string graph = generate("manhattan:poses=120");
  drive(graph, online(kPolicy, {"-o", folder_.file("good.g2o")}));
  const Lines bad{"REMOVE FACTOR 0",
                  "REMOVE VARIABLE 0",
                  "CHANGE 0 1 0 0",
                  "MARGINALIZE 0",
                  "SPARSIFY 0",
                  "SOLVE",
                  "FULL",
                  "NEXT pair",
                  "DONE it",
                  "NOMATCH",
                  "NOMATCH 0 0",
                  "NOMATCH 0 77777",
                  "NOMATCH x y",
                  "MATCH 0 1",
                  "EDGE_SE2 0 0" + kStep,
                  "EDGE_SE2 0 77777" + kStep,
                  "EDGE_SE2 0 1 1 0",
                  "EDGE_SE2_XY 0 1 1 0 1 0 1",
                  "EDGE_PRIOR_SE2 77777 0 0 0 1 0 0 1 0 1",
                  "EDGE_PRIOR_XY 0 0 0 1 0 1",
                  "REMOVE LINK 0 0",
                  "REMOVE LINK 0 77777",
                  "VERTEX_SE2 0 0 0 0",
                  "VERTEX_TRACKXYZ 88888 0 0 0",
                  "NEW VERTEX_SE3:QUAT 88888",
                  "NEW VERTEX_SE9 88888",
                  "FIX 0",
                  "ESTIMATE 77777",
                  "ESTIMATE",
                  "COVARIANCE 0",
                  "COVARIANCE 0 77777",
                  "SAVE -",
                  "QUIT now"};
  long poses = 0;
  const Dialogue dialogue =
      drive(graph, online(kPolicy, {"-o", folder_.file("bad.g2o")}), [&](long pose) {
        Lines told = bad;
        const std::string newest = std::to_string(pose), before = std::to_string(pose - 1);
        told.push_back("EDGE_SE2 0 " + newest + " 1 0 0 1 0 0 -1 0 1");
        if (pose > 0) told.push_back("EDGE_SE2 " + before + " " + newest + kStep);  // too late
        ++poses;
        return told;
      });
  EXPECT_EQ(dialogue.count("ERROR"), poses * static_cast<long>(bad.size() + 2) - 1);
  EXPECT_EQ(read_text(folder_.file("bad.g2o")), read_text(folder_.file("good.g2o")));
}

TEST_F(OnlinePolicy, SaysWhatIsWrongAndWhatWasExpected) {
  const auto error = [&](Lines told, const std::string& bad) {
    told.push_back(bad);
    const Lines answers = lines(cairn(online(kPolicy), {}, joined(told)).out);
    const std::string place = "ERROR line " + std::to_string(told.size()) + ": ";
    if (answers.empty() || !answers.back().starts_with(place))
      return "no error: " + joined(answers);
    return answers.back().substr(place.size());
  };
  const Lines two{"NEW VERTEX_SE2 0", "NEW VERTEX_SE2 1"};
  EXPECT_EQ(error({}, "NEXT"),
            "there is no pose that is not done; expected the line of the next one");
  EXPECT_EQ(error(two, "NEXT"),
            "pose 1 has no odometry yet; expected a relative pose between poses 0 and 1 first");
  EXPECT_EQ(error(two, "NEW VERTEX_SE2 2"), error(two, "DONE"));
  EXPECT_EQ(error(two, "NEW VERTEX_SE3:QUAT 1"),
            "VERTEX_SE3:QUAT 1: the poses before it are VERTEX_SE2; expected another");
  EXPECT_EQ(error(two, "NEW VERTEX_TRACKXYZ 7"),
            "VERTEX_TRACKXYZ 7: the poses are VERTEX_SE2; expected a landmark where they are");
  EXPECT_EQ(error(two, "NEW VERTEX_XY 1"), "VERTEX_XY 1: the id is already in use");
  EXPECT_EQ(error({"NEW VERTEX_XY 7"}, "NEW VERTEX_SE2 7"),
            "VERTEX_SE2 7: the id is already in use");
  EXPECT_EQ(
      error({"NEW VERTEX_SE2 0"}, "EDGE_SE2_XY 0 7 1 0 1 0 1"),
      "EDGE_SE2_XY 0 7: there is no landmark 7; expected its line, such as 'NEW VERTEX_XY 7', "
      "first");
  EXPECT_EQ(error({"NEW VERTEX_TRACKXYZ 7", "NEW VERTEX_SE2 0"}, "EDGE_SE2_XY 0 7 1 0 1 0 1"),
            "EDGE_SE2_XY 0 7: not a measurement of VERTEX_TRACKXYZ 7 from a VERTEX_SE2");
  EXPECT_EQ(
      error(two, "EDGE_SE2 0 9" + kStep),
      "between 0 and 9; expected a relative pose between pose 1, which is the newest, and another");
  EXPECT_THAT(error(two, "EDGE_SE2 0 1 1 0 0 1 0 0 -1 0 1"),
              HasSubstr("not positive semidefinite"));
  EXPECT_EQ(error(square(), "EDGE_SE2 9 4" + kStep), "there is no pose 9");
  EXPECT_EQ(error(square(), "FIX 2"),
            "FIX 2: only a pose that has just come can be held; expected FIX right after the line "
            "of the pose");
  EXPECT_EQ(error(square(), "FULL"),
            "FULL is not for a run with a policy, which solves by itself when a loop closes, and "
            "everything at the end");
  EXPECT_THAT(error(square(), "MARGINALIZE 2"), StartsWith("MARGINALIZE is not for a run with a "));
}

TEST_F(OnlinePolicy, ReportsWhatBecomesOfLandmarks) {
  const Lines told{"NEW VERTEX_SE2 0",
                   "NEW VERTEX_XY 100",
                   "EDGE_SE2_XY 0 100 2 1 100 0 100",
                   "NEW VERTEX_SE2 1",
                   "EDGE_SE2 0 1 1 0 0 100 0 0 100 0 400",
                   "EDGE_SE2_XY 1 100 1.05 0.95 100 0 100",
                   "NEW VERTEX_SE2 2",
                   "EDGE_SE2 1 2 1 0 0 1e8 0 0 1e8 0 1e8",
                   "NEW VERTEX_XY 101",
                   "EDGE_SE2_XY 2 100 0.05 0.95 100 0 100",
                   "EDGE_SE2_XY 2 101 4 1 100 0 100",
                   "DONE",
                   "ESTIMATE 100",
                   "COVARIANCE 100 1",
                   "ESTIMATE 101",
                   "ESTIMATE ALL"};
  const std::string policy =
      "compact_pose:range=3,angle=3,landmark_gain=0.6,pose_gain=5,sensor=0.1 0.1";
  const Outcome run = cairn(online(policy, {"--output", "none"}), {}, joined(told));
  EXPECT_THAT(
      lines(run.out),
      ElementsAre("LANDMARK 0 100 ADDED inf 0", "KEPT 0", "OK 4 variables 2 factors 1 owed 0",
                  StartsWith("LANDMARK 1 100 TAKEN 1."), "KEPT 1",
                  "OK 7 variables 3 factors 3 owed 0",
                  StartsWith("LANDMARK 2 100 UNINFORMATIVE 0."), "LANDMARK 2 101 NOTADDED inf 0",
                  "DROPPED 2", StartsWith("OK 12 "), StartsWith("VERTEX_XY 100 "),
                  StartsWith("OK 13 "), StartsWith("COVARIANCE 100 1 2 3 0.00"),
                  StartsWith("OK 14 "), StartsWith("ERROR line 15: there is no estimate of 101"),
                  StartsWith("VERTEX_SE2 0 "), StartsWith("VERTEX_SE2 1 "),
                  StartsWith("VERTEX_SE2 2 "), StartsWith("VERTEX_XY 100 "), StartsWith("OK 16 ")))
      << run.out;
}

TEST_F(OnlinePolicy, APoseThatCameByMistakeCanBeTakenBack) {
  const Lines told{
      "NEW VERTEX_SE3:QUAT 0",  // of another type
      "REMOVE VARIABLE 0",     "NEW VERTEX_SE2 0", "NEW VERTEX_SE2 1",     "REMOVE VARIABLE 0",
      "REMOVE VARIABLE 1",     "NEW VERTEX_SE2 2", "EDGE_SE2 0 2" + kStep, "DONE"};
  EXPECT_THAT(lines(cairn(online(kPolicy, {"--output", "none"}), {}, joined(told)).out),
              ElementsAre("OK 2 variables 0 factors 0 owed 0", "KEPT 0", StartsWith("OK 4 "),
                          StartsWith("ERROR line 5: "), "OK 6 variables 1 factors 0 owed 0",
                          "KEPT 2", "OK 9 variables 2 factors 1 owed 0"));
}

TEST_F(OnlinePolicy, RefusesWhatDoesNotGoWithAPolicy) {
  for (const Arguments& more : {Arguments{"--solve", "explicit"}, Arguments{"--budget", "1"}}) {
    const Outcome run = cairn(online(kPolicy, more));
    EXPECT_EQ(run.exit_code, 2);
    EXPECT_THAT(run.err, HasSubstr("are for runs without --policy"));
  }
  const Outcome twice = cairn(online("compact_pose:estimator=batch", {"--estimator", "batch"}));
  EXPECT_EQ(twice.exit_code, 2);
  EXPECT_THAT(twice.err, HasSubstr("give one"));
  EXPECT_EQ(cairn(online("compact")).exit_code, 5);
  const Outcome random = cairn(online("random_poses"), {}, "NEW VERTEX_SE2 0\nNEXT\n");
  EXPECT_EQ(random.exit_code, 2);
  EXPECT_THAT(random.out, StartsWith("ERROR line 2: random_poses draws from a recording"));
}

}  // namespace
}  // namespace cairn::test
