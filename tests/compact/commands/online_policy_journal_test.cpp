// SPDX-License-Identifier: BSD-3-Clause
// cairn online --policy --journal: nothing is lost, and it goes on where the journal ends.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <iterator>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "integration/front_end.hpp"
#include "integration/process.hpp"

namespace cairn::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using testing::StartsWith;

/// Questions that read the estimator, which hands over what had been held back.
Lines questions(long pose) {
  if (pose % 9 == 4) return {"ESTIMATE ALL"};
  if (pose % 9 == 6) return {"COVARIANCE 0 0", "NEXT"};
  if (pose % 25 == 8) return {"SAVE nowhere/at/all.g2o"};  // fails after it was read
  return {};
}

TEST_F(OnlinePolicy, AJournalIsOfTheMapThatItsSessionContinued) {
  const std::string map = folder_.file("map.g2o"), other = folder_.file("other.g2o");
  write_text(map,
             "VERTEX_SE2 100 5 5 0\nVERTEX_SE2 101 6 5 0\n"
             "EDGE_SE2 100 101 1 0 0 400 0 0 400 0 400\n");
  write_text(other,
             "VERTEX_SE2 100 5 5 0\nVERTEX_SE2 101 6 5 0.1\n"
             "EDGE_SE2 100 101 1 0 0 400 0 0 400 0 400\n");
  const auto arguments = [&](const std::string& which) {
    return online(kPolicy, {"--map", which, "--journal", folder_.file("log")});
  };
  const Lines first{"NEW VERTEX_SE2 0", "NEXT", "EDGE_SE2 101 0 0 0 0 400 0 0 400 0 400", "DONE"};
  const Outcome begun = cairn(arguments(map), {}, joined(first));
  ASSERT_EQ(begun.exit_code, 0) << begun.err;
  EXPECT_THAT(begun.out, HasSubstr("LOCATE 0\n"));
  EXPECT_THAT(begun.out, HasSubstr("LINKED 101 0 inf 0\n"));
  const Outcome again = cairn(arguments(map), {}, joined({"ESTIMATE 0"}));
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_THAT(again.out, HasSubstr("VERTEX_SE2 0 6 5 0\n"));
  EXPECT_EQ(cairn(arguments(other), {}, "").exit_code, 2);
  EXPECT_EQ(cairn({"online", "--map", map}, {}, "").exit_code, 2);
}

TEST_F(OnlinePolicy, TakesThresholdsFromAFile) {
  const std::string robot = folder_.file("robot.json");
  write_text(robot, R"({"policy": "compact_pose", "options": {"range": "3", "loop_gain": "1e9"}})");
  const std::string graph = generate("manhattan:poses=100");
  const Dialogue dialogue = drive(graph, online("compact_pose:angle=1", {"--thresholds", robot}));
  EXPECT_EQ(dialogue.count("LINKED"), 0);
  EXPECT_EQ(cairn({"online", "--thresholds", robot}, {}, "").exit_code, 2);
}

TEST_F(OnlinePolicy, GoesOnWhereTheJournalEnds) {
  const std::string graph = generate("manhattan:poses=200");
  const std::string policy = kPolicy + ",gate=0.9";
  const Dialogue whole = drive(graph, online(policy, {"-o", folder_.file("whole.g2o")}), questions);
  ASSERT_GT(whole.count("LINKED"), 5);
  // Stopped after every 37th line, whatever it is.
  const Arguments arguments =
      online(policy, {"--journal", folder_.file("log"), "-o", folder_.file("parts.g2o")});
  std::size_t from = 0, restarts = 0;
  std::string last_answer;
  for (; from < whole.told.size(); ++restarts) {
    const std::size_t end = std::min(from + 37, whole.told.size());
    const Lines part(whole.told.begin() + static_cast<std::ptrdiff_t>(from),
                     whole.told.begin() + static_cast<std::ptrdiff_t>(end));
    const Outcome run = cairn(arguments, {}, joined(part));
    ASSERT_EQ(run.exit_code, 0) << run.err;
    const Lines answers = lines(run.out);
    std::size_t restored = 0;
    ASSERT_EQ(std::sscanf(answers[0].c_str(), "RESTORED %zu", &restored), 1);
    // A question that was told last is not in the journal, and its line is used again.
    ASSERT_LE(restored, from);
    ASSERT_LE(from - restored, restarts * 2);
    last_answer = answers.back();
    from = end;
  }
  EXPECT_GT(restarts, 10U);
  EXPECT_EQ(read_text(folder_.file("parts.g2o")), read_text(folder_.file("whole.g2o")));
  EXPECT_EQ(last_answer.substr(last_answer.find("variables")),
            whole.heard.back().substr(whole.heard.back().find("variables")));
}

TEST_F(OnlinePolicy, AMapOfAFixedNumberOfPosesIsRestored) {
  const std::string graph = generate("manhattan:poses=200");
  const Arguments keep{"--keep", "30", "--output", "changed"};
  const auto with = [&](Arguments more) {
    more.insert(more.end(), keep.begin(), keep.end());
    return online("compact_pose:range=3,angle=0.8,reuse=true,gate=0.9", more);
  };
  const Dialogue whole = drive(graph, with({"-o", folder_.file("whole.g2o")}), questions);
  ASSERT_GT(whole.count("REMOVED"), 5);
  // The last pose is told as KEPT at the end whether it was before or not: so by the ids.
  std::set<std::string> there;
  for (const std::string& line : whole.heard) {
    if (line.starts_with("KEPT ")) there.insert(line.substr(5));
    if (line.starts_with("REMOVED ")) {
      EXPECT_EQ(there.erase(line.substr(8)), 1U) << line;
    }
  }
  std::set<std::string> saved;
  for (const std::string& line : lines(read_text(folder_.file("whole.g2o")))) {
    if (line.starts_with("VERTEX_SE2 ")) saved.insert(line.substr(11, line.find(' ', 11) - 11));
  }
  EXPECT_EQ(saved.size(), 30U);
  EXPECT_EQ(there, saved);
  const Arguments arguments =
      with({"--journal", folder_.file("log"), "-o", folder_.file("parts.g2o")});
  for (std::size_t from = 0; from < whole.told.size(); from += 97) {
    const std::size_t end = std::min(from + 97, whole.told.size());
    const Lines part(whole.told.begin() + static_cast<std::ptrdiff_t>(from),
                     whole.told.begin() + static_cast<std::ptrdiff_t>(end));
    ASSERT_EQ(cairn(arguments, {}, joined(part)).exit_code, 0);
  }
  EXPECT_EQ(read_text(folder_.file("parts.g2o")), read_text(folder_.file("whole.g2o")));
  // Another number of poses would give another map.
  EXPECT_EQ(cairn(online("compact_pose:range=3,angle=0.8,reuse=true,gate=0.9",
                         {"--keep", "31", "--output", "changed", "--journal", folder_.file("log")}),
                  {}, "")
                .exit_code,
            2);
}

TEST_F(OnlinePolicy, APoseThatHasLeftIsRefusedWithAdvice) {
  Lines told{"NEW VERTEX_SE2 0"};
  for (int k = 1; k < 8; ++k) {
    told.push_back("NEW VERTEX_SE2 " + std::to_string(k));
    told.push_back("EDGE_SE2 " + std::to_string(k - 1) + " " + std::to_string(k) + kStep);
  }
  told.push_back("DONE");
  const Arguments arguments = online("compact_pose:range=3,angle=0.8,pose_gain=0", {"--keep", "4"});
  const Lines answers = lines(cairn(arguments, {}, joined(told)).out);
  std::string gone;
  for (const std::string& line : answers) {
    if (line.starts_with("REMOVED ") && gone.empty()) gone = line.substr(8);
  }
  ASSERT_FALSE(gone.empty()) << joined(answers);
  told.back() = "EDGE_SE2 " + gone + " 7" + kStep;
  told.push_back("ESTIMATE " + gone);
  EXPECT_THAT(cairn(arguments, {}, joined(told)).out,
              testing::AllOf(HasSubstr("pose " + gone +
                                       " was not kept, or has left since (DROPPED, REMOVED); "
                                       "expected a pose that is, such as NEXT proposes"),
                             HasSubstr("there is no estimate of " + gone)));
}

TEST_F(OnlinePolicy, WhatAQuestionSettledOrAskedIsInTheJournal) {
  const auto in_two = [&](const std::string& log, const Lines& first, const Lines& second) {
    const Arguments arguments =
        online(kPolicy, {"--output", "none", "--journal", folder_.file(log)});
    cairn(arguments, {}, joined(first));
    return lines(cairn(arguments, {}, joined(second)).out);
  };
  // A measurement after a question is another one, not part of the one before.
  Lines told = square();
  told.insert(told.end(), {"EDGE_SE2 0 4" + kHere, "ESTIMATE 4"});
  const Lines rest{"EDGE_SE2 0 4" + kHere, "DONE", "ESTIMATE ALL"};
  const Lines parts = in_two("settled", told, rest);
  EXPECT_EQ(parts.at(0), "RESTORED 11 variables 5 factors 5");
  told.insert(told.end(), rest.begin(), rest.end());
  const Lines whole = lines(cairn(online(kPolicy, {"--output", "none"}), {}, joined(told)).out);
  const auto done = [](const Lines& answers) {
    const auto kept = std::ranges::find(answers, "KEPT 4");
    return kept == answers.begin() || kept == answers.end() ? Lines()
                                                            : Lines(kept - 1, answers.end());
  };
  EXPECT_THAT(done(whole), SizeIs(9)) << joined(whole);
  EXPECT_EQ(done(parts), done(whole));
  // The answer to NEXT may have been lost: it can be asked again.
  Lines asking = square();
  asking.insert(asking.end(), {"EDGE_SE2 1 4 1 0 1.5 4 0 0 4 0 4", "ESTIMATE 4", "NEXT"});
  const Lines again = in_two("asked", asking, {"NEXT"});
  EXPECT_EQ(again.at(0), "RESTORED 12 variables 4 factors 3");
  EXPECT_THAT(again.at(1), StartsWith("MATCH 0 4 "));
}

TEST_F(OnlinePolicy, LinksThatWereRevokedStaySo) {
  const std::string graph = generate("manhattan:poses=150");
  const Dialogue driven = drive(graph, online("compact_pose:range=3,angle=0.8,reuse=true"));
  ASSERT_GT(driven.count("LINKED"), 5);
  // The same again, in which every third link is revoked twenty lines later.
  std::multimap<std::size_t, std::string> revoked;
  int links = 0;
  for (std::size_t k = 0; k < driven.told.size(); ++k) {
    const Lines fields = words(driven.told[k]);
    if (fields[0] == "NEXT" || fields[0] == "DONE") continue;
    if (fields[0] != "EDGE_SE2" || std::stol(fields[2]) - std::stol(fields[1]) == 1) continue;
    if (++links % 3 == 0) revoked.emplace(k + 20, "REMOVE LINK " + fields[1] + " " + fields[2]);
  }
  Lines told;
  for (std::size_t k = 0; k < driven.told.size(); ++k) {
    told.push_back(driven.told[k]);
    for (auto [at, end] = revoked.equal_range(k); at != end; ++at) told.push_back(at->second);
  }
  const auto with = [&](Arguments more) {
    return online("compact_pose:range=3,angle=0.8,reuse=true", more);
  };
  const Outcome whole = cairn(with({"-o", folder_.file("whole.g2o")}), {}, joined(told));
  ASSERT_EQ(whole.exit_code, 0) << whole.err;
  const Lines answers = lines(whole.out);
  EXPECT_GT(std::ranges::count_if(
                answers, [](const std::string& line) { return line.starts_with("UNLINKED "); }),
            2);
  const Arguments arguments =
      with({"--journal", folder_.file("log"), "-o", folder_.file("parts.g2o")});
  for (std::size_t from = 0; from < told.size(); from += 67) {
    const std::size_t end = std::min(from + 67, told.size());
    const Lines part(told.begin() + static_cast<std::ptrdiff_t>(from),
                     told.begin() + static_cast<std::ptrdiff_t>(end));
    ASSERT_EQ(cairn(arguments, {}, joined(part)).exit_code, 0);
  }
  EXPECT_EQ(read_text(folder_.file("parts.g2o")), read_text(folder_.file("whole.g2o")));
}

/// The lines of a file in g2o as a robot would send them, each pose with what it measures; `seen`:
/// the tag of what it measures of landmarks.
Lines told_of(const Lines& recorded, const std::string& seen) {
  std::map<long, Lines> of_pose;
  std::set<long> poses, landmarks;
  for (const std::string& line : recorded) {
    if (line.starts_with("VERTEX_SE2")) poses.insert(std::stol(line.substr(11)));
  }
  for (const std::string& tag : {std::string("EDGE_SE2 "), seen + " "}) {  // odometry first
    for (const std::string& line : recorded) {
      if (!line.starts_with(tag)) continue;
      std::istringstream words(line);
      std::string word;
      long a = 0, b = 0;
      words >> word >> a >> b;
      const bool observation = !poses.contains(b);
      Lines& told = of_pose[observation ? a : std::max(a, b)];
      if (observation && landmarks.insert(b).second)
        told.push_back("NEW VERTEX_XY " + std::to_string(b));
      told.push_back(line);
    }
  }
  Lines told;
  for (const long pose : poses) {
    const bool first = pose == *poses.begin();
    const std::string line = "VERTEX_SE2 " + std::to_string(pose);
    told.push_back(first ? *std::ranges::find_if(
                               recorded, [&](const auto& r) { return r.starts_with(line + " "); })
                         : "NEW " + line);
    std::ranges::copy(of_pose[pose], std::back_inserter(told));
    told.emplace_back("DONE");
  }
  return told;
}

/// A session as a whole, in parts that each begin from the journal, and the recording.
void compare_live_with_recorded(const TemporaryFolder& folder, const Lines& told,
                                const std::string& policy, const std::string& graph,
                                const std::vector<const char*>& words) {
  const Outcome whole = cairn(online(policy, {"-o", folder.file("whole.g2o")}), {}, joined(told));
  ASSERT_EQ(whole.exit_code, 0) << whole.err;
  for (const char* word : words) EXPECT_THAT(whole.out, HasSubstr(word));
  const Arguments arguments =
      online(policy, {"--journal", folder.file("log"), "-o", folder.file("parts.g2o")});
  for (std::size_t from = 0; from < told.size(); from += 211) {
    const std::size_t end = std::min(from + 211, told.size());
    const Lines part(told.begin() + static_cast<std::ptrdiff_t>(from),
                     told.begin() + static_cast<std::ptrdiff_t>(end));
    ASSERT_EQ(cairn(arguments, {}, joined(part)).exit_code, 0);
  }
  EXPECT_EQ(read_text(folder.file("parts.g2o")), read_text(folder.file("whole.g2o")));
  const Outcome again = cairn({"compact", graph, "--strategy", "fpfl", "--policy", policy,
                               "--quiet", "-o", folder.file("recorded.g2o"), "--json", "-"});
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_TRUE(read_text(folder.file("recorded.g2o")) == read_text(folder.file("whole.g2o")));
}

TEST_F(OnlinePolicy, LandmarksAreRestoredAndTheSameAsRecorded) {
  const std::string graph = folder_.file("landmarks.g2o");
  ASSERT_EQ(cairn({"generate", "landmarks2d:poses=150", "-o", graph}).exit_code, 0);
  compare_live_with_recorded(folder_, told_of(lines(read_text(graph)), "EDGE_SE2_XY"),
                             "compact_pose:range=3,angle=0.8,reuse=true,landmark_gain=0.8", graph,
                             {" ADDED ", " TAKEN ", " UNINFORMATIVE "});
}

TEST_F(OnlinePolicy, BearingsAreRestoredAndTheSameAsRecorded) {
  const std::string graph = folder_.file("bearings.g2o");
  ASSERT_EQ(
      cairn({"generate", "landmarks2d:poses=150,sensor=bearing_range", "-o", graph}).exit_code, 0);
  Lines recorded = lines(read_text(graph));
  const std::string tag = "EDGE_BEARING_RANGE_SE2_XY";
  for (std::string& line : recorded) {
    if (!line.starts_with(tag)) continue;
    std::istringstream words(line);
    std::string word, pose, landmark, bearing, range, information;
    words >> word >> pose >> landmark >> bearing >> range >> information;
    line = tag + ' ' + pose + ' ' + landmark + ' ' + bearing + ' ' + range + ' ' + information +
           " 0 0";
  }
  // One that is seen once, and so is never determined.
  recorded.push_back("VERTEX_XY 9000 1 1");
  recorded.push_back(tag + " 20 9000 0.5 1 400 0 0");
  write_text(graph, joined(recorded));
  const std::string policy = "compact_pose:range=3,angle=0.8,reuse=true,several_views=true";
  const Lines told = told_of(recorded, tag);
  compare_live_with_recorded(folder_, told, policy, graph,
                             {" ADDED ", " TAKEN ", " UNINFORMATIVE ", "LANDMARK 20 9000 WAITING"});
  Arguments loud = online(policy);
  std::erase(loud, "--quiet");
  EXPECT_THAT(cairn(loud, {}, joined(told)).err,
              HasSubstr("of the landmarks that were seen are not in the graph"));
}

TEST_F(OnlinePolicy, AbsoluteMeasurementsAreRestoredAndTheSameAsRecorded) {
  Lines told{"NEW VERTEX_SE2 0"};
  for (int k = 1; k <= 60; ++k) {
    told.push_back("NEW VERTEX_SE2 " + std::to_string(k));
    told.push_back("EDGE_SE2 " + std::to_string(k - 1) + " " + std::to_string(k) +
                   (k % 10 == 0 ? " 1 0 0.7" : " 1 0 0.02") + " 400 0 0 400 0 2500");
    if (k % 6 == 0) {
      told.push_back("EDGE_PRIOR_SE2 " + std::to_string(k) + " " + std::to_string(100 + k) + " " +
                     std::to_string(k * k % 7) + " 0 4 0 0 4 0 0");
    }
    told.push_back("DONE");
  }
  const std::string policy = "compact_pose:range=3,angle=0.8,reuse=true";
  const Outcome whole = cairn(online(policy, {"-o", folder_.file("whole.g2o")}), {}, joined(told));
  ASSERT_EQ(whole.exit_code, 0) << whole.err;
  EXPECT_THAT(whole.out, HasSubstr(" WAITING "));
  EXPECT_THAT(whole.out, HasSubstr(" TAKEN "));
  EXPECT_THAT(whole.out, HasSubstr(" UNINFORMATIVE "));
  const Arguments arguments =
      online(policy, {"--journal", folder_.file("log"), "-o", folder_.file("parts.g2o")});
  for (std::size_t from = 0; from < told.size(); from += 41) {
    const std::size_t end = std::min(from + 41, told.size());
    const Lines part(told.begin() + static_cast<std::ptrdiff_t>(from),
                     told.begin() + static_cast<std::ptrdiff_t>(end));
    ASSERT_EQ(cairn(arguments, {}, joined(part)).exit_code, 0);
  }
  EXPECT_EQ(read_text(folder_.file("parts.g2o")), read_text(folder_.file("whole.g2o")));
  // A recording of it is a graph: poses with a state, and no commands.
  Lines recorded;
  for (const std::string& line : told) {
    if (line.starts_with("NEW VERTEX_SE2 ")) recorded.push_back(line.substr(4) + " 0 0 0");
    if (line.starts_with("EDGE")) recorded.push_back(line);
  }
  write_text(folder_.file("recorded.g2o"), joined(recorded));
  const Outcome again =
      cairn({"compact", "--strategy", "fpfl", folder_.file("recorded.g2o"), "--policy", policy,
             "--registration", "recorded:carry=0", "-o", folder_.file("compact.g2o")});
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_THAT(again.out, HasSubstr("of 10 kept"));
  EXPECT_EQ(read_text(folder_.file("compact.g2o")), read_text(folder_.file("whole.g2o")));
}

TEST_F(OnlinePolicy, TheEndIsNotInTheJournal) {
  const Arguments arguments =
      online(kPolicy, {"--output", "none", "--journal", folder_.file("log")});
  Lines told = square();
  told.push_back("QUIT");
  const Lines answers = lines(cairn(arguments, {}, joined(told)).out);
  ASSERT_FALSE(answers.empty());
  EXPECT_THAT(answers.back(), StartsWith("OK 10 variables 5"));
  EXPECT_THAT(lines(cairn(arguments, {}, "EDGE_SE2 0 4" + kHere + "\nDONE\n").out),
              ElementsAre("RESTORED 9 variables 4 factors 3", StartsWith("LINKED 0 4 "), "KEPT 4",
                          "OK 11 variables 5 factors 5 owed 0"));
}

TEST_F(OnlinePolicy, NothingAcknowledgedIsLost) {
  const std::string graph = generate("manhattan:poses=150");
  const Dialogue whole = drive(graph, online(kPolicy, {"-o", folder_.file("whole.g2o")}));
  const Arguments arguments =
      online(kPolicy, {"--journal", folder_.file("log"), "-o", folder_.file("parts.g2o")});
  std::size_t acknowledged = 0, restored = 0;
  for (int kill = 1; kill <= 6; ++kill) {
    const Outcome killed = cairn_killed(arguments, joined(whole.told, restored), 40 * kill,
                                        std::chrono::microseconds(0));
    for (const std::string& answer : lines(killed.out)) {
      std::size_t number = 0;
      // Asked again, NEXT repeats what is in the journal.
      if (std::sscanf(answer.c_str(), "OK %zu", &number) == 1) acknowledged = number;
    }
    const Outcome asked = cairn(arguments);
    ASSERT_EQ(std::sscanf(asked.out.c_str(), "RESTORED %zu", &restored), 1) << asked.err;
    // The end is not in the journal.
    ASSERT_GE(restored, std::min(acknowledged, whole.told.size() - 1)) << "kill " << kill;
  }
  cairn(arguments, {}, joined(whole.told, restored));
  EXPECT_EQ(read_text(folder_.file("parts.g2o")), read_text(folder_.file("whole.g2o")));
}

TEST_F(OnlinePolicy, RefusesAJournalOfAnotherPolicy) {
  const std::string journal = folder_.file("log");
  cairn(online(kPolicy, {"--journal", journal}), {}, "NEW VERTEX_SE2 0\n");
  const Outcome other = cairn(online(kPolicy + ",gate=0.9", {"--journal", journal}));
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err,
              HasSubstr("policy compact_pose:angle=0.8,range=3,reuse=false, output last"));
  EXPECT_THAT(other.out, IsEmpty());
}

}  // namespace
}  // namespace cairn::test
