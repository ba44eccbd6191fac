// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/memory/small_pages.hpp"

#include <gtest/gtest.h>

#include <sys/resource.h>

#include <algorithm>
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

/// Arrays that share pages of both kinds: each keeps its numbers, whenever it is given back, and
/// none of a limited part takes a new huge page.
TEST_F(SmallPages, ShareWhatThereIsButTakeNothingHuge) {
  std::vector<AlignedVector> huge, small;
  for (int k = 0; k < 200; ++k) {
    huge.emplace_back(3000 + k, k);
    const std::size_t before = bytes_advised_to_be_huge();
    const memory::SmallPages pages;
    small.emplace_back(3000 + k, -k);
    EXPECT_LE(bytes_advised_to_be_huge(), before);  // what others gave back may go meanwhile
    if (k % 3 == 0) huge[static_cast<std::size_t>(k) / 2] = AlignedVector(4000, k);
  }
  const auto check = [&] {
    for (int k = 0; k < 200; ++k) {
      const AlignedVector &one = huge[static_cast<std::size_t>(k)],
                          &other = small[static_cast<std::size_t>(k)];
      EXPECT_EQ(std::ranges::count(one, one.empty() ? 0.0 : one.front()), std::ssize(one));
      EXPECT_EQ(std::ranges::count(other, -k), std::ssize(other));
    }
  };
  check();
  for (std::size_t k = 0; k < 200; ++k) {
    if (k % 2 == 0) huge[k] = {};
    if (k % 3 == 0) small[k] = {};
  }
  check();
}

/// Pages that nobody uses are kept for the next array, whichever kind was used last.
TEST_F(SmallPages, AreTouchedOnce) {
  constexpr std::size_t kSome = 5000;  // doubles: 40 KB, for which pages are shared
  const auto faults_of_use = [] {
    rusage before{}, after{};
    ::getrusage(RUSAGE_SELF, &before);
    for (int k = 0; k < 100; ++k) const AlignedVector array(kSome, 1.0);
    ::getrusage(RUSAGE_SELF, &after);
    return after.ru_minflt - before.ru_minflt;
  };
  // No room is left in what there is already.
  std::vector<AlignedVector> all;
  for (int k = 0; k < 400; ++k) all.emplace_back(kSome, 1.0);
  {
    const memory::SmallPages pages;
    for (int k = 0; k < 400; ++k) all.emplace_back(kSome, 1.0);
    faults_of_use();
    EXPECT_LT(faults_of_use(), 10);
  }
  faults_of_use();
  EXPECT_LT(faults_of_use(), 10);
  const memory::SmallPages pages;
  faults_of_use();
  EXPECT_LT(faults_of_use(), 10);
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
