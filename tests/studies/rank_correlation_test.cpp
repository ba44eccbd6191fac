// SPDX-License-Identifier: BSD-3-Clause
#include "rank_correlation.hpp"

#include <array>
#include <cmath>

#include <gtest/gtest.h>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

TEST(KendallTau, IsOneForTheSameOrderAndMinusOneForTheOpposite) {
  const std::array a{1.0, 2.0, 5.0, 9.0}, b{-3.0, 0.0, 0.5, 100.0}, c{4.0, 3.0, 2.0, 1.0};
  EXPECT_EQ(kendall_tau(a, b), 1.0);
  EXPECT_EQ(kendall_tau(a, c), -1.0);
}

TEST(KendallTau, CountsPairs) {
  // Of six pairs one, (2, 3), is in the other order.
  const std::array a{1.0, 2.0, 3.0, 4.0}, b{1.0, 3.0, 2.0, 4.0};
  EXPECT_DOUBLE_EQ(kendall_tau(a, b), 4.0 / 6.0);
}

TEST(KendallTau, TiesCountInNeitherOrder) {
  // Pairs: five concordant, one tied in b.
  const std::array a{1.0, 2.0, 3.0, 4.0}, b{1.0, 2.0, 2.0, 4.0};
  EXPECT_DOUBLE_EQ(kendall_tau(a, b), 5.0 / std::sqrt(6.0 * 5.0));
  const std::array same{7.0, 7.0, 7.0, 7.0};
  EXPECT_TRUE(std::isnan(kendall_tau(a, same)));
}

TEST(KendallTau, RefusesDifferentSizes) {
  const std::array a{1.0, 2.0};
  const std::array b{1.0, 2.0, 3.0};
  EXPECT_THROW(kendall_tau(a, b), Error);
}

}  // namespace
}  // namespace cairn
