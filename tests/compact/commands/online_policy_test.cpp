// SPDX-License-Identifier: BSD-3-Clause
// cairn online --policy: a front end talks to it, and what comes out is what cairn compact makes of
// the recording.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <ostream>
#include <sstream>
#include <string>
#include <utility>

#include <boost/json/value.hpp>

#include "integration/front_end.hpp"
#include "integration/process.hpp"

namespace cairn::test {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

/// As the front end that answers here: it has no other pair that would do.
const std::string kRecorded = "recorded:carry=0";

struct Way {
  std::string name, generator, policy;
};
void PrintTo(const Way& way, std::ostream* out) { *out << way.generator << ", " << way.policy; }

class OnlinePolicyWay : public OnlinePolicy, public testing::WithParamInterface<Way> {};

TEST_P(OnlinePolicyWay, EndsWithTheGraphThatCompactMakesOfTheRecording) {
  const std::string graph = generate(GetParam().generator), policy = GetParam().policy;
  const boost::json::value report =
      report_of({"compact", graph, "--strategy", "fpfl", "--policy", policy, "--registration",
                 kRecorded, "-o", folder_.file("recorded.g2o"), "--quiet"});
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
  const boost::json::value report =
      report_of({"compact", graph, "--strategy", "fpfl", "--policy", kPolicy, "--registration",
                 kRecorded, "-o", folder_.file("recorded.g2o"), "--quiet"});
  const Dialogue dialogue = drive(graph, online(kPolicy, {"-o", folder_.file("live.g2o")}));
  EXPECT_GT(report.at("loops").at("kept").as_int64(), 0);
  EXPECT_EQ(read_text(folder_.file("live.g2o")), read_text(folder_.file("recorded.g2o")));
  EXPECT_THAT(read_text(folder_.file("live.g2o")), HasSubstr("FIX 120"));
}

TEST_F(OnlinePolicy, TheExampleInPythonDoesTheSame) {
  if (run_program({"python3", "--version"}).exit_code != 0) GTEST_SKIP() << "there is no python3";
  const std::string graph = generate("manhattan:poses=150");
  const boost::json::value report =
      report_of({"compact", graph, "--strategy", "fpfl", "--policy", kPolicy, "--registration",
                 kRecorded, "-o", folder_.file("recorded.g2o"), "--quiet"});
  const Outcome run =
      run_program({"python3", source_folder() + "/examples/live_front_end.py", graph, "-o",
                   folder_.file("live.g2o"), "--policy", kPolicy, "--cairn", program()});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(read_text(folder_.file("live.g2o")), read_text(folder_.file("recorded.g2o")));
  EXPECT_THAT(
      run.out,
      StartsWith(std::to_string(report.at("poses").at("kept").as_int64()) + " of 150 poses kept, " +
                 std::to_string(report.at("loops").at("kept").as_int64()) + " loop"));
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

TEST_F(OnlinePolicy, EndsWithWhatWouldHelpWhereEveryPoseIsKept) {
  const std::string graph = generate("manhattan:poses=100");
  const std::string all = kPolicy + ",loop_gain=8,pose_gain=0.5";
  const Dialogue dialogue = drive(graph, online(all));
  EXPECT_GT(dialogue.kept().size(), 90U);
  const std::string heard = joined(dialogue.heard), advice = "; pose_gain=";
  const std::size_t at = heard.find(advice);
  ASSERT_NE(at, std::string::npos) << heard;
  EXPECT_THAT(heard, HasSubstr("NOTE 100 % of the poses are kept: "));
  const std::string gain = words(heard.substr(at + advice.size())).front();
  const Dialogue fewer = drive(graph, online(kPolicy + ",loop_gain=8,pose_gain=" + gain));
  EXPECT_LT(fewer.kept().size(), 60U);
  EXPECT_EQ(joined(fewer.heard).find("of the poses are kept"), std::string::npos);
}

TEST(OnlineHelp, FitsAScreen) {
  const Lines help = lines(cairn({"online", "--help"}).out);
  EXPECT_LE(help.size(), 40U);
  for (const std::string& line : help) EXPECT_LE(line.size(), 100U) << line;
}

}  // namespace
}  // namespace cairn::test
