// SPDX-License-Identifier: BSD-3-Clause
// cairn online --policy: a front end talks to it, and what comes out is what cairn compact makes of
// the recording.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <map>
#include <set>
#include <sstream>

#include "cairn/plugin/registry.hpp"
#include "integration/process.hpp"

namespace cairn::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using testing::StartsWith;

using Lines = std::vector<std::string>;

const std::string kSource = CAIRN_SOURCE_FOLDER;
const std::string kPolicy = "compact_pose:range=3,angle=0.8,reuse=false";
const std::string kStep = " 1 0 1.5 100 0 0 100 0 100";  // motion and information
const std::string kHere = " 0 0 0 900 0 0 900 0 900";

Arguments online(const std::string& policy, Arguments more = {}) {
  Arguments arguments{"online", "--policy", policy, "--quiet"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

std::string joined(const Lines& lines, std::size_t from = 0) {
  std::string text;
  for (std::size_t k = from; k < lines.size(); ++k) text += lines[k] + "\n";
  return text;
}

Lines words(const std::string& line) {
  std::istringstream stream(line);
  Lines all;
  for (std::string word; stream >> word;) all.push_back(word);
  return all;
}

bool ends_answer(const std::string& line) {
  return line.starts_with("OK ") || line.starts_with("ERROR ");
}

// The front end -----------------------------------------------------------------------------------

/// A recording, as a front end remembers what its sensors have seen.
class Recording {
 public:
  explicit Recording(const std::string& file) {
    for (const std::string& line : lines(read_text(file))) {
      const Lines fields = words(line);
      if (line.starts_with("VERTEX")) poses_[std::stol(fields[1])] = line;
      if (line.starts_with("EDGE"))
        measured_[pair(std::stol(fields[1]), std::stol(fields[2]))].push_back(line);
      if (line.starts_with("FIX")) fixed_.insert(std::stol(fields[1]));
    }
  }
  const std::map<long, std::string>& poses() const { return poses_; }
  bool fixed(long pose) const { return fixed_.contains(pose); }
  Lines match(long a, long b) const {
    const auto there = measured_.find(pair(a, b));
    return there == measured_.end() ? Lines() : there->second;
  }

 private:
  static std::pair<long, long> pair(long a, long b) { return std::minmax(a, b); }
  std::map<long, std::string> poses_;
  std::map<std::pair<long, long>, Lines> measured_;
  std::set<long> fixed_;
};

/// What was said by one, and what was heard by the other.
struct Dialogue {
  Lines told;
  Lines heard;

  std::int64_t count(const std::string& first_word) const {
    return std::ranges::count_if(
        heard, [&](const std::string& line) { return words(line)[0] == first_word; });
  }
  std::set<long> kept() const {
    std::set<long> poses;
    for (const std::string& line : heard) {
      if (line.starts_with("KEPT ")) poses.insert(std::stol(words(line)[1]));
    }
    return poses;
  }
};

/// Drives cairn through a recording; `at_each_pose` may have more to say before its end.
class FrontEnd {
 public:
  using More = std::function<Lines(long pose)>;

  FrontEnd(const Recording& recording, Partner& partner, More at_each_pose = {})
      : recording_(recording), partner_(partner), more_(std::move(at_each_pose)) {}

  Dialogue drive() {
    long before = -1;
    for (const auto& [pose, line] : recording_.poses()) {
      tell(line);
      if (recording_.fixed(pose)) tell("FIX " + std::to_string(pose));
      for (const std::string& motion : recording_.match(before, pose)) tell(motion);
      while (match_one()) {
      }
      if (more_) {
        for (const std::string& question : more_(pose)) ask(question);
      }
      const Lines answer = ask("DONE");
      if (answer.empty() || !answer.back().starts_with("OK ")) break;
      before = pose;
    }
    ask("QUIT");
    return std::move(dialogue_);
  }

 private:
  void tell(const std::string& line) {
    dialogue_.told.push_back(line);
    partner_.tell(line);
  }

  Lines ask(const std::string& line) {
    tell(line);
    Lines answer;
    while (answer.empty() || !ends_answer(answer.back())) {
      const std::optional<std::string> heard = partner_.hear();
      if (!heard) {
        ADD_FAILURE() << "no answer to " << line;
        break;
      }
      answer.push_back(*heard);
    }
    dialogue_.heard.insert(dialogue_.heard.end(), answer.begin(), answer.end());
    return answer;
  }

  bool match_one() {
    const Lines answer = ask("NEXT");
    if (answer.size() < 2) return false;
    const Lines match = words(answer[answer.size() - 2]);
    if (match[0] != "MATCH" || match[1] == "NONE") return false;
    const Lines measured = recording_.match(std::stol(match[1]), std::stol(match[2]));
    for (const std::string& line : measured) tell(line);
    if (measured.empty()) tell("NOMATCH " + match[1] + " " + match[2]);
    return true;
  }

  const Recording& recording_;
  Partner& partner_;
  More more_;
  Dialogue dialogue_;
};

class OnlinePolicy : public testing::Test {
 protected:
  void SetUp() override {
    const Registry registry;
    if (!registry.has("pose_policy", "compact_pose") || !registry.has("registration", "recorded") ||
        !registry.has("estimator", "incremental_cholesky"))
      GTEST_SKIP() << "compact_pose, or what it needs, is missing";
  }

  std::string generate(const std::string& kind) {
    std::string file = folder_.file("graph.g2o");
    const Outcome made = cairn({"generate", kind, "-o", file, "--seed", "3", "--quiet"});
    EXPECT_EQ(made.exit_code, 0) << made.err;
    return file;
  }

  Dialogue drive(const std::string& graph, const Arguments& arguments, FrontEnd::More more = {}) {
    Partner partner(arguments);
    Dialogue dialogue = FrontEnd(Recording(graph), partner, std::move(more)).drive();
    const Outcome end = partner.end();
    EXPECT_EQ(end.exit_code, 0) << end.err;
    EXPECT_EQ(end.out, "");
    return dialogue;
  }

  TemporaryFolder folder_;
};

// The same as from a recording --------------------------------------------------------------------

struct Way {
  std::string name, generator, policy;
};
void PrintTo(const Way& way, std::ostream* out) { *out << way.generator << ", " << way.policy; }

class OnlinePolicyWay : public OnlinePolicy, public testing::WithParamInterface<Way> {};

TEST_P(OnlinePolicyWay, EndsWithTheGraphThatCompactMakesOfTheRecording) {
  const std::string graph = generate(GetParam().generator), policy = GetParam().policy;
  const boost::json::value report = report_of(
      {"compact", graph, "--policy", policy, "-o", folder_.file("recorded.g2o"), "--quiet"});
  const Dialogue dialogue = drive(graph, online(policy, {"-o", folder_.file("live.g2o")}));
  EXPECT_EQ(read_text(folder_.file("live.g2o")), read_text(folder_.file("recorded.g2o")));

  const auto& loops = report.at("loops");
  ASSERT_GT(loops.at("kept").as_int64(), 0) << "a poor example";
  EXPECT_EQ(dialogue.count("LINKED"), loops.at("kept").as_int64());
  EXPECT_EQ(dialogue.count("MATCH") - std::ssize(Recording(graph).poses()),
            loops.at("proposed").as_int64());  // at each pose the last is MATCH NONE
  EXPECT_EQ(std::ssize(dialogue.kept()), report.at("poses").at("kept").as_int64());
  const auto verdicts = report.at("verdicts").as_object();
  for (const auto& [verdict, word] :
       std::map<std::string, std::string>{{"linked", "LINKED"},
                                          {"uninformative", "UNINFORMATIVE"},
                                          {"inconsistent", "INCONSISTENT"},
                                          {"waiting", "WAITING"}}) {
    const std::int64_t told = verdicts.contains(verdict) ? verdicts.at(verdict).as_int64() : 0;
    EXPECT_EQ(dialogue.count(word), told) << verdict;
  }
  const std::string size = "variables " + std::to_string(dialogue.kept().size()) + " factors ";
  EXPECT_THAT(dialogue.heard.back(), HasSubstr(size));
  const std::string file = read_text(folder_.file("live.g2o"));
  EXPECT_THAT(dialogue.heard.back(),
              HasSubstr("factors " +
                        std::to_string(std::ranges::count_if(
                            lines(file),
                            [](const std::string& line) { return line.starts_with("EDGE"); })) +
                        " owed"));
}

INSTANTIATE_TEST_SUITE_P(
    All, OnlinePolicyWay,
    testing::Values(Way{"Few", "manhattan:poses=400", kPolicy},
                    Way{"Gated", "manhattan:poses=400", kPolicy + ",gate=0.9"},
                    Way{"SpaceWithBatch", "sphere:turns=8,poses_per_turn=20,radius=5",
                        "compact_pose:range=8,angle=2,strategy=fpfl,estimator=batch"}),
    [](const auto& named) { return named.param.name; });

TEST_F(OnlinePolicy, SeveralMeasurementsOfAPairAndHeldPosesAreTakenAsInAFile) {
  const std::string graph = generate("manhattan:poses=300");
  // Every third motion was measured twice, once backwards, and two poses are known.
  std::string more = read_text(graph);
  int count = 0;
  for (const std::string& line : lines(read_text(graph))) {
    Lines fields = words(line);
    if (fields[0] != "EDGE_SE2" || ++count % 3 != 0) continue;
    std::swap(fields[1], fields[2]);
    const double x = std::stod(fields[3]), y = std::stod(fields[4]), turn = std::stod(fields[5]);
    std::ostringstream back;
    back.precision(17);
    back << "EDGE_SE2 " << fields[1] << ' ' << fields[2] << ' '
         << -std::cos(turn) * x - std::sin(turn) * y + 0.01 << ' '
         << std::sin(turn) * x - std::cos(turn) * y << ' ' << -turn << " 50 0 0 50 0 50\n";
    more += back.str();
  }
  write_text(graph, more + "FIX 0\nFIX 120\n");
  const boost::json::value report = report_of(
      {"compact", graph, "--policy", kPolicy, "-o", folder_.file("recorded.g2o"), "--quiet"});
  const Dialogue dialogue = drive(graph, online(kPolicy, {"-o", folder_.file("live.g2o")}));
  EXPECT_GT(report.at("loops").at("kept").as_int64(), 0);
  EXPECT_EQ(read_text(folder_.file("live.g2o")), read_text(folder_.file("recorded.g2o")));
  EXPECT_THAT(read_text(folder_.file("live.g2o")), HasSubstr("FIX 120"));
}

TEST_F(OnlinePolicy, TheExampleInPythonDoesTheSame) {
  if (run_program({"python3", "--version"}).exit_code != 0) GTEST_SKIP() << "there is no python3";
  const std::string graph = generate("manhattan:poses=150");
  const boost::json::value report = report_of(
      {"compact", graph, "--policy", kPolicy, "-o", folder_.file("recorded.g2o"), "--quiet"});
  const Outcome run =
      run_program({"python3", kSource + "/examples/live_front_end.py", graph, "-o",
                   folder_.file("live.g2o"), "--policy", kPolicy, "--cairn", program()});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(read_text(folder_.file("live.g2o")), read_text(folder_.file("recorded.g2o")));
  EXPECT_THAT(
      run.out,
      StartsWith(std::to_string(report.at("poses").at("kept").as_int64()) + " of 150 poses kept, " +
                 std::to_string(report.at("loops").at("kept").as_int64()) + " loop"));
}

// The protocol ------------------------------------------------------------------------------------

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
  const std::string page = read_text(kSource + "/docs/online.md");
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
  const Outcome run = cairn(online("compact_pose:range=3,angle=0.5"), {}, joined(told));
  const Lines answers = lines(run.out);
  ASSERT_THAT(answers, SizeIs(expected.size())) << run.out;
  for (std::size_t k = 0; k < expected.size(); ++k) expect_alike(answers[k], expected[k]);
}

/// Once round a square: pose 4 is where pose 0 was.
Lines square() {
  Lines told{"NEW VERTEX_SE2 0"};
  for (int k = 1; k <= 4; ++k) {
    told.push_back("NEW VERTEX_SE2 " + std::to_string(k));
    told.push_back("EDGE_SE2 " + std::to_string(k - 1) + " " + std::to_string(k) + kStep);
  }
  return told;
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
      ElementsAre(
          "KEPT 0", StartsWith("OK 2 variables 1 "), "KEPT 1", StartsWith("OK 4 variables 2 "),
          "DROPPED 2", StartsWith("OK 6 variables 2 "), StartsWith("VERTEX_SE2 2 1.00707"),
          StartsWith("OK 7 variables 2 "), "ERROR line 8: there is no pose 2 in the compact graph",
          StartsWith("VERTEX_SE2 2 1.00707"), StartsWith("OK 10 variables 2 "),
          StartsWith("ERROR line 12: there is no estimate of 2; expected a pose that was "
                     "kept"),
          "KEPT 3", StartsWith("OK 13 variables 3 "),
          StartsWith("ERROR line 16: pose 2 was not kept"),
          StartsWith("ERROR line 17: VERTEX_SE2 2: the id is already in use"),
          StartsWith("VERTEX_SE2 0 "), StartsWith("VERTEX_SE2 1 "), StartsWith("VERTEX_SE2 3 "),
          StartsWith("VERTEX_SE2 4 "), StartsWith("OK 18 variables 3 factors 2 ")))
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

// Errors ------------------------------------------------------------------------------------------

TEST_F(OnlinePolicy, ABadLineIsToldAndNothingOfItStays) {
  const std::string graph = generate("manhattan:poses=120");
  drive(graph, online(kPolicy, {"-o", folder_.file("good.g2o")}));
  const Lines bad{"REMOVE FACTOR 0",
                  "REMOVE VARIABLE 0",
                  "CHANGE 0 1 0 0",
                  "MARGINALIZE 0",
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
                  "EDGE_PRIOR_SE2 0 0 0 0 1 0 0 1 0 1",
                  "VERTEX_SE2 0 0 0 0",
                  "VERTEX_XY 88888 0 0",
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
  EXPECT_EQ(error(two, "NEW VERTEX_TRACKXYZ 1"),
            "VERTEX_TRACKXYZ 1 is no pose; with a policy a robot's poses alone can come");
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

// The journal -------------------------------------------------------------------------------------

/// Questions that read the estimator, which hands over what had been held back.
Lines questions(long pose) {
  if (pose % 9 == 4) return {"ESTIMATE ALL"};
  if (pose % 9 == 6) return {"COVARIANCE 0 0", "NEXT"};
  if (pose % 25 == 8) return {"SAVE nowhere/at/all.g2o"};  // fails after it was read
  return {};
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

TEST_F(OnlinePolicy, TheEndIsNotInTheJournal) {
  const Arguments arguments =
      online(kPolicy, {"--output", "none", "--journal", folder_.file("log")});
  Lines told = square();
  told.push_back("QUIT");
  EXPECT_THAT(lines(cairn(arguments, {}, joined(told)).out).back(),
              StartsWith("OK 10 variables 5"));
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

TEST_F(OnlinePolicy, ReportsWhatWasKept) {
  const std::string graph = generate("manhattan:poses=200"), json = folder_.file("run.json");
  const Dialogue dialogue = drive(graph, online(kPolicy, {"--json", json}));
  const boost::json::value report = parse_json(read_text(json));
  EXPECT_EQ(report.at("policy").as_string(), kPolicy.c_str());
  EXPECT_EQ(report.at("poses").at("in").as_int64(), 200);
  EXPECT_EQ(report.at("poses").at("kept").as_int64(), std::ssize(dialogue.kept()));
  EXPECT_EQ(report.at("loops").at("kept").as_int64(), dialogue.count("LINKED"));
  EXPECT_EQ(report.at("loops").at("proposed").as_int64(), dialogue.count("MATCH") - 200);
}

TEST(OnlineHelp, FitsAScreen) {
  const Lines help = lines(cairn({"online", "--help"}).out);
  EXPECT_LE(help.size(), 40U);
  for (const std::string& line : help) EXPECT_LE(line.size(), 100U) << line;
}

}  // namespace
}  // namespace cairn::test
