// SPDX-License-Identifier: BSD-3-Clause
// cairn compact GRAPH.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <sstream>
#include <string>

#include <fmt/core.h>

#include "cairn/plugin/registry.hpp"
#include "integration/process.hpp"

namespace cairn::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::SizeIs;
using testing::StartsWith;

const std::string kWorld = "@manhattan:poses=300,streets=5";

class Compact : public testing::Test {
 protected:
  void SetUp() override {
    if (!Registry().has("pose_policy", "compact_pose")) GTEST_SKIP() << "no policy compact_pose";
  }
  boost::json::value report(Arguments arguments, const Arguments& command = {"compact"}) {
    arguments.insert(arguments.begin(), command.begin(), command.end());
    arguments.insert(arguments.end(), {"--json", "-", "--quiet"});
    const Outcome run = cairn(arguments);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return parse_json(run.out);
  }
  boost::json::value study(Arguments arguments) {
    return report(std::move(arguments), {"study", "compact"});
  }
  TemporaryFolder folder_;
};

std::int64_t whole(const boost::json::value& report, const char* group, const char* name) {
  return report.at(group).at(name).as_int64();
}

double ate(const boost::json::value& report, const char* recovery) {
  return report.at("errors").at(recovery).at("ate").at("translation").as_double();
}

/// Rows of a table are wrapped.
std::string on_one_line(const std::string& text) {
  std::istringstream words(text);
  std::string line;
  for (std::string word; words >> word;) line += (line.empty() ? "" : " ") + word;
  return line;
}

TEST_F(Compact, LeadsFromAGraphToACompactOneTheWholeWayAndAReport) {
  const std::string in = folder_.file("in.g2o"), truth = folder_.file("truth.g2o"),
                    out = folder_.file("out.g2o"), way = folder_.file("way.g2o"),
                    json = folder_.file("report.json"), steps = folder_.file("steps.csv");
  ASSERT_EQ(cairn({"generate", "manhattan:poses=300,streets=5", "-o", in, "--ground-truth", truth})
                .exit_code,
            0);
  const Outcome run = cairn({"compact", in, "-o", out, "--trajectory", way, "--json", json,
                             "--steps", steps, "--truth", truth, "--quiet"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, AllOf(HasSubstr("thresholds"), HasSubstr("poses"), HasSubstr("loops"),
                             HasSubstr("NEES"), HasSubstr(out), HasSubstr(way)));
  const boost::json::value told = parse_json(read_text(json));
  EXPECT_EQ(whole(told, "poses", "in"), 300);
  const std::int64_t kept = whole(told, "poses", "kept");
  EXPECT_LT(kept, 280);
  EXPECT_EQ(told.at("strategy").as_string(), "whole");
  EXPECT_GT(whole(told, "loops", "kept"), 0);
  EXPECT_EQ(whole(told, "loops", "kept"), whole(told, "loops", "in"));
  EXPECT_LT(ate(told, "whole"), 0.2);
  EXPECT_DOUBLE_EQ(told.at("rmse").as_double(), ate(told, "whole"));
  EXPECT_THAT(lines(read_text(steps)), SizeIs(301));

  const boost::json::value compact = parse_json(cairn({"info", out, "--json", "-"}).out);
  EXPECT_EQ(whole(compact, "graph", "variables"), kept);
  // The whole way has every pose once, and is what the errors are of.
  const boost::json::value evaluated =
      parse_json(cairn({"evaluate", way, truth, "--json", "-"}).out);
  EXPECT_EQ(whole(evaluated, "poses", "compared"), 300);
  EXPECT_NEAR(evaluated.at("ate").at("translation").as_double(), ate(told, "whole"), 1e-9);
}

/// Where the estimate of all measurements is another program's path to it, and so is that of the
/// compact file.
TEST_F(Compact, TheWholeMapIsTheEstimateOfAllMeasurements) {
  for (const char* world : {"manhattan:poses=600,streets=5", "ellipse3d:poses=200"}) {
    const std::string in = folder_.file("in.g2o"), out = folder_.file("out.g2o"),
                      way = folder_.file("way.g2o"), all = folder_.file("all.g2o"),
                      alone = folder_.file("alone.g2o");
    ASSERT_EQ(cairn({"generate", world, "-o", in}).exit_code, 0);
    const boost::json::value told = report({in, "-o", out, "--trajectory", way});
    ASSERT_EQ(cairn({"optimize", in, "-o", all, "--optimizer", "dogleg"}).exit_code, 0);
    ASSERT_EQ(cairn({"optimize", out, "-o", alone}).exit_code, 0);
    const auto distance = [&](const std::string& file) {
      return parse_json(cairn({"evaluate", file, all, "--json", "-"}).out)
          .at("ate")
          .at("translation")
          .to_number<double>();
    };
    EXPECT_LT(distance(way), 1e-5) << world;
    const double extent = told.at("check").at("extent").as_double();
    EXPECT_NEAR(distance(alone), told.at("check").at("distance").as_double(), 1e-4) << world;
    EXPECT_LT(distance(alone), 0.005 * extent) << world;
    EXPECT_LT(whole(told, "poses", "kept"), 0.7 * whole(told, "poses", "in")) << world;
    EXPECT_GE(told.at("whole").at("kld").as_double(), 0.0);
    EXPECT_EQ(
        told.at("whole").at("factors").at("out").as_int64(),
        parse_json(cairn({"info", out, "--json", "-"}).out).at("graph").at("factors").as_int64());
    // The robot's own way has a larger error.
    const boost::json::value robot = report({in, "--strategy", "fpfl", "-o", out});
    EXPECT_GT(robot.at("check").at("distance").as_double(),
              told.at("check").at("distance").as_double())
        << world;
    EXPECT_TRUE(robot.at("whole").is_null());
  }
}

TEST_F(Compact, ARecordingWithAGapInItsOdometryIsTaken) {
  const std::string in = folder_.file("in.g2o"), way = folder_.file("way.g2o"),
                    all = folder_.file("all.g2o");
  ASSERT_EQ(cairn({"generate", "manhattan:poses=300,streets=5", "-o", in}).exit_code, 0);
  std::string without;
  for (const std::string& line : lines(read_text(in)))
    if (!line.starts_with("EDGE_SE2 99 100 ")) without += line + '\n';
  write_text(in, without);
  const Outcome run = cairn({"compact", in, "--trajectory", way});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(on_one_line(run.err), HasSubstr("no factor joins pose 99 to pose 100"));
  ASSERT_EQ(cairn({"optimize", in, "-o", all}).exit_code, 0);
  const boost::json::value apart = parse_json(cairn({"evaluate", way, all, "--json", "-"}).out);
  EXPECT_LT(apart.at("ate").at("translation").to_number<double>(), 1e-6);
}

TEST_F(Compact, LeavesWrongLoopClosuresOut) {
  const std::string truth = folder_.file("truth.g2o"), in = folder_.file("in.g2o"),
                    json = folder_.file("report.json");
  const auto error = [&](const std::string& world) {
    EXPECT_EQ(cairn({"generate", world, "-o", in, "--ground-truth", truth}).exit_code, 0);
    const Outcome run = cairn({"compact", in, "--truth", truth, "--json", json});
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return std::pair(parse_json(read_text(json)), on_one_line(run.err));
  };
  const auto [right, quiet] = error("manhattan:poses=300,streets=5");
  const auto [wrong, note] = error("manhattan:poses=300,streets=5,outliers=20");
  EXPECT_THAT(quiet, Not(HasSubstr("left out")));
  EXPECT_THAT(note, HasSubstr("20 of 240 loop closures contradict the others and are left out"));
  EXPECT_EQ(whole(wrong, "loops", "in"), 240);
  EXPECT_EQ(whole(wrong, "loops", "kept"), 220);
  ASSERT_THAT(wrong.at("left_out").as_array(), SizeIs(20));
  EXPECT_THAT(wrong.at("left_out").at(0).as_array(), SizeIs(2));
  EXPECT_THAT(right.at("left_out").as_array(), SizeIs(0));
  EXPECT_EQ(wrong.at("poses"), right.at("poses"));
  EXPECT_NEAR(ate(wrong, "whole"), ate(right, "whole"), 1e-6);
}

/// Files have no losses: what is written has the weights in its information.
TEST_F(Compact, AWholeMapWithALossIsThatOfTheFile) {
  const std::string in = folder_.file("in.g2o"), out = folder_.file("out.g2o"),
                    way = folder_.file("way.g2o"), alone = folder_.file("alone.g2o");
  ASSERT_EQ(cairn({"generate", "manhattan:poses=300,streets=5,outliers=30", "-o", in}).exit_code,
            0);
  const boost::json::value told =
      report({in, "--loss", "cauchy", "--loss-on", "loops", "-o", out, "--trajectory", way});
  EXPECT_EQ(told.at("strategy").as_string(), "whole");
  ASSERT_EQ(cairn({"optimize", out, "--initial", "as_given", "-o", alone}).exit_code, 0);
  const boost::json::value apart = parse_json(cairn({"evaluate", alone, way, "--json", "-"}).out);
  EXPECT_LT(apart.at("ate").at("translation").to_number<double>(), 1e-5);
}

TEST_F(Compact, ThereIsNoWholeMapWhereMostLoopClosuresAreWrong) {
  const std::string world = "@manhattan:poses=200,streets=5,outliers=400";
  const Outcome run = cairn({"compact", world, "--json", folder_.file("report.json")});
  EXPECT_THAT(on_one_line(run.err),
              HasSubstr("the map is that of strategy fpfl: measurements contradict each other"));
  EXPECT_EQ(parse_json(read_text(folder_.file("report.json"))).at("strategy").as_string(), "fpfl");
}

TEST_F(Compact, SaysWhyThereIsNoWholeMap) {
  const auto message = [](const Arguments& more) {
    Arguments command{"compact", "--strategy", "whole", "--range", "4"};
    command.insert(command.end(), more.begin(), more.end());
    const Outcome run = cairn(command);
    EXPECT_EQ(run.exit_code, 2) << run.err;
    return on_one_line(run.err);
  };
  EXPECT_THAT(message({kWorld, "--registration", "recorded:false_rate=0.1"}),
              HasSubstr("strategy whole: what matches is not what was recorded"));
  EXPECT_THAT(message({kWorld, "--policy", "random_poses:poses=10"}),
              HasSubstr("policy 'random_poses' has no strategies"));
  EXPECT_THAT(message({kWorld, "--policy", "compact_pose:strategy=apfl"}), HasSubstr("give one"));
}

TEST_F(Compact, KeepsEverythingThatTheStrategySaysSo) {
  const boost::json::value all = report(
      {kWorld, "--strategy", "apal", "--policy", "compact_pose:search=untested", "--range", "5"});
  EXPECT_EQ(whole(all, "poses", "kept"), 300);
  EXPECT_EQ(whole(all, "loops", "kept"), whole(all, "loops", "registered"));
  EXPECT_GT(whole(all, "loops", "kept"), 200);
  const boost::json::value few =
      report({kWorld, "--strategy", "fpfl", "--range", "5", "--angle", "3"});
  EXPECT_LT(whole(few, "poses", "kept"), 250);
  EXPECT_LT(whole(few, "nonzeros", "factor"), whole(all, "nonzeros", "factor"));
}

TEST_F(Compact, TheControlHasTheSizeOfWhatItIsComparedWith) {
  const boost::json::value control =
      study({kWorld, "--strategy", "rfpfl", "--range", "5", "--angle", "3", "--seed", "3"});
  EXPECT_EQ(control.at("strategy").as_string(), "rfpfl");
  EXPECT_EQ(whole(control, "poses", "kept"), whole(control.at("like"), "poses", "kept"));
  EXPECT_EQ(whole(control, "loops", "kept"), whole(control.at("like"), "loops", "kept"));
  EXPECT_NE(ate(control, "v2"), ate(control.at("like"), "v2"));
}

TEST_F(Compact, TheControlDrawsPosesFirstIfAskedTo) {
  const boost::json::value loops =
      study({kWorld, "--strategy", "rfpfl", "--range", "5", "--angle", "3", "--seed", "3"});
  const boost::json::value poses = study({kWorld, "--strategy", "rfpfl", "--range", "5", "--angle",
                                          "3", "--seed", "3", "--draw", "poses"});
  EXPECT_EQ(whole(poses, "poses", "kept"), whole(loops, "poses", "kept"));
  EXPECT_LE(whole(poses, "loops", "kept"), whole(loops, "loops", "kept"));
  EXPECT_NE(ate(poses, "v2"), ate(loops, "v2"));
}

TEST_F(Compact, ThresholdsAreFoundSavedAndRead) {
  const std::string file = folder_.file("thresholds.json");
  const boost::json::value found =
      study({kWorld, "--auto", "--save-thresholds", file, "--error-ratio", "0"});
  const boost::json::value saved = parse_json(read_text(file));
  EXPECT_EQ(saved.at("policy").as_string(), "compact_pose");
  EXPECT_EQ(saved.at("options"), found.at("thresholds").at("options"));
  const boost::json::value again = study({kWorld, "--thresholds", file});
  EXPECT_EQ(again.at("poses"), found.at("poses"));
  EXPECT_EQ(again.at("loops"), found.at("loops"));
  EXPECT_EQ(again.at("errors"), found.at("errors"));
  // The command line goes before the file.
  const boost::json::value stricter = study({kWorld, "--thresholds", file, "--loop-gain", "1000"});
  EXPECT_EQ(whole(stricter, "loops", "kept"), 0);
}

TEST_F(Compact, HasNoScansForARegistrationOfScans) {
  if (cairn({"plugins", "icp"}).exit_code != 0) GTEST_SKIP() << "there is no registration icp";
  for (const Arguments& more : {Arguments{}, Arguments{"--range", "3"}}) {
    Arguments command{"compact", kWorld, "--registration", "icp"};
    command.insert(command.end(), more.begin(), more.end());
    const Outcome run = cairn(command);
    EXPECT_EQ(run.exit_code, 2) << run.err;
    EXPECT_THAT(on_one_line(run.err), HasSubstr("matches laser scans, and a graph has none"));
  }
}

TEST_F(Compact, NotesThresholdsOfAMuchShorterRecording) {
  const auto noted = [](const Arguments& more) {
    Arguments command{"compact", kWorld, "--strategy", "fpfl"};
    command.insert(command.end(), more.begin(), more.end());
    const Outcome run = cairn(command);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return on_one_line(run.err).find("poses, and this recording has 300") != std::string::npos;
  };
  const std::string file = folder_.file("robot.json"), again = folder_.file("again.json");
  EXPECT_FALSE(noted({"--save-thresholds", file}));
  EXPECT_EQ(parse_json(read_text(file)).at("poses").as_int64(), 180);
  EXPECT_FALSE(noted({"--thresholds", file}));
  EXPECT_TRUE(noted({"--sample", "0.4", "--save-thresholds", file}));
  EXPECT_TRUE(noted({"--thresholds", file, "--save-thresholds", again}));
  EXPECT_TRUE(noted({"--thresholds", again}));
  // Some are the user's own.
  EXPECT_FALSE(noted({"--thresholds", file, "--loop-gain", "1"}));
  EXPECT_TRUE(noted({"--thresholds", file, "--range", "4", "--save-thresholds", again}));
  EXPECT_FALSE(parse_json(read_text(again)).as_object().contains("poses"));
}

TEST_F(Compact, RefusesThresholdsOfNoNumberOfPoses) {
  const std::string file = folder_.file("robot.json");
  for (const char* poses : {"-1", "\"many\"", "1e30", "18446744073709551615", "null"}) {
    write_text(file,
               R"({"policy":"compact_pose","options":{},"poses":)" + std::string(poses) + "}");
    const Outcome run = cairn({"compact", kWorld, "--thresholds", file});
    EXPECT_EQ(run.exit_code, 3) << poses;
    EXPECT_THAT(run.err, HasSubstr("poses is"));
  }
  write_text(file, R"({"policy":"compact_pose","options":{},"poses":9223372036854775807})");
  EXPECT_EQ(cairn({"compact", kWorld, "--thresholds", file}).exit_code, 0);
}

TEST_F(Compact, ReportsTheThresholdsOfTheRunWhateverWasFound) {
  const std::string file = folder_.file("robot.json"), json = folder_.file("report.json");
  report({kWorld, "--save-thresholds", file});
  const std::string found(parse_json(read_text(file)).at("options").at("range").as_string());
  ASSERT_NE(found, "4");
  for (const Arguments& others : {Arguments{"--thresholds", file}, Arguments{"--auto"}}) {
    const std::string saved = folder_.file("saved.json");
    Arguments command{"compact", kWorld, "--strategy",        "fpfl", "--range", "4",
                      "--json",  json,   "--save-thresholds", saved};
    command.insert(command.end(), others.begin(), others.end());
    const Outcome run = cairn(command);
    ASSERT_EQ(run.exit_code, 0) << run.err;
    EXPECT_THAT(on_one_line(run.out), HasSubstr("range 4 (given)"));
    EXPECT_THAT(run.err, Not(HasSubstr("--auto")));
    const boost::json::value thresholds = parse_json(read_text(json)).at("thresholds");
    EXPECT_EQ(thresholds.at("options").at("range").as_string(), "4");
    EXPECT_EQ(thresholds.at("given"), parse_json(R"(["range"])"));
    EXPECT_FALSE(thresholds.at("defaults").as_object().contains("angle"));
    // With what is saved the run is the same.
    EXPECT_EQ(parse_json(read_text(saved)).at("options"), thresholds.at("options"));
    EXPECT_EQ(report({kWorld, "--thresholds", saved, "--strategy", "fpfl"}).at("errors"),
              parse_json(read_text(json)).at("errors"));
  }
}

TEST_F(Compact, SaysWhichThresholdsAreDefaultsWhereOneIsGiven) {
  const std::string json = folder_.file("report.json");
  const Outcome one = cairn({"compact", kWorld, "--loop-gain", "1", "--json", json});
  EXPECT_EQ(one.exit_code, 0) << one.err;
  EXPECT_THAT(on_one_line(one.out),
              AllOf(HasSubstr(" thresholds angle "), HasSubstr("loop_gain 1 (given)"),
                    testing::ContainsRegex("range [0-9.]+ \\(default\\)")));
  EXPECT_THAT(one.err, AllOf(HasSubstr("of range, angle and pose_gain the policy's defaults are "),
                             HasSubstr("--auto finds them")));
  const boost::json::value thresholds = parse_json(read_text(json)).at("thresholds");
  EXPECT_EQ(thresholds.at("options"), parse_json(R"({"loop_gain": "1"})"));
  EXPECT_TRUE(thresholds.at("defaults").as_object().contains("range"));
  // What a strategy has no use for is not missed.
  EXPECT_THAT(cairn({"compact", kWorld, "--strategy", "apal", "--range", "3", "--angle", "3"}).err,
              Not(HasSubstr("--auto")));
}

TEST_F(Compact, LowersThresholdsUntilTheErrorIsAsAskedFor) {
  const boost::json::value strict = study({kWorld, "--error-ratio", "1.05"}),
                           loose = study({kWorld, "--error-ratio", "50"});
  const auto& tried = strict.at("thresholds").at("trials").as_array();
  EXPECT_GE(tried.size(), 2U);
  const auto chosen = static_cast<std::size_t>(whole(strict, "thresholds", "chosen"));
  EXPECT_LT(tried[chosen].at("loop_gain_factor").as_double(), 1.0);
  EXPECT_GT(whole(strict, "loops", "kept"), whole(loose, "loops", "kept"));
  // The rule's own choice, if that is good enough.
  EXPECT_EQ(loose.at("thresholds").at("trials").as_array().size(), 1U);
  EXPECT_EQ(loose.at("thresholds").at("options"),
            study({kWorld, "--error-ratio", "0"}).at("thresholds").at("options"));
}

TEST_F(Compact, TheGateKeepsFalseMatchesOut) {
  const Arguments common{kWorld,
                         "--range",
                         "3",
                         "--angle",
                         "1.6",
                         "--registration",
                         "simulated:range=3,angle=1.6,false_rate=0.1"};
  Arguments gated = common;
  gated.insert(gated.end(), {"--gate", "0.99"});
  const boost::json::value open = report(common), closed = report(gated);
  EXPECT_GT(whole(open, "loops", "false_kept"), 0);
  EXPECT_GT(whole(closed, "loops", "false_registered"), 0);
  EXPECT_EQ(whole(closed, "loops", "false_kept"), 0);
  EXPECT_LT(ate(closed, "v2"), 0.2 * ate(open, "v2"));
}

TEST_F(Compact, ComparesItsUncertaintyWithThatOfEverything) {
  const std::string csv = folder_.file("compare.csv");
  const Arguments common{"@ellipse3d:poses=60", "--range", "3", "--angle", "0.3", "--compare", csv};
  study(common);
  for (const std::string& line : lines(read_text(csv))) {
    if (line.starts_with("pose")) continue;
    // The two are linearised at estimates that differ by a little, and so may the norms.
    std::istringstream numbers(line);
    std::array<double, 6> n{};
    for (double& number : n) {
      numbers >> number;
      numbers.ignore();
    }
    EXPECT_GT(n[2], (1.0 - 1e-4) * n[3]) << line;
    EXPECT_GT(n[4], (1.0 - 1e-4) * n[5]) << line;
  }
  // Where every pose at a known place is given up, its measurements are halved.
  Arguments halved = common;
  halved.insert(halved.end(), {"--policy", "compact_pose:reuse=true,reuse_loss=10"});
  const boost::json::value told = study(halved);
  EXPECT_EQ(told.at("compare").at("marginal_conservative").as_double(), 1.0);
  EXPECT_EQ(told.at("compare").at("full_conservative").as_double(), 1.0);
  const std::vector<std::string> rows = lines(read_text(csv));
  EXPECT_THAT(rows.front(), StartsWith("pose,kept,marginal,marginal_all,full,full_all"));
  EXPECT_EQ(static_cast<std::int64_t>(rows.size()) - 1, told.at("compare").at("steps").as_int64());
}

/// The lines of a g2o file about poses below or from `middle` on; `between` is for measurements
/// that join the two.
std::string part_of(const std::string& file, int middle, bool below, bool between) {
  std::string text;
  for (const std::string& line : lines(read_text(file))) {
    std::istringstream words(line);
    std::string tag;
    int first = 0, second = 0;
    words >> tag >> first >> second;
    const bool edge = tag.starts_with("EDGE");
    if (!edge) second = first;
    const bool early = std::max(first, second) < middle, late = std::min(first, second) >= middle;
    const bool odometry_between = edge && std::abs(first - second) == 1 && !early && !late;
    if (odometry_between || tag == "FIX") continue;
    if (early ? below : late ? !below : between) text += line + '\n';
  }
  return text;
}

TEST_F(Compact, ContinuesTheMapOfAnEarlierSession) {
  const std::string all = folder_.file("all.g2o"), truth = folder_.file("truth.g2o");
  ASSERT_EQ(cairn({"generate", "manhattan:poses=800,streets=5", "-o", all, "--ground-truth", truth})
                .exit_code,
            0);
  const std::string monday = folder_.file("monday.g2o"), tuesday = folder_.file("tuesday.g2o"),
                    map = folder_.file("map.g2o"), robot = folder_.file("robot.json"),
                    both = folder_.file("both.g2o");
  write_text(monday, part_of(all, 400, true, false));
  write_text(tuesday, part_of(all, 400, true, true) + part_of(all, 400, false, false));
  const auto first = report({monday, "-o", map, "--save-thresholds", robot});
  const auto second = report({tuesday, "--begin", "400", "--map", map, "--thresholds", robot, "-o",
                              both, "--truth", truth, "--trajectory", folder_.file("new.g2o")});
  const boost::json::value way =
      parse_json(cairn({"info", folder_.file("new.g2o"), "--json", "-"}).out);
  EXPECT_EQ(whole(way, "graph", "variables"), 400);
  EXPECT_TRUE(second.at("located").as_bool());
  EXPECT_EQ(whole(second, "poses", "in"), 400);
  EXPECT_EQ(whole(second, "poses", "map"), whole(first, "poses", "kept"));
  const auto one = report({all, "--strategy", "fpfl", "--thresholds", robot, "--truth", truth});
  EXPECT_LT(ate(second, "likely"), 1.3 * ate(one, "likely") + 0.02);
  const boost::json::value joint = parse_json(cairn({"info", both, "--json", "-"}).out);
  EXPECT_EQ(whole(joint, "graph", "variables"),
            whole(second, "poses", "map") + whole(second, "poses", "kept"));
  EXPECT_EQ(joint.at("components").as_int64(), 1);

  // Measurements of poses that the map has not kept need the way from there to one that it has.
  std::string lines_without;
  for (const std::string& line : lines(read_text(tuesday))) {
    std::istringstream words(line);
    std::string tag;
    int one_end = 0, other_end = 0;
    words >> tag >> one_end >> other_end;
    if (!tag.starts_with("EDGE") || std::max(one_end, other_end) >= 400)
      lines_without += line + '\n';
  }
  const std::string without = folder_.file("without.g2o"), lost = "between the sessions are lost";
  write_text(without, lines_without);
  const auto notes = [&](const std::string& recording) {
    const Outcome run =
        cairn({"compact", recording, "--begin", "400", "--map", map, "--thresholds", robot});
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return run.err;
  };
  EXPECT_THAT(notes(without), HasSubstr(lost));
  EXPECT_THAT(notes(tuesday), Not(HasSubstr(lost)));

  // Without a measurement between the two.
  const std::string apart = folder_.file("apart.g2o");
  write_text(apart, part_of(all, 400, false, false));
  const Outcome unlocated = cairn({"compact", apart, "--map", map, "--thresholds", robot, "--json",
                                   folder_.file("unlocated.json"), "--truth", truth});
  EXPECT_EQ(parse_json(read_text(folder_.file("unlocated.json"))).at("status").as_string(),
            "unlocated");
  EXPECT_EQ(unlocated.exit_code, 4);
  EXPECT_THAT(unlocated.out, Not(HasSubstr("NEES")));
  EXPECT_THAT(unlocated.out, HasSubstr("status      unlocated: no pose was matched"));
  EXPECT_TRUE(parse_json(read_text(folder_.file("unlocated.json"))).at("nees").is_null());
  EXPECT_THAT(unlocated.err, HasSubstr("no pose was matched with one of " + map));
  const Outcome same = cairn({"compact", monday, "--map", map, "--thresholds", robot});
  EXPECT_EQ(same.exit_code, 3);
  EXPECT_THAT(same.err, HasSubstr("is in the map and in the recording"));
  EXPECT_THAT(cairn({"compact", tuesday, "--begin", "4000", "--range", "3"}).err,
              HasSubstr("there is no pose 4000"));
  const Outcome broken = cairn({"compact", tuesday, "--map", map, "--thresholds", robot});
  EXPECT_EQ(broken.exit_code, 3);
  EXPECT_THAT(broken.err, AllOf(HasSubstr("no factor joins VERTEX_SE2 400 to VERTEX_SE2 399"),
                                HasSubstr("(--begin 400)")));
}

// With thresholds of the first. One world says little: with other noise the error of either varies
// by a factor of two.
TEST_F(Compact, AMapOfTwoSessionsHasTheErrorOfOne) {
  double two = 0.0, one = 0.0;
  for (const char* seed : {"1", "2", "3", "4", "5", "6"}) {
    const std::string all = folder_.file("all.g2o"), truth = folder_.file("truth.g2o"),
                      first = folder_.file("first.g2o"), second = folder_.file("second.g2o"),
                      map = folder_.file("map.g2o"), both = folder_.file("both.g2o"),
                      together = folder_.file("one.g2o"), robot = folder_.file("robot.json");
    ASSERT_EQ(cairn({"generate", "manhattan:poses=800,streets=5", "--seed", seed, "-o", all,
                     "--ground-truth", truth})
                  .exit_code,
              0);
    write_text(first, part_of(all, 400, true, false));
    write_text(second, part_of(all, 400, true, true) + part_of(all, 400, false, false));
    const auto error = [&](const std::string& file) {
      const boost::json::value report =
          parse_json(cairn({"evaluate", file, truth, "--json", "-"}).out);
      const double ate = report.at("ate").at("translation").to_number<double>();
      return ate * ate;
    };
    report({first, "-o", map, "--save-thresholds", robot});
    report({second, "--begin", "400", "--map", map, "--thresholds", robot, "-o", both});
    report({all, "--strategy", "fpfl", "--thresholds", robot, "-o", together});
    two += error(both);
    one += error(together);
  }
  EXPECT_LT(std::sqrt(two), 1.3 * std::sqrt(one));
}

TEST_F(Compact, KeepsTheMeasurementsOfLandmarksThatAreInformative) {
  const std::string world = "@landmarks2d:poses=400", truth = folder_.file("truth.g2o");
  ASSERT_EQ(
      cairn({"generate", world.substr(1), "-o", folder_.file("world.g2o"), "--ground-truth", truth})
          .exit_code,
      0);
  const auto run = [&](const Arguments& more) {
    Arguments arguments{"compact", folder_.file("world.g2o"), "--truth", truth, "--quiet"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return report_of(arguments);
  };
  const auto all = run({"--strategy", "apal"});
  const auto few = run({"-o", folder_.file("map.g2o"), "--strategy", "fpfl", "--policy",
                        "compact_pose:landmark_gain=1.05"});
  const auto many = run({"--strategy", "fpfl"});
  const auto whole = run({});
  EXPECT_EQ(all.at("observations").at("kept"), all.at("observations").at("in"));
  EXPECT_EQ(all.at("landmarks").at("kept"), all.at("landmarks").at("in"));
  const auto count = [](const auto& report, const char* what) {
    return report.at(what).at("kept").as_int64();
  };
  EXPECT_LT(count(few, "observations"), count(many, "observations"));
  EXPECT_LT(count(many, "observations"), count(all, "observations"));
  EXPECT_LT(count(few, "poses"), 200);
  EXPECT_EQ(count(whole, "poses"), count(many, "poses"));
  EXPECT_EQ(count(whole, "observations"), count(all, "observations"));
  EXPECT_EQ(count(whole, "landmarks"), count(all, "landmarks"));
  EXPECT_LT(whole.at("check").at("distance").to_number<double>(), 0.02);
  for (const auto* report : {&all, &few, &many, &whole}) {
    const auto& nees = report->at("nees");
    const double ratio =
        nees.at("squared").to_number<double>() / nees.at("dof").to_number<double>();
    EXPECT_GT(ratio, 0.7);
    EXPECT_LT(ratio, 1.4);
  }
  EXPECT_LT(few.at("rmse").to_number<double>(), 3.0 * all.at("rmse").to_number<double>());
  EXPECT_NEAR(whole.at("rmse").to_number<double>(), all.at("rmse").to_number<double>(), 1e-3);
  EXPECT_THAT(read_text(folder_.file("map.g2o")), HasSubstr("EDGE_SE2_XY"));
  // It can be continued.
  const Outcome again =
      cairn({"compact", "@landmarks2d:poses=40", "--map", folder_.file("map.g2o")});
  EXPECT_EQ(again.exit_code, 3);
  EXPECT_THAT(again.err, HasSubstr("is in the map and in the recording"));
}

// A landmark of which a single pose knows the bearing alone.
TEST_F(Compact, WhereALandmarkIsNotDeterminedThereIsNoWholeMap) {
  const std::string world = folder_.file("world.g2o"), bearings = folder_.file("bearings.g2o");
  ASSERT_EQ(cairn({"generate", "landmarks2d:poses=60,sensor=bearing_range", "-o", world}).exit_code,
            0);
  std::istringstream lines(read_text(world));
  std::string kept, first;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string tag, pose, landmark, bearing, range, information;
    words >> tag >> pose >> landmark >> bearing >> range >> information;
    if (tag == "EDGE_BEARING_RANGE_SE2_XY") {
      if (landmark == first) continue;
      if (first.empty()) {
        first = landmark;
        line =
            fmt::format("{} {} {} {} {} {} 0 0", tag, pose, landmark, bearing, range, information);
      }
    }
    kept += line + '\n';
  }
  write_text(bearings, kept);
  const auto report = report_of({"compact", bearings, "--quiet"});
  EXPECT_EQ(report.at("strategy").as_string(), "fpfl");
  EXPECT_EQ(report.at("landmarks").at("undetermined").as_int64(), 1);
  const Outcome run = cairn({"compact", bearings});
  EXPECT_THAT(run.err, HasSubstr("does not determine all landmarks"));
  EXPECT_EQ(report_of({"compact", world, "--quiet"}).at("strategy").as_string(), "whole");
}

// A robust loss takes weight from measurements, so that they tell no more than without it.
TEST_F(Compact, AMapWithLandmarksStopsGrowingWithARobustLossToo) {
  const auto kept = [&](const Arguments& more) {
    Arguments arguments{"compact", "@landmarks2d:poses=1200,streets=3,block=8,seed=3", "--quiet"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return report_of(arguments).at("poses").at("kept").as_int64();
  };
  const auto without = static_cast<double>(kept({}));
  EXPECT_LT(without, 300);
  EXPECT_LT(static_cast<double>(kept({"--loss", "huber:scale=1"})), 1.3 * without);
  EXPECT_LT(static_cast<double>(kept({"--loss", "cauchy:scale=1"})), 1.6 * without);
}

TEST_F(Compact, ReportsTheStrategyThatRan) {
  const Arguments all{"compact", kWorld, "--range", "3", "--policy", "compact_pose:strategy=apal"};
  const auto report = report_of(all);
  EXPECT_EQ(report.at("strategy").as_string(), "apal");
  EXPECT_EQ(report.at("poses").at("kept"), report.at("poses").at("in"));
  Arguments both = all;
  both.insert(both.end(), {"--strategy", "apfl"});
  const Outcome refused = cairn(both);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("give one"));
}

TEST_F(Compact, SaysWhatIsWrongAndWhatWouldWork) {
  const auto refused = [](Arguments arguments, int code) {
    arguments.insert(arguments.begin(), "compact");
    const Outcome run = cairn(arguments);
    EXPECT_EQ(run.exit_code, code) << run.err;
    return run.err;
  };
  EXPECT_THAT(refused({"@bundle"}, 3), HasSubstr("not a pose of a Lie group"));
  EXPECT_THAT(refused({kWorld, "--auto", "--thresholds", "x.json"}, 2), HasSubstr("give one"));
  const std::string junk = folder_.file("junk.json");
  write_text(junk, "{\"policy\": 3}");
  EXPECT_THAT(refused({kWorld, "--thresholds", junk}, 3), HasSubstr("--save-thresholds"));
  const std::string told = folder_.file("report.json");
  write_text(told, "{\"cairn\": \"0.1.0\", \"command\": \"compact\", \"thresholds\": {}}");
  EXPECT_THAT(refused({kWorld, "--thresholds", told}, 3),
              AllOf(HasSubstr("this is the report of a run of cairn compact (--json)"),
                    HasSubstr("give a file that cairn compact --save-thresholds has written")));
  EXPECT_THAT(refused({"@manhattan:poses=20,loop_density=0"}, 3),
              HasSubstr("the recording has no loop closure: there is nothing to close"));
  EXPECT_THAT(refused({kWorld, "--policy", "compact_pose:rage=3"}, 2), HasSubstr("range"));
  EXPECT_THAT(refused({kWorld, "--policy", "random_poses:poses=10", "--auto"}, 2),
              HasSubstr("does not find its options"));
  EXPECT_THAT(refused({kWorld, "--range", "3", "-o", "-", "--trajectory", "-"}, 2),
              HasSubstr("standard output"));
}

TEST_F(Compact, TheControlSaysWhatToDoAboutLandmarksBeforeAnyWork) {
  const Outcome run =
      cairn({"study", "compact", "@landmarks2d:poses=60", "--strategy", "rfpfl", "-o", "-"});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, HasSubstr("give --strategy apal, apfl or fpfl"));
  EXPECT_EQ(run.out, "");
}

TEST_F(Compact, RunsAPolicyThatFindsNoOptionsWithThoseThatAreGiven) {
  const boost::json::value report =
      report_of({"compact", kWorld, "--policy", "random_poses:poses=10,loops=2"});
  EXPECT_EQ(report.at("poses").at("kept").as_int64(), 10);
}

TEST_F(Compact, SaysWhatWouldHelpWhereTheSelectionIsOfNoUse) {
  const Arguments sensor{"compact", kWorld, "--strategy", "fpfl",
                         "--range", "4",    "--angle",    "3.15"};
  const auto run = [&](Arguments more) {
    more.insert(more.begin(), sensor.begin(), sensor.end());
    return cairn(more).err;
  };
  const std::string all = run({"--pose-gain", "0.5", "--loop-gain", "8"});
  EXPECT_THAT(all, HasSubstr("% of the poses are kept: "));
  const std::string option = "; --pose-gain ";
  const std::size_t at = all.find(option);
  ASSERT_NE(at, std::string::npos) << all;
  std::string gain;
  std::istringstream(all.substr(at + option.size())) >> gain;
  EXPECT_THAT(run({"--pose-gain", gain, "--loop-gain", "8"}),
              Not(HasSubstr("of the poses are kept")));
  EXPECT_THAT(run({"--loop-gain", "1000"}),
              AllOf(HasSubstr("no loop closure is used: "), HasSubstr("; --loop-gain ")));
}

TEST_F(Compact, AnInterruptWhileThresholdsAreSoughtSelectsNothing) {
  const Outcome outcome = cairn_interrupted(
      {"compact", "@manhattan:poses=20000", "-o", folder_.file("few.g2o")}, "sample", SIGINT);
  EXPECT_EQ(outcome.exit_code, 130) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("interrupted before anything was selected"));
  EXPECT_TRUE(folder_.contents().empty());
}

TEST_F(Compact, AdviceThatFollowsASearchAsksForItAgain) {
  const std::string world = "@manhattan:poses=120,streets=3";
  const Outcome strict = cairn({"study", "compact", world, "--error-ratio", "0.01"});
  EXPECT_THAT(strict.err,
              AllOf(HasSubstr("100 % of the poses are kept"), HasSubstr("; --auto --")));
  std::istringstream advice(strict.err.substr(strict.err.find("; --auto") + 2));
  Arguments options{world};
  for (std::string word; advice >> word && word != "keep";) options.push_back(word);
  EXPECT_LT(whole(report(options), "poses", "kept"), 100);
}

TEST_F(Compact, RefusesAnEdgeThatLeavesADirectionUnknown) {
  const std::string in = folder_.file("in.g2o"), out = folder_.file("out.g2o");
  write_text(in,
             "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 2 0 0\n"
             "EDGE_SE2 0 1 1 0 0 100 0 0 100 0 100\n"
             "EDGE_SE2 1 2 1 0 0 100 0 0 100 0 0\n"
             "EDGE_SE2 0 2 2 0 0 100 0 0 100 0 100\n");
  const Outcome run = cairn({"compact", in, "--range", "3", "-o", out, "--quiet"});
  EXPECT_EQ(run.exit_code, 3);
  EXPECT_THAT(run.err, HasSubstr("EDGE_SE2 1 2: the information matrix is not positive definite"));
  EXPECT_FALSE(std::filesystem::exists(out));
}

}  // namespace
}  // namespace cairn::test
