// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "exploration/commands/exploration_commands.hpp"

namespace cairn::test {
namespace {

using ::testing::HasSubstr;

class StudyObjective : public ExplorationCommands {
 protected:
  void SetUp() override {
    ExplorationCommands::SetUp();
    need({{"registration", "icp"}});
  }
};

TEST_F(StudyObjective, ComparesEachFormOnTheSamePathsAndCanBeRepeated) {
  const std::string report = folder_.file("tau.json"), first = folder_.file("a.csv"),
                    second = folder_.file("b.csv");
  for (const std::string& paths : {first, second}) {
    const Outcome run =
        cairn({"study", "objective", "--plugin", CAIRN_STUDIES, "@rooms:width=10,height=8,seed=2",
               "--distance", "10", "--decisions", "2", "--candidates", "4", "--samples", "4",
               "--paths", paths, "--json", report});
    ASSERT_EQ(run.exit_code, 0) << run.err;
    EXPECT_THAT(run.out, HasSubstr("alpha=end,reference=cell,power=1"));
  }
  EXPECT_EQ(read_text(first), read_text(second));
  const std::string rows = read_text(first);
  EXPECT_EQ(std::ranges::count(rows, '\n'), 1 + 2 * 4);

  const auto said = parse_json(read_text(report)).as_object();
  EXPECT_EQ(said.at("sets"), 2);
  const auto& forms = said.at("rows").as_array();
  EXPECT_EQ(forms.size(), 13U);
  for (const auto& form : forms) {
    const double tau = form.at("tau").at("mean").to_number<double>();
    EXPECT_GE(tau, -1.0);
    EXPECT_LE(tau, 1.0);
  }
}

TEST_F(StudyObjective, RefusesLessThanTwoSamples) {
  const Outcome run =
      cairn({"study", "objective", "--plugin", CAIRN_STUDIES, "@rooms", "--samples", "1"});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, HasSubstr("--samples"));
}

}  // namespace
}  // namespace cairn::test
