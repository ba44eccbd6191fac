// SPDX-License-Identifier: BSD-3-Clause
#include "lazy_greedy.hpp"

#include <algorithm>
#include <set>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/pose_world.hpp"

namespace cairn::edges {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

/// How many points the sets cover: submodular, and with many ties.
class Coverage {
 public:
  explicit Coverage(std::vector<std::set<int>> sets) : sets_(std::move(sets)) {}
  double gain(int k) {
    ++evaluated_;
    return static_cast<double>(std::ranges::count_if(
        sets_[static_cast<std::size_t>(k)], [&](int point) { return !covered_.contains(point); }));
  }
  void add(int k) {
    covered_.insert(sets_[static_cast<std::size_t>(k)].begin(),
                    sets_[static_cast<std::size_t>(k)].end());
  }
  Increments increments() {
    return {.gain = [this](int k) { return gain(k); }, .add = [this](int k) { add(k); }};
  }
  int evaluated() const { return evaluated_; }

 private:
  std::vector<std::set<int>> sets_;
  std::set<int> covered_;
  int evaluated_ = 0;
};

std::vector<int> naive_greedy(int size, int count, Coverage function) {
  std::vector<int> chosen;
  while (static_cast<int>(std::ssize(chosen)) < count) {
    int best = -1;
    double gain = -1.0;
    for (int k = 0; k < size; ++k) {
      if (std::ranges::find(chosen, k) != chosen.end()) continue;
      if (const double of_k = function.gain(k); of_k > gain) {
        gain = of_k;
        best = k;
      }
    }
    function.add(best);
    chosen.push_back(best);
  }
  return chosen;
}

TEST(LazyGreedy, IsTheNaiveOneAndEvaluatesLess) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    test::Draw draw(seed);
    std::vector<std::set<int>> sets(60);
    for (std::set<int>& set : sets) {
      for (int k = 0; k < 8; ++k) set.insert(draw.integer(150));
    }
    Coverage lazy(sets);
    EXPECT_EQ(*lazy_greedy(60, 30, lazy.increments(), {}), naive_greedy(60, 30, Coverage(sets)));
    EXPECT_LT(lazy.evaluated(), 600) << "the naive one takes 1365";
  }
}

TEST(LazyGreedy, TakesAsManyAsThereAre) {
  Coverage function({{1}, {1, 2}, {}});
  EXPECT_THAT(*lazy_greedy(3, 0, function.increments(), {}), IsEmpty());
  EXPECT_THAT(*lazy_greedy(3, 9, function.increments(), {}), ElementsAre(1, 0, 2));
}

TEST(LazyGreedy, EndsWhenItIsInterrupted) {
  Coverage function({{1}, {1, 2}, {3}});
  EXPECT_FALSE(lazy_greedy(3, 3, function.increments(), [](int done, int total) {
    EXPECT_EQ(total, 3);
    return done < 2;
  }));
}

TEST(LazyGreedy, EndsWhileTheFirstGainsAreComputed) {
  Coverage function({{1}, {1, 2}, {3}});
  int calls = 0;
  EXPECT_FALSE(lazy_greedy(3, 3, function.increments(), [&](int, int) { return ++calls < 2; }));
  EXPECT_EQ(function.evaluated(), 1);
}

}  // namespace
}  // namespace cairn::edges
