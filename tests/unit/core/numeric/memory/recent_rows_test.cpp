// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/memory/recent_rows.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

namespace cairn::test {
namespace {

using Row = std::array<double, 3>;

/// An array whose rows are added unless they are found.
class Rows {
 public:
  std::int32_t add(const Row& row) {
    const std::int32_t found = recent_.find(row, all_);
    if (found >= 0) return found;
    const auto number = static_cast<std::int32_t>(all_.size() / row.size());
    recent_.note(row, number);
    all_.insert(all_.end(), row.begin(), row.end());
    return number;
  }
  Row at(std::int32_t number) const {
    const auto begin = all_.begin() + number * 3;
    return {begin[0], begin[1], begin[2]};
  }
  std::size_t size() const { return all_.size() / 3; }

 private:
  std::vector<double> all_;
  RecentRows recent_;
};

TEST(RecentRows, FindsWhatCameBefore) {
  Rows rows;
  EXPECT_EQ(rows.add({1, 2, 3}), 0);
  EXPECT_EQ(rows.add({3, 2, 1}), 1);
  EXPECT_EQ(rows.add({1, 2, 3}), 0);
  EXPECT_EQ(rows.add({3, 2, 1}), 1);
  EXPECT_EQ(rows.size(), 2U);
}

TEST(RecentRows, DistinguishesZerosBySign) {
  Rows rows;
  rows.add({0.0, 1, 1});
  EXPECT_EQ(rows.add({-0.0, 1, 1}), 1);
}

TEST(RecentRows, NeverTakesOneForAnother) {
  std::mt19937 random(1);
  for (const int kinds : {1, 10, 100, 1000, 100000}) {
    Rows rows;
    std::uniform_int_distribution<int> any(0, kinds - 1);
    for (int k = 0; k < 20000; ++k) {
      const double kind = any(random);
      const Row row{kind, 1.0 / (kind + 1.0), 0.0};
      ASSERT_EQ(rows.at(rows.add(row)), row);
    }
    EXPECT_LE(rows.size(), 20000U);
    if (kinds <= 10) {
      EXPECT_EQ(rows.size(), static_cast<std::size_t>(kinds));
    }
  }
}

TEST(RecentRows, DoesNotFindWhatHasBeenReplaced) {
  std::vector<double> all{1, 2, 3};
  RecentRows recent;
  recent.note(std::array{1.0, 2.0, 3.0}, 0);
  EXPECT_EQ(recent.find(std::array{1.0, 2.0, 3.0}, all), 0);
  all[1] = 5.0;
  EXPECT_EQ(recent.find(std::array{1.0, 2.0, 3.0}, all), -1);
  all.clear();
  EXPECT_EQ(recent.find(std::array{1.0, 2.0, 3.0}, all), -1);
}

}  // namespace
}  // namespace cairn::test
