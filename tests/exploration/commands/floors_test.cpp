// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/plugin/registry.hpp"
#include "integration/process.hpp"

namespace cairn::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

class Floors : public ::testing::Test {
 protected:
  void SetUp() override {
    const Registry registry;
    if (!registry.has("grid_format", "ros") || !registry.has("floor_plan", "rooms") ||
        !registry.has("floor_surveyor", "round_body"))
      GTEST_SKIP() << "built without yaml-cpp, libpng or OpenCV";
  }
  TemporaryFolder folder_;
  std::string floor_ = folder_.file("floor.yaml");
};

TEST_F(Floors, AGeneratedFloorIsWrittenAndRead) {
  const Outcome made = cairn({"generate", "rooms:width=12,height=9", "-o", floor_, "--seed", "3"});
  EXPECT_EQ(made.exit_code, 0) << made.err;
  EXPECT_THAT(made.out, HasSubstr("12 m × 9 m"));
  EXPECT_THAT(folder_.contents(), ::testing::ElementsAre("floor.png", "floor.yaml"));
  const Outcome read = cairn({"info", floor_, "--json", "-"});
  ASSERT_EQ(read.exit_code, 0) << read.err;
  const auto report = parse_json(read.out).as_object();
  EXPECT_EQ(report.at("floor").at("cells").at(0), 240);
  EXPECT_TRUE(report.at("leaks").as_array().empty());
  const auto direct =
      parse_json(cairn({"info", "@rooms:width=12,height=9,seed=3", "--json", "-"}).out);
  EXPECT_EQ(direct.at("area"), report.at("area"));
  EXPECT_EQ(direct.at("body"), report.at("body"));
}

TEST_F(Floors, InfoSaysWhatABodyReaches) {
  const Outcome said = cairn({"info", "@loop", "--radius", "0.3"});
  EXPECT_EQ(said.exit_code, 0) << said.err;
  EXPECT_THAT(said.out, HasSubstr("a body of radius 0.3 m"));
  EXPECT_THAT(said.out, HasSubstr("none: all that it covers is enclosed"));
  const Outcome wall = cairn({"info", "@loop", "--start-x", "0", "--start-y", "0"});
  EXPECT_EQ(wall.exit_code, 3);
  EXPECT_THAT(wall.err, HasSubstr("in a wall"));
  EXPECT_EQ(cairn({"info", "@loop", "--start-x", "0"}).exit_code, 2);
  EXPECT_EQ(cairn({"info", "@loop", "--entropy"}).exit_code, 2);
  EXPECT_EQ(cairn({"info", "@rooms", "--radius", "30"}).exit_code, 3);
}

TEST_F(Floors, WhereAGraphIsExpectedWhatAMapIsForIsSaid) {
  ASSERT_EQ(cairn({"generate", "rooms:width=12,height=9", "-o", floor_}).exit_code, 0);
  for (const std::string command : {"optimize", "compact", "sparsify", "marginals"}) {
    const Outcome refused = cairn({command, floor_});
    EXPECT_EQ(refused.exit_code, 3) << command;
    EXPECT_THAT(refused.err, HasSubstr("cairn explore")) << command;
  }
  EXPECT_THAT(cairn({"optimize", floor_, "--from", "g2o"}).err, HasSubstr("unknown tag"));
  // By its name alone it may be one.
  const std::string other = folder_.file("other.yaml");
  for (const bool is_there : {false, true}) {
    if (is_there) write_text(other, "a: 1\n");
    const Outcome refused = cairn({"optimize", other});
    EXPECT_EQ(refused.exit_code, 3);
    const std::string said = unfolded(refused.err);
    EXPECT_THAT(said, HasSubstr(other));
    EXPECT_EQ(said.find("unknown tag 'a:'") != std::string::npos, is_there) << said;
    EXPECT_EQ(said.find("If it is the map of a floor") != std::string::npos, is_there) << said;
  }
}

TEST_F(Floors, WhatIsNoMapsNameIsRefusedBeforeTheWork) {
  const Outcome graph = cairn({"generate", "rooms", "-o", folder_.file("floor.g2o")});
  EXPECT_EQ(graph.exit_code, 2);
  EXPECT_THAT(graph.err, HasSubstr("floor.yaml"));
  EXPECT_EQ(cairn({"generate", "rooms", "-o", floor_, "--to", "g2o"}).exit_code, 2);
  const Outcome picture = cairn({"info", folder_.file("none.png:resolution=0.1")});
  EXPECT_EQ(picture.exit_code, 3);
  EXPECT_THAT(folder_.contents(), ::testing::IsEmpty());
}

}  // namespace
}  // namespace cairn::test
