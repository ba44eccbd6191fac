// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <csignal>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/exploration/explorer.hpp"
#include "exploration/commands/exploration_commands.hpp"
#include "support/plots.hpp"

namespace cairn::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kFloor = "@rooms:width=10,height=8,seed=2";

class Explore : public ExplorationCommands {
 protected:
  void SetUp() override {
    ExplorationCommands::SetUp();
    need({{"floor_surveyor", "round_body"},
          {"registration", "simulated"},
          {"grid_format", "ros"},
          {"format", "g2o"}});
  }
  static Outcome explore(const Arguments& more) {
    return run({"explore", kFloor, "--registration", kTrueMatcher}, more);
  }
};

TEST_F(Explore, SaysInFiveLinesWhatHappenedAndWritesAllOfIt) {
  const std::string graph = folder_.file("run.g2o"), map = folder_.file("map.yaml"),
                    all = folder_.file("all.g2o"), truth = folder_.file("truth.g2o"),
                    steps = folder_.file("run.csv"), report = folder_.file("run.json");
  const Outcome run = explore({"-o", graph, "--map", map, "--trajectory", all, "--truth", truth,
                               "--steps", steps, "--json", report});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  for (const char* line : {"end ", "drive ", "map ", "graph ", "time "})
    EXPECT_THAT(run.out, HasSubstr(line));
  const auto said = parse_json(read_text(report)).as_object();
  EXPECT_EQ(said.at("command"), "explore");
  EXPECT_EQ(said.at("end"), "finished");
  const auto& truth_of_map = said.at("map").at("truth");
  EXPECT_GT(truth_of_map.at("seen").to_number<double>(),
            0.98 * truth_of_map.at("floor").to_number<double>());
  // The steps' last row is what the report says, and the files are what other commands read.
  std::istringstream rows(read_text(steps));
  std::string row, last;
  int count = -2;  // the title and the start
  while (std::getline(rows, row)) ++count, last = row;
  EXPECT_EQ(count, said.at("motions").to_number<int>());
  const Outcome errors = cairn({"evaluate", all, truth, "--json", "-"});
  ASSERT_EQ(errors.exit_code, 0) << errors.err;
  EXPECT_EQ(cairn({"optimize", graph}).exit_code, 0);
  const Outcome floor = cairn({"info", map});
  EXPECT_EQ(floor.exit_code, 0) << floor.err;
}

TEST_F(Explore, ARunIsALogAndALogIsARun) {
  need({{"scan_log", "carmen"}, {"registration", "icp"}});
  const std::string log = folder_.file("run.clf.gz"), report = folder_.file("again.json"),
                    record = folder_.file("again.jsonl");
  const Outcome run = explore({"--until", "distance=12", "--log", log, "--seed", "4"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string world = "log:file=" + log + ",step=0";
  const Outcome again = cairn({"explore", "--world", world, "--json", report, "--record", record});
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_THAT(again.out, HasSubstr("finished: the recording is at its end"));
  const auto said = parse_json(read_text(report)).as_object();
  EXPECT_FALSE(said.contains("floor"));
  EXPECT_GE(said.at("distance").to_number<double>(), 12.0);
  EXPECT_LT(said.at("error").at("ate_translation").to_number<double>(), 0.1);
  EXPECT_EQ(cairn({"view", record, "-o", folder_.file("again.html")}).exit_code, 0);
  // With the floor the map is compared with it.
  const Outcome beside = cairn({"explore", kFloor, "--world", world, "--json", report});
  ASSERT_EQ(beside.exit_code, 0) << beside.err;
  EXPECT_GT(parse_json(read_text(report)).at("map").at("truth").at("seen").to_number<double>(),
            5.0);
  EXPECT_EQ(cairn({"map", log}).exit_code, 0);
}

TEST_F(Explore, LogsThatCannotBeAreRefused) {
  need({{"scan_log", "carmen"}});
  const std::string log = folder_.file("run.clf");
  const auto refusal = [&](const Arguments& words, int code) {
    const Outcome run = cairn(words);
    EXPECT_EQ(run.exit_code, code) << run.err;
    return unfolded(run.err);
  };
  EXPECT_THAT(refusal({"explore"}, 2), HasSubstr("FLOOR is missing"));
  EXPECT_THAT(refusal({"explore", "--world", "log"}, 2), HasSubstr("log:file=robot.clf"));
  EXPECT_THAT(refusal({"explore", kFloor, "--log", folder_.file("run.bag")}, 2), HasSubstr(".clf"));
  EXPECT_THAT(refusal({"explore", kFloor, "--runs", "2", "--log", log}, 2), HasSubstr("--log"));
  // Before the run, which may be long.
  const Outcome wide =
      explore({"--until", "steps=2", "--lidar", "fov=270", "--log", log, "--live"});
  EXPECT_EQ(wide.exit_code, 2);
  EXPECT_THAT(wide.err, Not(HasSubstr("--live: standard error is not a terminal")));
  EXPECT_THAT(unfolded(wide.err), HasSubstr("over 270°"));
  ASSERT_EQ(explore({"--until", "steps=2", "--log", log}).exit_code, 0);
  EXPECT_THAT(refusal({"explore", "--world", "log:file=" + log, "--runs", "2"}, 2),
              HasSubstr("there is nothing to compare"));
  const std::string before = read_text(log);
  EXPECT_THAT(refusal({"explore", "--world", "log:file=" + log, "--log", log}, 2),
              HasSubstr("run.clf is read"));
  EXPECT_EQ(read_text(log), before);
}

TEST_F(Explore, TheLossIsThatOfOneRunAndOfComparedOnes) {
  const std::string report = folder_.file("run.json");
  const auto said = [&](const Arguments& more) {
    Arguments words{"--until", "distance=25", "--json", report};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome run = explore(words);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return parse_json(read_text(report));
  };
  // At this scale loop closures hardly count.
  constexpr const char* kLoss = "cauchy:scale=0.01";
  const std::string csv = folder_.file("runs.csv");
  const auto plain = said({}), robust = said({"--loss", kLoss}),
             compared = said({"--loss", kLoss, "--csv", csv});
  EXPECT_EQ(plain.at("loss"), "none");
  EXPECT_EQ(robust.at("loss"), kLoss);
  EXPECT_EQ(compared.at("loss"), kLoss);
  EXPECT_NE(plain.at("measures"), robust.at("measures"));
  EXPECT_EQ(compared.at("runs").at(0).at("measures"), robust.at("measures"));
  const Outcome wrong = explore({"--runs", "2", "--until", "steps=2", "--loss", "nonsense"});
  EXPECT_EQ(wrong.exit_code, 5);
  EXPECT_THAT(unfolded(wrong.err), HasSubstr("nonsense"));
}

TEST_F(Explore, AGraphOnStandardOutputIsAloneThere) {
  const std::string file = folder_.file("run.g2o");
  ASSERT_EQ(explore({"--until", "steps=5", "-o", file}).exit_code, 0);
  const Outcome run = explore({"--until", "steps=5", "-o", "-"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(run.out, read_text(file));
  EXPECT_THAT(run.err, HasSubstr("limit: 5 motions are made"));
}

TEST_F(Explore, TheSameCommandGivesTheSameRun) {
  const std::string first = folder_.file("a.csv"), second = folder_.file("b.csv"),
                    other = folder_.file("c.csv");
  for (const auto& [file, seed, threads] :
       {std::tuple{first, "3", "1"}, {second, "3", "2"}, {other, "4", "1"}}) {
    ASSERT_EQ(
        explore({"--steps", file, "--seed", seed, "--threads", threads, "--until", "distance=12"})
            .exit_code,
        0);
  }
  EXPECT_EQ(read_text(first), read_text(second));
  EXPECT_NE(read_text(first), read_text(other));
}

TEST_F(Explore, OptionsOfRobotAndLimitsAreTaken) {
  const std::string report = folder_.file("run.json");
  const Outcome run = explore({"--until", "steps=5", "--lidar", "fov=90,range=3,beams=31",
                               "--odometry", "relative=0.2", "--start-x", "2", "--start-y", "2",
                               "--start-theta", "1.5", "--explorer", "random", "--json", report});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("limit: 5 motions are made"));
  const auto said = parse_json(read_text(report)).as_object();
  EXPECT_EQ(said.at("motions"), 5);
  EXPECT_THAT(std::string(said.at("world").as_string()),
              AllOf(HasSubstr("fov=90"), HasSubstr("relative=0.2")));
}

/// What the clock has no part in.
void remove_times(boost::json::value& report) {
  if (auto* list = report.if_array()) {
    for (auto& item : *list) remove_times(item);
  } else if (auto* object = report.if_object()) {
    for (const char* name : {"seconds", "measured_seconds", "peak_memory_bytes"})
      object->erase(name);
    for (auto& [name, value] : *object) remove_times(value);
  }
}

/// Also the decisions of those that search in parallel.
TEST_F(Explore, TheSameReportWhateverTheNumberOfThreads) {
  for (std::string explorer : Registry().names(Explorer::kKind)) {
    if (explorer == "ede_gradient") explorer += ":orientations=24";
    std::vector<boost::json::value> reports;
    for (const char* threads : {"1", "2", "3", "1"}) {
      const std::string report = folder_.file("run.json");
      const Outcome run = explore({"--explorer", explorer, "--until", "distance=8", "--threads",
                                   threads, "--json", report});
      ASSERT_EQ(run.exit_code, 0) << run.err;
      reports.push_back(parse_json(read_text(report)));
      remove_times(reports.back());
      reports.back().as_object().at("decisions").as_object() = {
          {"count", reports.back().at("decisions").at("count")}};
    }
    for (const auto& report : reports) EXPECT_EQ(report, reports.front()) << explorer;
  }
}

TEST_F(Explore, ComparesExplorersAtTheSameSeedsWhateverTheNumberOfThreads) {
  std::vector<boost::json::value> reports;
  for (const char* threads : {"1", "3"}) {
    const std::string report = folder_.file("compare.json");
    const Outcome run =
        explore({"--explorer", "frontier:length=0.5,keep=0.6,random", "--runs", "3", "--seed", "5",
                 "--until", "distance=10", "--threads", threads, "--json", report});
    ASSERT_EQ(run.exit_code, 0) << run.err;
    EXPECT_THAT(run.out, HasSubstr("Difference from frontier:length=0.5,keep=0.6"));
    reports.push_back(parse_json(read_text(report)));
    remove_times(reports.back());
  }
  EXPECT_EQ(reports[0], reports[1]);
  EXPECT_EQ(reports[0].at("runs").as_array().size(), 6U);
  EXPECT_EQ(reports[0].at("explorers").as_array().size(), 2U);
  // A run of a comparison is the run that the same seed gives alone.
  const std::string alone = folder_.file("alone.json");
  ASSERT_EQ(
      explore({"--explorer", "random", "--seed", "6", "--until", "distance=10", "--json", alone})
          .exit_code,
      0);
  const auto& compared = reports[0].at("runs").as_array().at(3);
  EXPECT_EQ(compared.at("explorer"), "random");
  EXPECT_EQ(compared.at("seed"), 6);
  EXPECT_EQ(compared.at("measures"), parse_json(read_text(alone)).at("measures"));
  EXPECT_NE(compared.at("measures"), reports[0].at("runs").as_array().at(1).at("measures"));
}

TEST_F(Explore, AComparisonIsWrittenAsRowsCurvesAndAPage) {
  const std::string runs = folder_.file("runs.csv"), curves = folder_.file("curves.csv"),
                    page = folder_.file("compare.html"), report = folder_.file("compare.json"),
                    latex = folder_.file("compare.tex");
  ASSERT_EQ(
      explore({"--explorer", "frontier,random", "--runs", "2", "--until", "distance=10", "--csv",
               runs, "--curves", curves, "--latex", latex, "--html", page, "--json", report})
          .exit_code,
      0);
  const auto rows = lines(read_text(runs));
  ASSERT_EQ(rows.size(), 5U);
  EXPECT_TRUE(rows[0].starts_with("explorer,seed,end,why,distance,"));
  EXPECT_TRUE(rows[4].starts_with("random,2,"));
  EXPECT_THAT(read_text(latex),
              AllOf(HasSubstr("\\begin{tabular}{lrr}\n\\hline\n & frontier & random \\\\\n"),
                    HasSubstr("runs & 2 & 2 \\\\\n"), HasSubstr(" $\\pm$ "),
                    HasSubstr("% difference from frontier, seed by seed\n\\begin{tabular}{lr}\n")));
  EXPECT_THAT(read_text(page), AllOf(HasSubstr("<!doctype html>"),
                                     HasSubstr(draws_plots() ? "data:image/svg" : "Without curves"),
                                     ::testing::Not(HasSubstr("src=\"http"))));
  const int drawn = draws_plots() ? 0 : 5;
  EXPECT_EQ(cairn({"plot", curves, "--x", "distance", "--y", "map_entropy *", "--y",
                   "trajectory_entropy *", "-o", folder_.file("curves.svg")})
                .exit_code,
            drawn);
  EXPECT_EQ(cairn({"plot", curves, "--x", "known", "--y", "map_error *", "-o",
                   folder_.file("errors.svg")})
                .exit_code,
            drawn);
  // The mean in the report is that of the rows.
  const auto said = parse_json(read_text(report)).as_object();
  const auto& mean = said.at("explorers").as_array().at(1).at("measures").at("coverage");
  double sum = 0.0;
  for (const auto& run : said.at("runs").as_array()) {
    if (run.at("explorer") == "random")
      sum += run.at("measures").at("coverage").to_number<double>();
  }
  EXPECT_NEAR(mean.at("mean").to_number<double>(), 0.5 * sum, 1e-12);
  EXPECT_EQ(mean.at("count"), 2);
}

TEST_F(Explore, AComparisonThatIsInterruptedIsWrittenAsFarAsItIs) {
  const std::string page = folder_.file("compare.html"), report = folder_.file("compare.json");
  const Outcome run = cairn_interrupted(
      {"explore", "@rooms:width=100,height=100", "--registration", kTrueMatcher, "--runs", "2",
       "--csv", folder_.file("runs.csv"), "--html", page, "--json", report, "--threads", "2"},
      "0 of 2 runs", SIGTERM);
  EXPECT_EQ(run.exit_code, 130) << run.err;
  EXPECT_THAT(read_text(page), HasSubstr("No run was finished."));
  EXPECT_EQ(parse_json(read_text(report)).at("runs").as_array().size(), 2);
}

TEST_F(Explore, ARunWithABudgetSaysThatItCannotBeRepeated) {
  const std::string report = folder_.file("run.json");
  const Outcome run = explore({"--until", "steps=5", "--decision-budget", "10", "--match",
                               "range=1.4,angle=0.35,sigma_xy=0.01", "--json", report});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, HasSubstr("can't be repeated"));
  EXPECT_EQ(parse_json(read_text(report)).at("repeatable"), false);
}

TEST_F(Explore, WhatCannotWorkIsRefusedBeforeTheWork) {
  const auto refusal = [&](std::vector<std::string> more, int code) {
    const Outcome run = explore(std::move(more));
    EXPECT_EQ(run.exit_code, code) << run.err;
    return run.err;
  };
  EXPECT_THAT(refusal({"--until", "distance=-3"}, 2), HasSubstr("above zero"));
  EXPECT_THAT(refusal({"--until", "hours=3"}, 2), HasSubstr("distance"));
  EXPECT_THAT(refusal({"--until", "steps=0.5"}, 2), HasSubstr("no whole number for steps"));
  EXPECT_THAT(refusal({"--until", "distance"}, 2), HasSubstr("is not of the form distance=250"));
  EXPECT_THAT(refusal({"--explorer", "frontir"}, 5), HasSubstr("frontier"));
  EXPECT_THAT(refusal({"--lidar", "beams=0"}, 2), HasSubstr("beams"));
  EXPECT_THAT(refusal({"--lidar", "sigma_xy=0.1"}, 2), HasSubstr("--odometry sigma_xy=0.1"));
  EXPECT_THAT(refusal({"--odometry", "fov=90"}, 2), HasSubstr("--lidar fov=90"));
  EXPECT_THAT(refusal({"--lidar", "radius=0.1"}, 2), HasSubstr("--world NAME:radius=0.1"));
  EXPECT_THAT(refusal({"--world", "dubins"}, 2), HasSubstr("lidar_building:motion=dubins"));
  EXPECT_THAT(refusal({"--explorer", "frontier,frontier"}, 2), HasSubstr("is there twice"));
  EXPECT_THAT(cairn({"explore", "rooms"}).err, HasSubstr("@rooms"));
  EXPECT_THAT(refusal({"--lidar", "fov=90", "--world", "lidar_building:fov=100"}, 2),
              HasSubstr("give one"));
  EXPECT_THAT(refusal({"--map", folder_.file("map.g2o")}, 2), HasSubstr("map.yaml"));
  EXPECT_THAT(refusal({"--start-x", "0", "--start-y", "0"}, 3), HasSubstr("in a wall"));
  EXPECT_THAT(refusal({"--start-x", "1"}, 2), HasSubstr("go together"));
  EXPECT_THAT(refusal({"--match", "reach=3"}, 2), HasSubstr("sigma_theta"));
  EXPECT_THAT(refusal({"--runs", "2", "--map", folder_.file("map.yaml")}, 2), HasSubstr("--map"));
  EXPECT_THAT(refusal({"--explorer", "frontier,frontir", "--runs", "2"}, 5), HasSubstr("frontir"));
  EXPECT_THAT(refusal({"--seed", "18446744073709551615", "--runs", "2"}, 2),
              HasSubstr("is not an integer from 0 to 1000000000000000"));
  EXPECT_THAT(refusal({"--start-x", "2", "--start-y", "2", "--start-theta", "nan"}, 2),
              HasSubstr("--start-theta: 'nan' is not a finite number"));
  EXPECT_THAT(refusal({"--lidar", "range=nan"}, 2), HasSubstr("range"));
  EXPECT_THAT(refusal({"--explorer", "frontier:lenght=2"}, 2), HasSubstr("did you mean 'length'"));
  EXPECT_THAT(refusal({"--mapper", "log_odds:resolution=0"}, 2), HasSubstr("resolution"));
  EXPECT_THAT(refusal({"--world", "lidar_building:radius=5"}, 3), HasSubstr("radius"));
  EXPECT_THAT(refusal({"--steps", folder_.file("none/a.csv")}, 3), HasSubstr("cannot be written"));
  EXPECT_THAT(refusal({"--map", folder_.file("m.yaml:mode=raaw")}, 2), HasSubstr("'raw'"));
  EXPECT_THAT(refusal({"--map", folder_.file("m.yaml:mode=scale,image=pgm")}, 2),
              HasSubstr("write a PNG"));
  EXPECT_EQ(cairn({"explore", folder_.file("none.yaml"), "--registration", kTrueMatcher}).exit_code,
            3);
  EXPECT_TRUE(folder_.contents().empty());
}

/// A YAML stands for its picture, too.
TEST_F(Explore, NoOutputReplacesAnotherOrAPartOfTheFloor) {
  const std::string floor = folder_.file("floor.yaml"), picture = folder_.file("floor.png"),
                    map = folder_.file("map.yaml");
  ASSERT_EQ(cairn({"generate", "rooms:width=6,height=5", "-o", floor}).exit_code, 0);
  const std::string before = read_text(picture);
  const auto refusal = [&](std::vector<std::string> more) {
    std::vector<std::string> words{"explore",    floor,     "--registration",
                                   kTrueMatcher, "--until", "steps=1"};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome run = cairn(words);
    EXPECT_EQ(run.exit_code, 2) << run.err;
    return run.err;
  };
  EXPECT_THAT(refusal({"--map", floor}), HasSubstr("floor.yaml is read"));
  EXPECT_THAT(refusal({"--steps", picture}), HasSubstr("floor.png is read"));
  EXPECT_THAT(refusal({"--map", picture}), HasSubstr("floor.png is read"));
  EXPECT_THAT(refusal({"--map", map, "--json", folder_.file("map.png")}),
              HasSubstr("two outputs go to one file"));
  EXPECT_THAT(refusal({"--map", map, "--steps", map}), HasSubstr("two outputs go to one file"));
  EXPECT_EQ(read_text(picture), before);
  EXPECT_THAT(folder_.contents(), ::testing::ElementsAre("floor.png", "floor.yaml"));
}

TEST_F(Explore, NarrowDoorsAndPocketsAreNoted) {
  // Two rooms, with a door of 0.2 m.
  std::string picture = "P2\n50 30\n255\n";
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 50; ++x) {
      const bool wall = x == 0 || y == 0 || x == 49 || y == 29 || (x == 20 && y != 9 && y != 10);
      picture += wall ? "0 " : "254 ";
    }
  }
  write_text(folder_.file("doors.pgm"), picture);
  const std::string floor = folder_.file("doors.yaml");
  write_text(floor, "image: doors.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n");
  const auto note = [&](std::vector<std::string> more) {
    std::vector<std::string> words{"explore",    floor,     "--registration",
                                   kTrueMatcher, "--until", "steps=1"};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome run = cairn(words);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return run.err;
  };
  EXPECT_THAT(note({}), AllOf(HasSubstr("1 part of the floor"), HasSubstr("too narrow")));
  EXPECT_THAT(note({"--world", "lidar_building:radius=0.05"}), Not(HasSubstr("too narrow")));
  EXPECT_THAT(
      note({"--start-x", "1", "--start-y", "1"}),
      AllOf(HasSubstr("the start (1.00, 1.00) is in a pocket"), HasSubstr("nearest at (2.")));
  EXPECT_THAT(cairn({"info", floor, "--start-x", "1", "--start-y", "1"}).out,
              HasSubstr("nearest to the start at (2."));
}

TEST_F(Explore, SaysWhereHardlyAnyScansMatch) {
  const auto said = [&](const char* registration) {
    const Outcome run =
        cairn({"explore", "@rooms:width=12,height=9", "--registration", registration, "--lidar",
               "range_sigma=0.3", "--until", "distance=20", "--seed", "1"});
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return unfolded(run.err);
  };
  EXPECT_THAT(said("icp"), HasSubstr("the map rests mostly on odometry"));
  EXPECT_THAT(said(kTrueMatcher), Not(HasSubstr("rests mostly on odometry")));
}

TEST_F(Explore, ARobotThatSeesNothingIsStuckAndSaysWhy) {
  const Outcome run = explore({"--lidar", "dropouts=1"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("stuck: no beam of the first scan has measured anything"));
}

}  // namespace
}  // namespace cairn::test
