// SPDX-License-Identifier: BSD-3-Clause
#include "exploration_data.hpp"

#include <cstddef>
#include <cstdint>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/io/packed_array.hpp"
#include "cairn/io/random_numbers.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::plot {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

std::string cells(const std::vector<std::uint8_t>& values) {
  return packed_json(std::span<const std::uint8_t>(values), Packing::deflate);
}
std::string points(const std::vector<float>& values, int dimension) {
  return packed_points_json(values, dimension);
}

/// A robot that stands, decides, drives and decides again, as docs/recording.md has it.
std::string exploration() {
  const std::vector<std::int32_t> parents{-1, 0, 1};
  const std::string scan =
      fmt::format(R"("scan":{{"first_angle":-1.5707963267948966,"angle_step":1.5707963267948966,)"
                  R"("max_range":8,"ranges":{}}})",
                  points({2.0F, 8.0F, 1.0F}, 1));
  const std::string start = fmt::format(
      R"({{"step":0,"decision":0,"estimate":[1,2,0],"covariance":[0.04,0.01,0.09],{},)"
      R"("poses":[[0,1,2,0]],"map":{{"resolution":0.5,"origin":[10,20],"yaw":0,"x":-1,"y":2,)"
      R"("width":2,"height":2,"cells":{}}}}})",
      scan, cells({0, 100, 255, 40}));
  const std::string first =
      R"({"decision":1,"kind":"drive","candidates":[{"value":3,"points":[[1,2],[4,6]]},{"value":2}],"chosen":0})";
  const std::string motion =
      fmt::format(R"({{"step":1,"decision":1,"estimate":[4,6,{}],"covariance":null,{},)"
                  R"("poses":[[0,1.5,2,0],[7,4,6,1],[8,5,6,1]],"edges":[[3,0,7,0],[4,7,8,1]],)"
                  R"("map":{{"x":0,"y":1,"width":2,"height":2,"cells":{}}}}})",
                  std::numbers::pi / 2, scan, cells({7, 254, 254, 8}));
  const std::string second = fmt::format(
      R"({{"decision":2,"kind":"drive","candidates":[],"tree":{{"count":3,"positions":{},)"
      R"("parents":{},"values":{}}}}})",
      points({4.0F, 6.0F, 5.0F, 6.0F, 5.0F, 8.0F}, 2),
      packed_json(std::span<const std::int32_t>(parents), Packing::deflate),
      points({0.0F, -2.0F, 1.0F}, 1));
  const std::string end =
      R"({"end":"limit","poses":[[7,4.5,6,1]],"removed_poses":[8],"removed_edges":[4]})";
  return fmt::format(
      R"({{"name":"run","header":{{"robot":{{"radius":0.25}}}},"lines":[{},{},{},{},{}]}})", start,
      first, motion, second, end);
}

TEST(RecordedState, AtADecisionIsWhatWasKnownThen) {
  const RecordedState state = recorded_state(exploration(), 1);
  EXPECT_EQ(state.name, "run");
  EXPECT_EQ(state.radius, 0.25);
  EXPECT_EQ(state.robot.x, 1.0);
  EXPECT_EQ(state.covariance.xy, 0.01);
  EXPECT_THAT(state.map.cells, ElementsAre(0, 100, 255, 40));
  // Cell (−1, 2) of half a metre from (10, 20).
  EXPECT_EQ(state.map.frame.origin, Eigen::Vector2d(9.5, 21.0));
  // To the right 2 m, ahead nothing, to the left 1 m.
  ASSERT_THAT(state.scan, SizeIs(2));
  EXPECT_NEAR(state.scan[0].x, 1.0, 1e-3);
  EXPECT_NEAR(state.scan[0].y, 0.0, 1e-3);
  EXPECT_NEAR(state.scan[1].y, 3.0, 1e-3);
  ASSERT_TRUE(state.decision);
  EXPECT_EQ(state.decision->chosen, 0);
  ASSERT_THAT(state.decision->candidates, SizeIs(2));
  EXPECT_EQ(state.decision->candidates[0].points.back().y, 6.0);
  EXPECT_THAT(state.decision->nodes, SizeIs(0));
}

TEST(RecordedState, PutsTogetherWhatHasChanged) {
  const RecordedState state = recorded_state(exploration(), 2);
  // The box has grown by a column to the right and a row below; 254 has not changed.
  EXPECT_EQ(state.map.frame.origin, Eigen::Vector2d(9.5, 20.5));
  EXPECT_THAT(state.map.cells, ElementsAre(255, 7, 255, 0, 100, 8, 255, 40, 255));
  EXPECT_EQ(state.poses.at(0).x, 1.5);
  EXPECT_EQ(state.edges.at(4).kind, EdgeClass::loop);
  EXPECT_EQ(state.covariance.xx, 0.0);
  EXPECT_NEAR(state.scan[0].x, 6.0, 1e-3);  // its right, with its heading turned to the left
  ASSERT_TRUE(state.decision);
  EXPECT_EQ(state.decision->chosen, -1);
  EXPECT_THAT(state.decision->parents, ElementsAre(-1, 0, 1));
  EXPECT_NEAR(state.decision->nodes[2].y, 8.0, 1e-4);
  EXPECT_NEAR(state.decision->values[1], -2.0, 1e-4);
}

TEST(RecordedState, AtItsEndHasNoDecision) {
  const RecordedState state = recorded_state(exploration(), {});
  EXPECT_FALSE(state.decision);
  EXPECT_EQ(state.poses.at(7).x, 4.5);
  EXPECT_THAT(state.poses, SizeIs(2));
  EXPECT_THAT(state.edges, SizeIs(1));
}

TEST(RecordedState, SaysWhichDecisionsThereAre) {
  try {
    recorded_state(exploration(), 3);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::input);
    EXPECT_THAT(error.what(), HasSubstr("run: there is no decision 3; the last one is 2"));
  }
  EXPECT_THROW(recorded_state(R"({"name":"a","lines":[]})", 0), Error);
  EXPECT_THROW(recorded_state(R"({"name":"a","lines":[]})", {}), Error);
  EXPECT_THROW(recorded_state("", {}), Error);
}

TEST(RecordedState, OfAMapThatCannotBeIsRefused) {
  const auto changed = [](const std::string& from, const std::string& to) {
    std::string text = exploration();
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return text.replace(at, from.size(), to);
  };
  for (const auto& [from, to] : {std::pair{"\"resolution\":0.5", "\"resolution\":1e-300"},
                                 {"[10,20]", "[1e20,20]"},
                                 {"[10,20]", "[]"},
                                 {"\"yaw\":0", "\"yaw\":null"}})
    EXPECT_THROW(recorded_state(changed(from, to), 1), Error) << to;
  // A part that cannot be is left out; a robot too far off has not come there.
  EXPECT_THROW(recorded_state(changed("\"width\":2", "\"width\":1e-300"), 1), Error);
  EXPECT_EQ(recorded_state(changed("\"x\":0", "\"x\":0.5"), 2).map.frame.width, 2);
  EXPECT_EQ(recorded_state(changed("[4,6,", "[4e20,6,"), 2).robot.x, 1.0);
}

TEST(RecordedState, OfDamagedTextIsAnErrorAtMost) {
  const std::string whole = exploration();
  RandomNumbers random(5);
  int read = 0;
  for (int k = 0; k < 4000; ++k) {
    std::string damaged = whole;
    for (int change = 0; change < 3; ++change)
      damaged[random.below(damaged.size())] = "0123456789,[]-\"eu"[random.below(17)];
    try {
      recorded_state(damaged, k % 3 == 2 ? std::nullopt : std::optional(k % 3));
      ++read;
    } catch (const Error&) {  // as it should
    }
  }
  EXPECT_GT(read, 40);
}

}  // namespace
}  // namespace cairn::plot
