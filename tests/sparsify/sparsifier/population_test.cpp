// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/runtime/error.hpp"
#include "cairn/sparsification/sparsification.hpp"

namespace cairn {
namespace {

using testing::AllOf;
using testing::HasSubstr;

int count(const std::string& text, int nodes) { return Population::parse(text).count(nodes); }

TEST(Population, CountsFactors) {
  EXPECT_EQ(count("tree:1", 6), 5);
  EXPECT_EQ(count("tree:2", 6), 10);
  EXPECT_EQ(count("tree:1.5", 6), 8);  // 7.5
  EXPECT_EQ(count("tree:1.5", 5), 6);
  EXPECT_EQ(count("fill:1", 6), 15);
  EXPECT_EQ(count("fill:0.5", 8), 14);
  EXPECT_EQ(count("fill:0.6", 6), 9);
  EXPECT_EQ(count("loss:0.01", 6), 5);
}

TEST(Population, IsNeverLessThanATreeNorMoreThanAllPairs) {
  for (int nodes = 2; nodes < 40; ++nodes) {
    const int tree = nodes - 1, all = nodes * (nodes - 1) / 2;
    EXPECT_EQ(count("fill:0.000001", nodes), tree);
    EXPECT_EQ(count("tree:1", nodes), tree);
    EXPECT_EQ(count("tree:1000", nodes), all);
    EXPECT_EQ(count("tree:1e300", nodes), all);
    EXPECT_EQ(count("fill:1", nodes), all);
    EXPECT_EQ(count("loss:0", nodes), tree);
    EXPECT_EQ(count("tree:2", nodes), std::min(2 * tree, all));
  }
}

TEST(Population, SaysWhatItExpected) {
  for (const std::string text :
       {"", "tree", "tree:", "tree:0.99", "tree:two", "tree:2x", "tree: 2", "tree:nan", "tree:inf",
        "fill:0", "fill:1.01", "fill:-1", "loss:-0.1", "loss:inf", "bush:2", ":2", "Tree:2"}) {
    try {
      Population::parse(text);
      FAIL() << "'" << text << "' was taken";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::usage);
      EXPECT_THAT(error.what(), AllOf(HasSubstr("'" + text + "'"), HasSubstr("tree:"),
                                      HasSubstr("fill:"), HasSubstr("loss:")));
    }
  }
}

TEST(Population, KeepsKindAndValue) {
  const Population loss = Population::parse("loss:0.25");
  EXPECT_EQ(loss.kind, Population::Kind::loss);
  EXPECT_EQ(loss.value, 0.25);
  EXPECT_EQ(Population::parse("fill:1e-1").kind, Population::Kind::fill);
  EXPECT_EQ(Population::parse("fill:1e-1").value, 0.1);
}

}  // namespace
}  // namespace cairn
