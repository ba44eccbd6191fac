// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/text/spelling.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace cairn {
namespace {

const std::vector<std::string> kNames = {"cholmod", "eigen", "block_cholesky"};

TEST(Spelling, FindsTheNearestName) {
  EXPECT_EQ(nearest_spelling("colmod", kNames), "cholmod");
  EXPECT_EQ(nearest_spelling("eigne", kNames), "eigen");
  EXPECT_EQ(nearest_spelling("Block-Cholesky", kNames), "block_cholesky");
}

TEST(Spelling, KnowsInitialsAndParts) {
  const std::vector<std::string> optimizers{"ceres", "gauss_newton", "levenberg_marquardt"};
  EXPECT_EQ(nearest_spelling("lm", optimizers), "levenberg_marquardt");
  EXPECT_EQ(nearest_spelling("gn", optimizers), "gauss_newton");
  EXPECT_EQ(nearest_spelling("newton", optimizers), "gauss_newton");
  EXPECT_EQ(nearest_spelling("cholesky", kNames), "block_cholesky");
  EXPECT_EQ(nearest_spelling("--solver", std::vector<std::string>{"--to", "--linear-solver"}),
            "--linear-solver");
}

TEST(Spelling, CompletesATagBeforeItsColon) {
  const std::vector<std::string> tags{"EDGE_SE2", "EDGE_SE3:QUAT", "VERTEX_SE3:QUAT"};
  EXPECT_EQ(nearest_spelling("EDGE_SE3", tags), "EDGE_SE3:QUAT");
  EXPECT_EQ(nearest_spelling("EDGE_SE", tags), "EDGE_SE2");
}

TEST(Spelling, KnowsTheOneNameThatSharesAPart) {
  const std::vector<std::string> options{"initial_lambda", "max_iterations", "tolerance"};
  for (const char* word : {"iterations", "iteration_limit", "num_iterations", "max-iteration"})
    EXPECT_EQ(nearest_spelling(word, options), "max_iterations") << word;
  EXPECT_EQ(nearest_spelling("relative_tolerance", options), "tolerance");
  EXPECT_EQ(nearest_spelling("max_seconds", options), "");  // "max" is too short to mean anything
  const std::vector<std::string> tags{"EDGE_SE2_XY", "EDGE_SE3_TRACKXYZ", "VERTEX_XY"};
  EXPECT_EQ(nearest_spelling("EDGE_OF_ANOTHER_KIND", tags), "");  // several share that much
}

TEST(Spelling, DoesNotGuessWildly) { EXPECT_EQ(nearest_spelling("mumps", kNames), ""); }

TEST(Spelling, DoesNotCompareWhatIsLongerThanAnyName) {
  const std::vector<std::string> names{std::string(100, 'a'), std::string(101, 'a')};
  EXPECT_EQ(nearest_spelling(std::string(100, 'a'), names), names[0]);
  EXPECT_EQ(nearest_spelling(std::string(101, 'a'), names), "");
}

TEST(Spelling, AlwaysNamesWhatIsOnOffer) {
  EXPECT_EQ(what_is_on_offer("mumps", kNames), "; on offer: cholmod, eigen, block_cholesky");
  EXPECT_EQ(what_is_on_offer("eigne", kNames),
            "; did you mean 'eigen'? (on offer: cholmod, eigen, block_cholesky)");
  EXPECT_EQ(what_is_on_offer("x", {}), "; none is on offer");
}

}  // namespace
}  // namespace cairn
