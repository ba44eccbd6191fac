// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/policy_session.hpp"

#include <malloc.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <memory>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/runtime/error.hpp"
#include "support/components.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

const std::string kQuarter = " 1 0 1.5707963267948966 400 0 0 400 0 400";
const std::string kHere = " 0 0 0 400 0 0 400 0 400";

/// Once round a square: pose 4 is where pose 0 was.
class PolicySessionTest : public ::testing::Test {
 protected:
  void begin() {
    number_ = 0;
    format_ = registry_.make<StreamFormat>("g2o");
    policy_ = registry_.make<PosePolicy>("compact_pose:range=3,angle=0.8,reuse=true");
    session_ = std::make_unique<PolicySession>(*policy_, *format_, registry_,
                                               PolicySettings{.read = {}, .output = "none"});
  }
  void SetUp() override {
    CAIRN_NEEDS("types", "slam2d");
    begin();
  }
  std::int64_t counted(std::string_view name) const {
    for (const auto& [each, count] : session_->counts())
      if (each == name) return count;
    ADD_FAILURE() << name << " is not counted";
    return -1;
  }
  LineSession::Reply take(const std::string& line) { return session_->take(line, ++number_); }
  static std::vector<std::string> square() {
    std::vector<std::string> lines{"NEW VERTEX_SE2 0"};
    for (int k = 1; k <= 4; ++k) {
      lines.push_back("NEW VERTEX_SE2 " + std::to_string(k));
      lines.push_back("EDGE_SE2 " + std::to_string(k - 1) + " " + std::to_string(k) + kQuarter);
    }
    return lines;
  }
  std::string drive() {
    std::string text;
    for (const std::string& line : square()) text += take(line).text;
    return text;
  }
  Registry registry_;
  std::unique_ptr<StreamFormat> format_;
  std::unique_ptr<PosePolicy> policy_;
  std::unique_ptr<PolicySession> session_;
  std::int64_t number_ = 0;
};

TEST_F(PolicySessionTest, SuggestsTheCommandForAWordThatIsMisspelt) {
  EXPECT_THAT(take("NXET").text, HasSubstr("; did you mean 'NEXT'?"));
  EXPECT_THAT(take("NO_MATCH 0 1").text, HasSubstr("; did you mean 'NOMATCH'?"));
  EXPECT_THAT(take("SLOVE").text, Not(HasSubstr("did you mean 'SOLVE'")));  // it would be refused
}

TEST_F(PolicySessionTest, ThePoseBeforeEndsWhereThePoseAfterItBegins) {
  EXPECT_THAT(take("NEW VERTEX_SE2 0").text, IsEmpty());
  EXPECT_EQ(take("NEW VERTEX_SE2 1").text, "KEPT 0\nOK 2 variables 1 factors 0 owed 0\n");
  EXPECT_THAT(take("EDGE_SE2 0 1" + kQuarter).text, IsEmpty());
  EXPECT_THAT(take("DONE").text, HasSubstr("OK 4 "));
}

TEST_F(PolicySessionTest, ProposesTheSamePairUntilItIsMeasured) {
  drive();
  const std::string first = take("NEXT").text;
  EXPECT_THAT(first, StartsWith("MATCH 0 4 "));
  EXPECT_THAT(take("NEXT").text, StartsWith(first.substr(0, first.find('\n'))));
  EXPECT_THAT(take("EDGE_SE2 0 4" + kHere).text, IsEmpty());
  const std::string done = take("DONE").text;
  EXPECT_THAT(done, StartsWith("LINKED 0 4 "));
  EXPECT_THAT(done, HasSubstr("KEPT 4\nOK "));
  EXPECT_EQ(counted("poses.in"), 5);
  EXPECT_EQ(counted("loops.proposed"), 1);
  EXPECT_EQ(counted("loops.registered"), 1);
  EXPECT_EQ(counted("loops.kept"), 1);
}

/// Poses 100 and 101, a metre apart.
Graph small_map(Registry& registry) {
  const auto pose = registry.variable_type("VERTEX_SE2");
  const std::array<double, 3> here{5.0, 5.0, 0.0}, there{6.0, 5.0, 0.0}, apart{1.0, 0.0, 0.0};
  const std::array<double, 6> information{400.0, 0.0, 0.0, 400.0, 0.0, 400.0};
  Graph map;
  const std::array<int, 2> on{map.add_variable(pose, 100, here),
                              map.add_variable(pose, 101, there)};
  map.add_factor(registry.factor_type("EDGE_SE2"), on, apart, information);
  return map;
}

TEST_F(PolicySessionTest, AMapIsContinuedWhereAPoseIsRecognised) {
  session_->load(small_map(registry_));
  EXPECT_THAT(take("NEW VERTEX_SE2 100").text, HasSubstr("the id is already in use"));
  take("NEW VERTEX_SE2 0");
  EXPECT_THAT(take("NEXT").text, HasSubstr("LOCATE 0\nOK "));
  EXPECT_THAT(take("NEXT").text, StartsWith("MATCH NONE\n"));  // once for each pose
  take("NEW VERTEX_SE2 1");
  take("EDGE_SE2 0 1 1 0 0 400 0 0 400 0 400");
  EXPECT_THAT(take("NEXT").text, StartsWith("LOCATE 1\n"));
  take("EDGE_SE2 101 1" + kHere);
  EXPECT_THAT(take("ESTIMATE 1").text, HasSubstr("VERTEX_SE2 1 6 5 0\n"));
  EXPECT_THAT(take("ESTIMATE 0").text, HasSubstr("VERTEX_SE2 0 5 5 0\n"));
  EXPECT_THAT(take("ESTIMATE 100").text, HasSubstr("VERTEX_SE2 100 5 5 0\n"));
  EXPECT_THAT(take("NEXT").text, ::testing::Not(HasSubstr("LOCATE")));
  EXPECT_THAT(take("QUIT").text, ::testing::Not(HasSubstr("not connected")));
}

TEST_F(PolicySessionTest, BeforeTheRobotIsLocatedThereIsNoCovariance) {
  session_->load(small_map(registry_));
  EXPECT_TRUE(session_->located());
  take("NEW VERTEX_SE2 0");
  EXPECT_THAT(take("FIX 0").text, HasSubstr("it is not known where the pose is on the map"));
  EXPECT_THAT(take("ESTIMATE 0").text,
              HasSubstr("NOTE until a pose is matched with one of the map"));
  EXPECT_FALSE(session_->located());
  for (const char* line : {"COVARIANCE 0 0", "COVARIANCE 100 0"})
    EXPECT_THAT(take(line).text, HasSubstr("no pose was matched with one of the map yet")) << line;
  EXPECT_THAT(take("COVARIANCE 101 101").text, HasSubstr("COVARIANCE 101 101 "));
  take("EDGE_SE2 101 0" + kHere);
  EXPECT_THAT(take("COVARIANCE 0 0").text, HasSubstr("COVARIANCE 0 0 "));
  EXPECT_TRUE(session_->located());
}

TEST_F(PolicySessionTest, AMapThatWasNeverMatchedIsReported) {
  session_->load(small_map(registry_));
  drive();
  session_->finish();
  EXPECT_FALSE(session_->located());
  EXPECT_THAT(session_->unread_notes(), ::testing::Contains(HasSubstr("not connected")));
  begin();
  session_->load(small_map(registry_));
  drive();
  EXPECT_THAT(take("QUIT").text, HasSubstr("NOTE no pose was matched with one of the map"));
}

TEST_F(PolicySessionTest, WhatDoesNotMatchIsProposedNoMore) {
  drive();
  EXPECT_THAT(take("NEXT").text, StartsWith("MATCH 0 4 "));
  EXPECT_TRUE(take("NOMATCH 0 4").changes);
  EXPECT_THAT(take("NEXT").text, StartsWith("MATCH NONE\n"));
  EXPECT_EQ(counted("loops.kept"), 0);
}

TEST_F(PolicySessionTest, RefusesWhatDoesNotGoWithAPolicy) {
  drive();
  const std::vector<std::string> lines = {"SOLVE",
                                          "FULL",
                                          "CHANGE 0 1 0 0",
                                          "MARGINALIZE 0",
                                          "REMOVE VARIABLE 0",
                                          "FIX 0",
                                          "VERTEX_SE2 0 0 0 0",
                                          "NEW VERTEX_XY 3",
                                          "EDGE_SE2 1 2" + kHere,
                                          "EDGE_SE2 9 4" + kHere,
                                          "NEXT pair",
                                          "ESTIMATE 9",
                                          "COVARIANCE 0 9",
                                          "SAVE -"};
  for (const std::string& line : lines) {
    const LineSession::Reply reply = take(line);
    EXPECT_TRUE(reply.refused) << line;
    EXPECT_FALSE(reply.changes) << line;
    EXPECT_THAT(reply.text, StartsWith("ERROR line " + std::to_string(number_) + ": ")) << line;
  }
  EXPECT_THAT(take("NEXT").text, StartsWith("MATCH 0 4 "));
}

TEST_F(PolicySessionTest, ALinkCanBeRevoked) {
  drive();
  EXPECT_THAT(take("REMOVE LINK 0 4").text, HasSubstr("there is no link of poses 0 and 4"));
  EXPECT_THAT(take("REMOVE LINK 0 9").text, HasSubstr("there is no pose 9"));
  EXPECT_THAT(take("REMOVE LINK 0").text, HasSubstr("expected 'REMOVE LINK id id'"));
  const std::string before = take("ESTIMATE ALL").text;
  const auto states = [](const std::string& text) {
    return text.substr(text.find("VERTEX"), text.find("OK ") - text.find("VERTEX"));
  };
  take("EDGE_SE2 0 4 0.3 0.2 0.1 400 0 0 400 0 400");
  const LineSession::Reply reply = take("REMOVE LINK 4 0");  // which settles it first
  EXPECT_TRUE(reply.changes);
  EXPECT_THAT(reply.text, StartsWith("LINKED 0 4 "));
  EXPECT_THAT(reply.text, HasSubstr("\nUNLINKED 4 0\nOK "));
  EXPECT_THAT(take("REMOVE LINK 4 0").text, HasSubstr("there is no link"));
  std::istringstream now(states(take("ESTIMATE ALL").text)), then(states(before));
  for (std::string word, other; now >> word && then >> other;) {
    if (word == other) continue;
    EXPECT_NEAR(std::stod(word), std::stod(other), 1e-6);
  }
  EXPECT_EQ(counted("loops.revoked"), 1);
  EXPECT_THAT(take("NEXT").text, StartsWith("MATCH NONE"));  // it is not asked for again
}

TEST_F(PolicySessionTest, AnAbsoluteMeasurementIsJudgedWhereItsPoseEnds) {
  const std::string position = " 0 0 0 10000 0 0 10000 0 0";
  take("VERTEX_SE2 0 0 0 0");
  take("FIX 0");
  for (int k = 1; k <= 3; ++k) {
    take("NEW VERTEX_SE2 " + std::to_string(k));
    take("EDGE_SE2 " + std::to_string(k - 1) + " " + std::to_string(k) + kQuarter);
  }
  EXPECT_THAT(take("EDGE_PRIOR_SE2 2 1 1 0 1 0 0 1 0 0").text, HasSubstr("of the newest pose"));
  EXPECT_THAT(take("EDGE_PRIOR_XY 3 1 1 1 0 1").text,
              HasSubstr("of landmarks a policy takes those from poses"));
  EXPECT_THAT(take("EDGE_PRIOR_SE2 3 0 1 0 10000 0 0 10000 0 0").text, IsEmpty());
  EXPECT_THAT(take("EDGE_SE2 2 3" + kQuarter).text, HasSubstr("after other lines"));
  EXPECT_EQ(take("NEXT").text, "MATCH NONE\nOK 13 variables 3 factors 2 owed 0\n");
  const std::string done = take("DONE").text;
  EXPECT_THAT(done, StartsWith("PRIOR 3 TAKEN "));
  EXPECT_THAT(done, HasSubstr("KEPT 3\nOK 14 variables 4 factors 4 owed 0\n"));
  EXPECT_EQ(counted("priors.kept"), 1);
  EXPECT_THAT(take("EDGE_PRIOR_SE2 3" + position).text, HasSubstr("before it ends (DONE)"));
  take("NEW VERTEX_SE2 4");
  take("EDGE_SE2 3 4" + kHere);
  take("EDGE_PRIOR_SE2 4 0 1 0 1 0 0 1 0 0");
  EXPECT_THAT(take("DONE").text, StartsWith("PRIOR 4 UNINFORMATIVE "));
}

TEST_F(PolicySessionTest, AbsoluteMeasurementsWaitForThePlaceOnTheMap) {
  session_->load(small_map(registry_));
  take("NEW VERTEX_SE2 0");
  const LineSession::Reply reply = take("EDGE_PRIOR_SE2 0 5 5 0 100 0 0 100 0 100");
  EXPECT_THAT(reply.text, HasSubstr("expected a match with it (LOCATE) first"));
  EXPECT_FALSE(reply.changes);
  take("EDGE_SE2 101 0" + kHere);
  take("NEXT");
  take("EDGE_PRIOR_SE2 0 7 6 0.5 100 0 0 100 0 100");
  EXPECT_THAT(take("DONE").text, StartsWith("PRIOR 0 TAKEN "));
  EXPECT_THAT(take("ESTIMATE 0").text, HasSubstr("VERTEX_SE2 0 7 6 0.5\n"));
}

TEST_F(PolicySessionTest, APoseThatCameByMistakeCanBeTakenBack) {
  drive();
  take("DONE");
  EXPECT_THAT(take("NEW VERTEX_SE2 5").text, IsEmpty());
  EXPECT_THAT(take("NEXT").text, HasSubstr("pose 5 has no odometry yet"));
  EXPECT_THAT(take("REMOVE VARIABLE 5").text, HasSubstr("OK "));
  EXPECT_THAT(take("ESTIMATE 5").text, StartsWith("ERROR"));
  EXPECT_EQ(counted("poses.in"), 5);
}

TEST_F(PolicySessionTest, AMeasurementWithoutInformationIsRefused) {
  take("NEW VERTEX_SE2 0");
  take("NEW VERTEX_SE2 1");
  // From the other end its covariance is not finite.
  const LineSession::Reply reply = take("EDGE_SE2 1 0 -1e300 0 3 1 0 0 1 0 1");
  EXPECT_THAT(reply.text, HasSubstr("covariance that is not positive definite"));
  EXPECT_FALSE(reply.changes);
  take("EDGE_SE2 0 1" + kQuarter);
  EXPECT_THAT(take("NEXT").text, StartsWith("MATCH NONE\n"));
}

/// Pose 1 is where pose 0 was, and dropped; pose 2 is so far from it that the covariance of both
/// steps together is not finite.
class FarOdometry : public PolicySessionTest {
 protected:
  void SetUp() override {
    PolicySessionTest::SetUp();
    if (IsSkipped()) return;
    take("NEW VERTEX_SE2 0");
    take("NEW VERTEX_SE2 1");
    take("EDGE_SE2 0 1" + kHere);
    EXPECT_THAT(take("NEW VERTEX_SE2 2").text, StartsWith("DROPPED 1\n"));
    EXPECT_THAT(take("EDGE_SE2 1 2 1e200 0 0 400 0 0 400 0 400").text, IsEmpty());
  }
};

TEST_F(FarOdometry, IsRefusedBeforeAnythingChanges) {
  const LineSession::Reply reply = take("NEXT");
  EXPECT_FALSE(reply.changes);
  EXPECT_THAT(reply.text, HasSubstr("pose 2 is not taken: "));
  EXPECT_THAT(reply.text, HasSubstr("expected 'REMOVE VARIABLE 2', and other odometry"));
  EXPECT_THAT(take("REMOVE VARIABLE 2").text, StartsWith("OK "));
  take("NEW VERTEX_SE2 2");
  take("EDGE_SE2 1 2" + kQuarter);
  EXPECT_THAT(take("NEXT").text, StartsWith("MATCH NONE\n"));
}

TEST_F(FarOdometry, AtTheEndItsPoseIsLeftOut) {
  const std::string text = take("QUIT").text;
  EXPECT_THAT(text, HasSubstr("NOTE pose 2 is not taken: "));
  EXPECT_THAT(text, HasSubstr("KEPT 1\n"));
  EXPECT_FALSE(session_->estimator().has(2));
}

TEST_F(PolicySessionTest, ALineThatChangesAndIsAnsweredByAnErrorCanBeRestored) {
  session_->load(small_map(registry_));
  for (const std::string& line : {std::string("NEW VERTEX_SE2 0"), std::string("NEW VERTEX_SE2 1"),
                                  "EDGE_SE2 0 1" + kQuarter})
    take(line);
  const LineSession::Reply reply = take("COVARIANCE 0 0");  // takes in pose 1
  EXPECT_TRUE(reply.changes);
  EXPECT_THAT(reply.text, HasSubstr("no pose was matched with one of the map yet"));
  const std::string estimate = take("ESTIMATE ALL").text;

  begin();
  session_->load(small_map(registry_));
  session_->restore("NEW VERTEX_SE2 0", ++number_);
  session_->restore("NEW VERTEX_SE2 1", ++number_);
  session_->restore("EDGE_SE2 0 1" + kQuarter, ++number_);
  EXPECT_NO_THROW(session_->restore("COVARIANCE 0 0", ++number_));
  EXPECT_EQ(take("ESTIMATE ALL").text, estimate.substr(estimate.find("VERTEX")));
}

TEST_F(PolicySessionTest, TheEndKeepsTheNewestPose) {
  drive();
  const LineSession::Reply reply = take("QUIT");
  EXPECT_TRUE(reply.quit);
  EXPECT_FALSE(reply.changes);  // a restored session goes on from before it
  EXPECT_THAT(reply.text, HasSubstr("KEPT 4\n"));
  EXPECT_TRUE(session_->estimator().has(4));
}

TEST_F(PolicySessionTest, HelpListsTheCommandsThatItTakes) {
  drive();
  const std::string text = take("HELP").text;
  EXPECT_THAT(text, HasSubstr("NOTE commands: NEW, NEXT, NOMATCH, DONE, "));
  EXPECT_THAT(text, Not(HasSubstr("SOLVE")));
  EXPECT_THAT(session_->ask("HELP", 3).text, HasSubstr("NOTE commands: NEW, NEXT, "));
}

TEST_F(PolicySessionTest, RestoredLinesGiveTheSameEstimate) {
  std::vector<std::string> lines = square();
  lines.insert(lines.end(), {"EDGE_SE2 0 4" + kHere, "DONE"});
  for (const std::string& line : lines) take(line);
  const std::string estimate = take("ESTIMATE ALL").text;
  begin();
  for (const std::string& line : lines) session_->restore(line, ++number_);
  EXPECT_EQ(take("ESTIMATE ALL").text, estimate);
  EXPECT_EQ(counted("loops.kept"), 1);
}

/// A service runs for days: what it holds after many laps is what it held after some.
TEST_F(PolicySessionTest, HoldsNoMoreHoweverLongItRuns) {
#if defined(CAIRN_SANITIZED)
  GTEST_SKIP() << "mallinfo2 does not know the sanitizer's allocator";
#else
  policy_ = registry_.make<PosePolicy>(
      "compact_pose:range=1.5,angle=1,loop_gain=1,pose_gain=1,reuse=true");
  session_ = std::make_unique<PolicySession>(*policy_, *format_, registry_,
                                             PolicySettings{.read = {}, .output = "none"});
  constexpr int kPlaces = 40;  // of a circle
  constexpr double kTurn = 2.0 * std::numbers::pi / kPlaces;
  std::ostringstream step;
  step << std::setprecision(17) << ' ' << 5.0 * std::sin(kTurn) << ' '
       << 5.0 * (1.0 - std::cos(kTurn)) << ' ' << kTurn << " 2500 0 0 2500 0 40000";
  take("NEW VERTEX_SE2 0");
  const auto drive_to = [&](int end) {
    for (int k = static_cast<int>(counted("poses.in")); k < end; ++k) {
      const std::string pose = std::to_string(k);
      take("NEW VERTEX_SE2 " + pose);
      take("EDGE_SE2 " + std::to_string(k - 1) + " " + pose + step.str());
      if (k >= kPlaces)
        take("EDGE_SE2 " + std::to_string(k % kPlaces) + " " + pose +
             " 0 0 0 2500 0 0 2500 0 40000");
      take("DONE");
    }
    return ::mallinfo2().uordblks + ::mallinfo2().hblkhd;
  };
  take("DONE");
  const std::size_t early = drive_to(2000);
  const std::int64_t kept = session_->pose_count();
  const std::size_t late = drive_to(6000);
  EXPECT_LT(kept, 50);
  EXPECT_EQ(session_->pose_count(), kept);
  EXPECT_GT(counted("loops.kept"), 5900);
  EXPECT_LT(late, early + 40000);  // 10 bytes for each pose
#endif
}

/// Three laps of a square in steps of half a side: every other pose is left out.
class PolicyTrajectory : public PolicySessionTest {
 protected:
  void drive_laps(bool trajectory) {
    format_ = registry_.make<StreamFormat>("g2o");
    policy_ = registry_.make<PosePolicy>("compact_pose:range=3,angle=0.8,pose_gain=1.5,reuse=true");
    session_ = std::make_unique<PolicySession>(
        *policy_, *format_, registry_,
        PolicySettings{.read = {}, .output = "none", .trajectory = trajectory});
    take("NEW VERTEX_SE2 0");
    for (int k = 1; k <= 24; ++k) {
      take("NEW VERTEX_SE2 " + std::to_string(k));
      take("EDGE_SE2 " + std::to_string(k - 1) + " " + std::to_string(k) +
           (k % 2 == 0 ? " 1 0 1.5707963267948966 400 0 0 400 0 400" : " 1 0 0 400 0 0 400 0 400"));
      for (std::string text = take("NEXT").text; text.find("MATCH NONE") == std::string::npos;
           text = take("NEXT").text) {
        const std::string pair = text.substr(text.find("MATCH ") + 6);
        const int earlier = std::stoi(pair);
        const bool same_place = (k - earlier) % 8 == 0;
        take((same_place ? "EDGE_SE2 " : "NOMATCH ") + std::to_string(earlier) + " " +
             std::to_string(k) + (same_place ? kHere : ""));
      }
    }
  }
};

TEST_F(PolicyTrajectory, EstimatesPosesThatWereLeftOut) {
  drive_laps(true);
  EXPECT_LT(policy_->kept().size(), 20U);
  int left_out = 0;
  for (int k = 0; k < 16; ++k) {
    const std::vector<Id> kept = policy_->kept();
    left_out += std::ranges::count(kept, k) == 0;
    const std::string text = take("ESTIMATE " + std::to_string(k)).text;
    ASSERT_THAT(text, StartsWith("VERTEX_SE2 " + std::to_string(k) + " "));
    std::istringstream words(text);
    std::string tag;
    double id = 0.0, x = 0.0, y = 0.0;
    words >> tag >> id >> x >> y;
    constexpr std::array<double, 8> kX{0, 1, 2, 2, 2, 1, 0, 0}, kY{0, 0, 0, 1, 2, 2, 2, 1};
    const auto corner = static_cast<std::size_t>(k % 8);
    EXPECT_NEAR(x, kX[corner], 1e-6) << k;
    EXPECT_NEAR(y, kY[corner], 1e-6) << k;
  }
  EXPECT_GT(left_out, 4);
  EXPECT_FALSE(policy_->chains().empty());
  EXPECT_THAT(take("ESTIMATE 99").text, HasSubstr("there is no estimate of 99"));
}

TEST_F(PolicyTrajectory, TakesNoMemoryWhereNobodyAsksForIt) {
  drive_laps(false);
  EXPECT_TRUE(policy_->chains().empty());
  const std::vector<Id> kept = policy_->kept();
  for (int k = 0; k < 16; ++k) {
    if (std::ranges::count(kept, k) > 0) continue;
    EXPECT_THAT(take("ESTIMATE " + std::to_string(k)).text, HasSubstr("--trajectory"));
  }
}

}  // namespace
}  // namespace cairn
