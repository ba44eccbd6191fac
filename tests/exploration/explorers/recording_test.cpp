// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/recording.hpp"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <boost/json/parse.hpp>

#include "cairn/exploration/exploration.hpp"
#include "cairn/exploration/recorder.hpp"
#include "cairn/grid/floor_plan.hpp"
#include "cairn/io/packed_array.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "support/spaced_json.hpp"

namespace cairn {
namespace {

namespace json = boost::json;
using testing::HasSubstr;

std::vector<double> numbers(const json::value& value) {
  const json::object& array = value.as_object();
  const bool deflate = array.contains("deflate");
  return unpack_numbers(array.at("type").as_string(),
                        array.at(deflate ? "deflate" : "base64").as_string(),
                        deflate ? Packing::deflate : Packing::base64,
                        array.at("count").to_number<std::size_t>(), "test");
}

/// Of 16-bit steps: what they stand for.
std::vector<double> scaled(const json::value& value, std::size_t dimension) {
  std::vector<double> all = numbers(value);
  for (std::size_t k = 0; k < all.size(); ++k) {
    const double low = value.at("min").as_array()[k % dimension].to_number<double>();
    const double high = value.at("max").as_array()[k % dimension].to_number<double>();
    all[k] = all[k] == 65535.0 ? std::nan("") : low + all[k] / 65534.0 * (high - low);
  }
  return all;
}

/// A recording played back to a line by nothing but docs/recording.md.
struct Playback {
  using Cell = std::pair<long, long>;
  std::map<Cell, int> cells;  ///< known ones, by multiples of the resolution in the world
  std::map<Id, std::vector<double>> poses;
  std::map<long, std::pair<Id, Id>> edges;
  double resolution = 0.0;
  long left = 0, low = 0;

  void apply(const json::object& line) {
    if (line.contains("map")) apply_map(line.at("map").as_object());
    if (line.contains("poses")) {
      for (const json::value& pose : line.at("poses").as_array()) {
        const auto id = pose.as_array()[0].to_number<Id>();
        poses[id] = {};
        for (int k = 1; k < 4; ++k) poses[id].push_back(pose.as_array()[k].to_number<double>());
      }
    }
    if (line.contains("removed_poses")) {
      for (const json::value& id : line.at("removed_poses").as_array())
        EXPECT_EQ(poses.erase(id.to_number<Id>()), 1U);
    }
    if (line.contains("edges")) {
      for (const json::value& edge : line.at("edges").as_array()) {
        const json::array& e = edge.as_array();
        edges[e[0].to_number<long>()] = {e[1].to_number<Id>(), e[2].to_number<Id>()};
      }
    }
    if (line.contains("removed_edges")) {
      for (const json::value& id : line.at("removed_edges").as_array())
        EXPECT_EQ(edges.erase(id.to_number<long>()), 1U);
    }
  }

  void apply_map(const json::object& map) {
    if (map.contains("resolution")) {
      resolution = map.at("resolution").to_number<double>();
      left = std::lround(map.at("origin").as_array()[0].to_number<double>() / resolution);
      low = std::lround(map.at("origin").as_array()[1].to_number<double>() / resolution);
      cells.clear();
    }
    const auto width = map.at("width").to_number<long>(),
               height = map.at("height").to_number<long>();
    const std::vector<double> values = numbers(map.at("cells"));
    ASSERT_EQ(values.size(), static_cast<std::size_t>(width * height));
    for (long k = 0; k < width * height; ++k) {
      const Cell cell{left + map.at("x").to_number<long>() + k % width,
                      low + map.at("y").to_number<long>() + k / width};
      const int value = static_cast<int>(values[static_cast<std::size_t>(k)]);
      if (value == 255) cells.erase(cell);
      if (value < 254) cells[cell] = value;
    }
  }

  void expect_map(const FloorMap& map) const {
    const OccupancyGrid grid = map.occupancy();
    const GridFrame& frame = grid.frame;
    const long x0 = std::lround(frame.origin.x() / frame.resolution);
    const long y0 = std::lround(frame.origin.y() / frame.resolution);
    std::size_t known = 0;
    for (int y = 0; y < frame.height; ++y) {
      for (int x = 0; x < frame.width; ++x) {
        const int value = grid.occupancy[frame.index(x, y)];
        const auto found = cells.find({x0 + x, y0 + y});
        known += value != kUnknownCell;
        ASSERT_EQ(found == cells.end() ? int{kUnknownCell} : found->second, value);
      }
    }
    EXPECT_EQ(known, cells.size());
  }
};

class Recorded : public testing::Test {
 protected:
  void SetUp() override {
    file_ = std::filesystem::temp_directory_path() /
            ("recording_test." + std::to_string(::getpid()) + ".jsonl");
    floor_ = registry_.make<FloorPlan>(parse_component("rooms:width=10,height=8"))->generate(5);
  }
  void TearDown() override { std::filesystem::remove(file_); }

  template <class Interface>
  std::unique_ptr<Interface> make(const std::string& name) {
    return registry_.make<Interface>(parse_component(name));
  }

  /// A run with loop closures. `prepare` may add to what is called.
  template <class Prepare>
  ExplorationResult run(const Prepare& prepare) {
    const auto world = make<World>("lidar_building:relative=0.2");
    const auto policy = make<PosePolicy>("compact_pose:range=2,angle=3.14,reuse=false");
    const auto registration =
        make<Registration>("simulated:range=2,angle=3,sigma_translation=0.02,sigma_rotation=0.002");
    const auto mapper = make<Mapper>("log_odds");
    const auto explorer = make<Explorer>("frontier");
    robot_ = world->robot();
    Exploration parts{.world = *world,
                      .policy = *policy,
                      .registration = *registration,
                      .mapper = *mapper,
                      .explorer = *explorer,
                      .registry = registry_,
                      .start = {.floor = &floor_, .pose = {}, .seed = 7},
                      .limits = {.distance = 30.0}};
    return prepare(parts);
  }

  ExplorationResult record() {
    return run([&](Exploration& parts) {
      ExplorationRecorder recorder(file_, {.name = "frontier",
                                           .floor = "a \"floor\"",
                                           .parts = {{"explorer", "frontier"}},
                                           .seed = 7,
                                           .robot = robot_});
      parts.scanned = [&](const auto& step, const auto& at, const auto& scan) {
        recorder.moved(step, at, scan);
        maps_.push_back(at.map);
        scans_.push_back(scan);
        poses_.emplace_back(at.poses.begin(), at.poses.end());
      };
      parts.decided = [&](const auto& decision, const auto& at) {
        recorder.decided(decision, at);
        decisions_.push_back(decision);
      };
      ExplorationResult result = run_exploration(parts);
      recorder.finish(result);
      return result;
    });
  }

  std::string text() const {
    std::ifstream in(file_, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  static std::vector<json::object> objects(const ExplorationRecording& recording) {
    std::vector<json::object> all;
    for (const std::string& line : recording.lines) all.push_back(json::parse(line).as_object());
    return all;
  }

  Registry registry_;
  std::filesystem::path file_;
  OccupancyGrid floor_;
  RobotModel robot_;
  std::vector<FloorMap> maps_;
  std::vector<LaserScan> scans_;
  std::vector<std::vector<Id>> poses_;
  std::vector<Decision> decisions_;
};

TEST_F(Recorded, PlaysBackMapGraphAndScanOfEveryMotion) {
  const ExplorationResult result = record();
  ASSERT_GT(result.slam.loops, 3);
  const ExplorationRecording recording = read_exploration_recording(text(), "run");
  EXPECT_TRUE(recording.ended);
  EXPECT_FALSE(recording.torn);
  EXPECT_EQ(recording.name, "frontier");
  const auto header = json::parse(recording.header).as_object();
  EXPECT_EQ(header.at("floor").as_string(), "a \"floor\"");
  EXPECT_EQ(header.at("robot").at("lidar").at("beams").to_number<int>(), robot_.lidar.beams);
  Playback playback;
  std::size_t motion = 0;
  for (const json::object& line : objects(recording)) {
    playback.apply(line);
    if (!line.contains("step")) continue;
    const ExplorationStep& step = result.steps[motion];
    ASSERT_EQ(line.at("step").to_number<int>(), step.step);
    EXPECT_NEAR(line.at("estimate").as_array()[0].to_number<double>(), step.estimate.x(), 5.1e-5);
    EXPECT_NEAR(line.at("truth").as_array()[1].to_number<double>(), step.truth->y(), 5.1e-5);
    playback.expect_map(maps_[motion]);
    const std::vector<double> ranges = scaled(line.at("scan").at("ranges"), 1);
    ASSERT_EQ(ranges.size(), scans_[motion].ranges.size());
    for (std::size_t beam = 0; beam < ranges.size(); ++beam)
      ASSERT_NEAR(ranges[beam], scans_[motion].ranges[beam], 1e-4);
    ASSERT_EQ(playback.poses.size(), poses_[motion].size());
    for (const Id id : poses_[motion]) ASSERT_TRUE(playback.poses.contains(id));
    for (const auto& [id, ends] : playback.edges)
      ASSERT_TRUE(playback.poses.contains(ends.first) && playback.poses.contains(ends.second));
    ++motion;
  }
  EXPECT_EQ(motion, result.steps.size());
  // The end: the last solution, and the map drawn with it.
  playback.expect_map(result.map);
  ASSERT_EQ(playback.poses.size(), static_cast<std::size_t>(result.graph.variable_count()));
  for (int v = 0; v < result.graph.variable_count(); ++v) {
    const std::vector<double>& pose = playback.poses.at(result.graph.id(v));
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(pose[k], result.graph.state(v)[k], 5.1e-5);
  }
  std::multiset<std::pair<Id, Id>> recorded, expected;
  for (const auto& [id, ends] : playback.edges)
    recorded.insert(std::minmax(ends.first, ends.second));
  for (int f = 0; f < result.graph.factor_count(); ++f) {
    const auto ends = result.graph.factor_variables(f);
    expected.insert(std::minmax(result.graph.id(ends[0]), result.graph.id(ends[1])));
  }
  EXPECT_EQ(recorded, expected);
}

TEST_F(Recorded, CurvesAreThoseOfTheRunAndDecisionsHaveTheirCandidates) {
  const ExplorationResult result = record();
  const ExplorationRecording recording = read_exploration_recording(text(), "run");
  const auto& entropies = recording.steps.find("map_entropy")->values;
  const auto& trajectory = recording.steps.find("trajectory_entropy")->values;
  ASSERT_EQ(entropies.size(), result.steps.size());
  for (std::size_t k = 0; k < entropies.size(); ++k) {
    EXPECT_DOUBLE_EQ(entropies[k], result.steps[k].map_entropy);
    EXPECT_DOUBLE_EQ(trajectory[k], result.steps[k].trajectory_entropy);
  }
  ASSERT_EQ(recording.decisions, static_cast<int>(decisions_.size()));
  std::size_t number = 0;
  for (const json::object& line : objects(recording)) {
    if (!line.contains("kind")) continue;
    const Decision& decision = decisions_[number++];
    EXPECT_EQ(line.at("why").as_string(), decision.why);
    const json::array& candidates = line.at("candidates").as_array();
    ASSERT_EQ(candidates.size(), decision.candidates.size());
    if (decision.kind != Decision::Kind::drive) continue;
    EXPECT_EQ(line.at("chosen").to_number<std::size_t>(), decision.chosen);
    for (std::size_t k = 0; k < candidates.size(); ++k) {
      const json::object& candidate = candidates[k].as_object();
      EXPECT_DOUBLE_EQ(candidate.at("value").to_number<double>(), decision.candidates[k].value);
      const json::array& points = candidate.at("points").as_array();
      ASSERT_EQ(points.size(), decision.candidates[k].path.points.size());
      EXPECT_NEAR(points.back().as_array()[1].to_number<double>(),
                  decision.candidates[k].path.points.back().y(), 5.1e-5);
    }
  }
  EXPECT_EQ(number, decisions_.size());
}

/// Reading covariances changes no later result, and two recordings differ in times alone.
TEST_F(Recorded, ARunIsTheSameWithARecordingAndTheRecordingAgain) {
  const auto without_times = [&] {
    return std::regex_replace(text(), std::regex(",\"time\":[0-9.]+"), "");
  };
  const ExplorationResult result = record();
  const std::string first = without_times();
  const ExplorationResult plain = run([](Exploration& parts) { return run_exploration(parts); });
  ASSERT_EQ(plain.steps.size(), result.steps.size());
  for (std::size_t k = 0; k < plain.steps.size(); ++k) {
    ASSERT_EQ(plain.steps[k].estimate.x(), result.steps[k].estimate.x());
    ASSERT_EQ(plain.steps[k].trajectory_entropy, result.steps[k].trajectory_entropy);
  }
  EXPECT_EQ(plain.map.log_odds, result.map.log_odds);
  record();
  EXPECT_EQ(without_times(), first);
}

/// Nothing is held back that a kill would take along.
TEST_F(Recorded, EachLineIsInTheFileAsSoonAsItIsComplete) {
  const std::string part = file_.string() + "." + std::to_string(::getpid()) + "-0.part";
  std::string lines;
  const auto expect_all_written = [&] {
    std::ifstream in(part, std::ios::binary);
    ASSERT_EQ(std::string(std::istreambuf_iterator<char>(in), {}), lines);
  };
  run([&](Exploration& parts) {
    parts.limits.steps = 12;
    ExplorationRecorder recorder(file_, {.name = "frontier", .robot = robot_},
                                 [&](std::string_view line) { lines += line; });
    expect_all_written();
    parts.scanned = [&](const auto& step, const auto& at, const auto& scan) {
      recorder.moved(step, at, scan);
      expect_all_written();
    };
    parts.decided = [&](const auto& decision, const auto& at) {
      recorder.decided(decision, at);
      expect_all_written();
    };
    ExplorationResult result = run_exploration(parts);
    recorder.finish(result);
    return result;
  });
  EXPECT_EQ(text(), lines);
  EXPECT_FALSE(std::filesystem::exists(part));
  EXPECT_GT(std::ranges::count(lines, '\n'), 14);
}

TEST_F(Recorded, IsReadWithWhateverBlanksAnotherProgramGivesIt) {
  record();
  const std::string spaced = test::spaced_json(text());
  EXPECT_TRUE(is_exploration_recording(spaced));
  EXPECT_FALSE(
      is_exploration_recording(R"({ "format" : "cairn-recording", "kind" : "iterations" })"));
  const ExplorationRecording expected = read_exploration_recording(text(), "run");
  const ExplorationRecording recording = read_exploration_recording(spaced, "run");
  EXPECT_TRUE(recording.ended);
  EXPECT_EQ(recording.steps.columns[3].values, expected.steps.columns[3].values);
  EXPECT_EQ(recording.decisions, expected.decisions);
  // Thinned, until nothing of what may be left out is there.
  std::vector<std::string> notes;
  const std::string small = exploration_json(recording, "run", 1, notes);
  EXPECT_EQ(notes.size(), 2U);
  EXPECT_LT(small.size(), exploration_json(expected, "run", 100000000, notes).size());
}

TEST_F(Recorded, WhatWasWrittenUpToAnyByteOpens) {
  record();
  const std::string whole = text();
  const std::size_t header = whole.find('\n') + 1, start = whole.find('\n', header) + 1;
  for (std::size_t size = 0; size < whole.size(); size += 1 + whole.size() / 400) {
    const std::string_view part = std::string_view(whole).substr(0, size);
    if (size < start) {
      EXPECT_THROW(read_exploration_recording(part, "run"), Error);
      continue;
    }
    const ExplorationRecording recording = read_exploration_recording(part, "run");
    EXPECT_FALSE(recording.ended);
    EXPECT_EQ(recording.torn, !part.ends_with('\n'));
    const auto lines = std::ranges::count(part, '\n');
    EXPECT_EQ(std::ssize(recording.lines), lines - 1);
  }
}

TEST_F(Recorded, DamageIsToldWithItsLine) {
  record();
  std::vector<std::string> lines;
  std::istringstream in(text());
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  const auto refusal = [&](std::size_t k, const std::string& from, const std::string& to) {
    std::string damaged;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      std::string line = lines[i];
      if (i == k) {
        const std::size_t at = line.find(from);
        EXPECT_NE(at, std::string::npos) << from;
        line.replace(at, from.size(), to);
      }
      damaged += line + "\n";
    }
    try {
      read_exploration_recording(damaged, "run");
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("nothing");
  };
  EXPECT_THAT(refusal(0, "\"version\":1", "\"version\":2"), HasSubstr("run:1: a version"));
  EXPECT_THAT(refusal(1, "{", "["), HasSubstr("run:2: is not a JSON object"));
  EXPECT_THAT(refusal(1, "\"width\":", "\"width\":1"), HasSubstr("'cells' does not have"));
  EXPECT_THAT(refusal(1, "\"width\":", "\"width\":-"), HasSubstr("of that size"));
  EXPECT_THAT(refusal(1, "\"deflate\":\"", "\"deflate\":\"AAAA"), HasSubstr("run:2, cells"));
  EXPECT_THAT(refusal(1, "\"ranges\":", "\"rangs\":"), HasSubstr("'ranges' is missing"));
  std::string twice = text() + lines[1] + "\n";
  EXPECT_THROW(read_exploration_recording(twice, "run"), Error);
}

/// Ten thousands of poses, and more candidates than are drawn.
TEST_F(Recorded, TreesAndManyCandidates) {
  Decision decision;
  decision.why = "the <best>\n";
  decision.chosen = 249;
  for (int k = 0; k < 250; ++k) {
    Candidate candidate;
    candidate.path = {.points = {{0.0, 0.0}, {1.0 * k, 2.0}}, .length = 1.0 * k};
    candidate.value = -1.0 * (k % 200);
    if (k == 3) candidate.value = std::nan("");
    candidate.change = InformationChange{.trajectory = -0.5 * k, .map = -1.0, .alpha = 0.9};
    decision.candidates.push_back(std::move(candidate));
  }
  for (int k = 0; k < 1000; ++k)
    decision.tree.push_back({Pose2(0.01 * k, -0.02 * k, 0.0), k / 2 - (k == 0), -0.1 * k});
  run([&](Exploration& parts) {
    parts.limits.decisions = 1;
    ExplorationRecorder recorder(file_, {.name = "tree", .robot = robot_});
    parts.scanned = [&](const auto& step, const auto& at, const auto& scan) {
      recorder.moved(step, at, scan);
    };
    parts.decided = [&](const auto&, const auto& at) { recorder.decided(decision, at); };
    ExplorationResult result = run_exploration(parts);
    recorder.finish(result);
    return result;
  });
  const ExplorationRecording recording = read_exploration_recording(text(), "run");
  json::object line;
  for (const json::object& object : objects(recording)) {
    if (object.contains("kind")) line = object;
  }
  EXPECT_EQ(line.at("why").as_string(), decision.why);
  const json::array& candidates = line.at("candidates").as_array();
  ASSERT_EQ(candidates.size(), 250U);
  std::size_t drawn = 0;
  for (const json::value& candidate : candidates) drawn += candidate.as_object().contains("points");
  EXPECT_EQ(drawn, 101U);  // the best hundred and the chosen one
  EXPECT_TRUE(candidates[249].as_object().contains("points"));
  EXPECT_TRUE(candidates[199].as_object().contains("points"));
  EXPECT_FALSE(candidates[3].as_object().contains("points"));
  EXPECT_TRUE(candidates[3].at("value").is_null());
  EXPECT_EQ(candidates[5].at("change").at("trajectory").to_number<double>(), -2.5);
  const json::object& tree = line.at("tree").as_object();
  const std::vector<double> positions = scaled(tree.at("positions"), 2);
  const std::vector<double> values = scaled(tree.at("values"), 1);
  const std::vector<double> parents = numbers(tree.at("parents"));
  ASSERT_EQ(parents.size(), decision.tree.size());
  for (std::size_t k = 0; k < parents.size(); ++k) {
    EXPECT_EQ(parents[k], decision.tree[k].parent);
    EXPECT_NEAR(positions[2 * k + 1], decision.tree[k].pose.y(), 1e-3);
    EXPECT_NEAR(values[k], decision.tree[k].value, 1e-2);
  }
  // A page of a given size leaves out trees before scans.
  std::vector<std::string> notes;
  const std::string whole = exploration_json(recording, "run", 1U << 30U, notes);
  EXPECT_TRUE(notes.empty());
  EXPECT_THAT(whole, HasSubstr("\"tree\""));
  exploration_json(recording, "run", 0, notes);
  ASSERT_EQ(notes.size(), 2U);
  EXPECT_THAT(notes[0], HasSubstr("trees"));
}

}  // namespace
}  // namespace cairn
