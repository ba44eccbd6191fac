// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/plugin/registry.hpp"
#include "integration/process.hpp"

namespace cairn::test {
namespace {

using ::testing::HasSubstr;

TEST(GenerateCommand, TheSameSeedGivesTheSameFile) {
  const auto made = [](const std::string& seed) {
    const Outcome outcome = cairn(
        {"generate", "manhattan:poses=60", "-o", "-", "--to", "g2o", "--seed", seed, "--quiet"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return outcome.out;
  };
  const std::string one = made("1");
  EXPECT_TRUE(one == made("1"));
  EXPECT_FALSE(one == made("2"));
}

TEST(GenerateCommand, AnAtSignReadsWhatGenerateWrites) {
  const Outcome written =
      cairn({"generate", "manhattan:poses=60", "-o", "-", "--to", "g2o", "--seed", "5", "--quiet"});
  const Outcome read =
      cairn({"convert", "@manhattan:poses=60,seed=5", "-", "--to", "g2o", "--quiet"});
  EXPECT_TRUE(written.out == read.out) << read.err;
  const Outcome bad = cairn({"info", "@manhattan:seed=none"});
  EXPECT_EQ(bad.exit_code, 2);
  EXPECT_THAT(bad.err, HasSubstr("seed is 'none'"));
}

TEST(GenerateCommand, WritesTheGroundTruthBesideTheGraph) {
  const TemporaryFolder folder;
  const Outcome outcome = cairn({"generate", "manhattan:poses=60", "-o", folder.file("graph.g2o"),
                                 "--ground-truth", folder.file("truth.g2o"), "--json", "-"});
  EXPECT_EQ(parse_json(outcome.out).at("graph").at("variables").as_int64(), 60);
  EXPECT_EQ(folder.contents(), (std::vector<std::string>{"graph.g2o", "truth.g2o"}));
  EXPECT_FALSE(read_text(folder.file("graph.g2o")) == read_text(folder.file("truth.g2o")));
}

TEST(GenerateCommand, EveryGeneratorsGraphCanBeOptimised) {
  for (const std::string& name : Registry().names("generator")) {
    const Outcome outcome = cairn({"optimize", "@" + name, "--iterations", "1", "--tolerance", "0",
                                   "--json", "-", "--quiet"});
    EXPECT_EQ(outcome.exit_code, 0) << name << ": " << outcome.err;
    EXPECT_GT(parse_json(outcome.out).at("graph").at("factors").as_int64(), 0) << name;
  }
}

TEST(GenerateCommand, RefusesAKindOrAnOptionThatIsNotOnOffer) {
  const TemporaryFolder folder;
  const Outcome kind = cairn({"generate", "spere", "-o", folder.file("graph.g2o")});
  EXPECT_EQ(kind.exit_code, 5);
  EXPECT_THAT(kind.err, HasSubstr("'sphere'"));
  const Outcome option = cairn({"generate", "ring:posse=3", "-o", folder.file("graph.g2o")});
  EXPECT_EQ(option.exit_code, 2);
  EXPECT_THAT(option.err, HasSubstr("'poses'"));
  EXPECT_EQ(cairn({"generate", "ring"}).exit_code, 2);
  EXPECT_TRUE(folder.contents().empty());
}

}  // namespace
}  // namespace cairn::test
