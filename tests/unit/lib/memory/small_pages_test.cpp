// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/memory/small_pages.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <thread>
#include <vector>

#include "cairn/memory/growing_array.hpp"
#include "cairn/runtime/aligned.hpp"
#include "support/advised_pages.hpp"

namespace cairn::test {
namespace {

/// Whether an array of so many doubles lies in huge pages.
bool is_in_huge_pages(std::size_t doubles) {
  const AlignedVector array(doubles, 1.0);
  return *advised_to_be_huge(array.data() + doubles / 2);
}

class SmallPages : public testing::Test {
 protected:
  void SetUp() override {
#if defined(CAIRN_SANITIZED)
    GTEST_SKIP() << "every array is by itself";
#endif
    if (!advised_to_be_huge(AlignedVector(kSeveral).data()))
      GTEST_SKIP() << "this system does not say";
  }

  static constexpr std::size_t kSeveral = std::size_t{1} << 20;  // doubles: 8 MB
};

TEST_F(SmallPages, AreThoseOfLargeArraysWhileThereIsOne) {
  EXPECT_TRUE(is_in_huge_pages(kSeveral));
  {
    const memory::SmallPages small;
    EXPECT_FALSE(is_in_huge_pages(kSeveral));
    { const memory::SmallPages more; }
    EXPECT_FALSE(is_in_huge_pages(kSeveral));
  }
  EXPECT_TRUE(is_in_huge_pages(kSeveral));
}

TEST_F(SmallPages, AreThoseOfOneThread) {
  const memory::SmallPages small;
  bool huge = false;
  std::thread([&] { huge = is_in_huge_pages(kSeveral); }).join();
  EXPECT_TRUE(huge);
}

/// Arrays that share pages, some of them huge: each keeps its numbers, whenever it is given back.
TEST_F(SmallPages, AreSharedWithNothingInHugePages) {
  std::vector<AlignedVector> huge, small;
  for (int k = 0; k < 200; ++k) {
    huge.emplace_back(3000 + k, k);
    EXPECT_TRUE(*advised_to_be_huge(huge.back().data()));
    const memory::SmallPages pages;
    small.emplace_back(3000 + k, -k);
    EXPECT_FALSE(*advised_to_be_huge(small.back().data()));
    if (k % 3 == 0) huge[k / 2] = AlignedVector(4000, k / 2);
  }
  for (int k = 0; k < 200; ++k) {
    EXPECT_EQ(huge[k], AlignedVector(huge[k].size(), k));
    EXPECT_EQ(small[k], AlignedVector(3000 + k, -k));
    if (k % 2 == 0) huge[k] = {};
    if (k % 3 == 0) small[k] = {};
  }
  for (int k = 0; k < 200; ++k) {
    if (k % 2 != 0) {
      EXPECT_EQ(huge[k], AlignedVector(huge[k].size(), k));
    }
    if (k % 3 != 0) {
      EXPECT_EQ(small[k], AlignedVector(3000 + k, -k));
    }
  }
}

TEST_F(SmallPages, AreThoseOfAnArrayThatBeginsLarge) {
  const std::vector<double> numbers(kSeveral, 1.0);
  GrowingArray<double> huge;
  huge.append(numbers);
  EXPECT_TRUE(*advised_to_be_huge(huge.data()));
  const memory::SmallPages pages;
  GrowingArray<double> small;
  small.append(numbers);
  EXPECT_FALSE(*advised_to_be_huge(small.data()));
}

}  // namespace
}  // namespace cairn::test
