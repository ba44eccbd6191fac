// SPDX-License-Identifier: BSD-3-Clause
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "exploration/commands/exploration_commands.hpp"

namespace cairn::test {
namespace {

using ::testing::HasSubstr;

class StudyOptimality : public ExplorationCommands {
 protected:
  void SetUp() override {
    ExplorationCommands::SetUp();
    need({{"registration", "simulated"}, {"linear_solver", "block_cholesky"}});
  }
  static Outcome study(const Arguments& more) {
    return run({"study", "optimality", "--plugin", CAIRN_STUDIES, "@rooms:width=12,height=9,seed=2",
                "--registration", kTrueMatcher},
               more);
  }
};

TEST_F(StudyOptimality, RanksTheSamePathsByBothAndCanBeRepeated) {
  std::vector<double> taus;
  for (const char* name : {"a.json", "b.json"}) {
    const std::string file = folder_.file(name);
    const Outcome run = study({"--poses", "40", "--paths", "30", "--runs", "2", "--json", file});
    ASSERT_EQ(run.exit_code, 0) << run.err;
    EXPECT_THAT(run.out, HasSubstr("Laplacian"));
    const auto said = parse_json(read_text(file)).as_object();
    const auto& sets = said.at("sets").as_array();
    ASSERT_EQ(sets.size(), 2U);
    for (const auto& set : sets) {
      EXPECT_GE(set.at("poses").to_number<int>(), 40);
      EXPECT_EQ(set.at("paths"), 30);
      EXPECT_GT(set.at("motions").to_number<double>(), 1.0);
    }
    taus.push_back(said.at("tau").at("mean").to_number<double>());
    EXPECT_GT(taus.back(), 0.0);
    EXPECT_LE(taus.back(), 1.0);
  }
  EXPECT_EQ(taus[0], taus[1]);
}

TEST_F(StudyOptimality, SaysWhereTheFloorIsTooSmall) {
  const Outcome run = study({"--poses", "100000", "--paths", "5"});
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.err, HasSubstr("was explored before the graph had 100000 poses"));
}

}  // namespace
}  // namespace cairn::test
