// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/text/spelling.hpp"

#include <algorithm>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace cairn {
namespace {

/// Optimal string alignment distance by its definition, of all beginnings.
int distance(std::string_view a, std::string_view b) {
  std::vector<std::vector<int>> d(a.size() + 1, std::vector<int>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) {
    for (std::size_t j = 0; j <= b.size(); ++j) {
      d[i][j] = static_cast<int>(i + j);
      if (i == 0 || j == 0) continue;
      d[i][j] = std::min(
          {d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  }
  return d[a.size()][b.size()];
}

class RandomWords {
 public:
  int below(std::size_t count) { return static_cast<int>(random_() % count); }
  char letter() { return "ab1_"[below(4)]; }
  std::string word() {
    std::string made(1 + below(30), '1');
    for (char& c : made) c = letter();
    return made;
  }
  /// With up to so many slips.
  std::string misspelt(std::string word, int slips) {
    for (int k = below(slips + 1); k > 0; --k) {
      const int at = below(word.size() + 1), before_last = static_cast<int>(word.size()) - 2;
      switch (below(4)) {
        case 0:
          word.insert(at, 1, letter());
          break;
        case 1:
          word.replace(at, 1, 1, letter());
          break;
        case 2:
          word.erase(at, 1);
          break;
        default:
          if (at <= before_last) std::swap(word[at], word[at + 1]);
      }
    }
    return word;
  }

 private:
  std::mt19937 random_;
};

const std::vector<std::string> kNames = {"cholmod", "eigen", "block_cholesky"};

TEST(Spelling, FindsTheNearestName) {
  EXPECT_EQ(nearest_spelling("colmod", kNames), "cholmod");
  EXPECT_EQ(nearest_spelling("eigne", kNames), "eigen");
  EXPECT_EQ(nearest_spelling("Block-Cholesky", kNames), "block_cholesky");
}

TEST(Spelling, FindsTheNearestOfRandomNames) {
  RandomWords words;
  int found = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    const std::string word = words.word();
    std::vector<std::string> names;
    for (int k = 0; k < 8; ++k) names.push_back(words.misspelt(word, 15));
    const auto from_word = [&word](const std::string& name) { return distance(word, name); };
    const auto nearest = std::ranges::min_element(names, {}, from_word);  // the first of equals
    if (from_word(*nearest) > std::max(2, static_cast<int>(word.size()) / 3)) continue;
    EXPECT_EQ(nearest_spelling(word, names), *nearest) << word;
    ++found;
  }
  EXPECT_GT(found, 500);
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
