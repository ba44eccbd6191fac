// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/memory/growing_array.hpp"

#include <gtest/gtest.h>

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <limits>
#include <new>
#include <numeric>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "cairn/runtime/aligned.hpp"

namespace cairn::test {
namespace {

bool starts_a_cache_line(const void* memory) {
  return reinterpret_cast<std::uintptr_t>(memory) % 64 == 0;
}

/// Numbers from `first` on.
std::vector<std::int32_t> count_from(std::int32_t first, std::size_t count) {
  std::vector<std::int32_t> numbers(count);
  std::iota(numbers.begin(), numbers.end(), first);
  return numbers;
}

TEST(GrowingArray, IsAVectorWhateverItsSize) {
  GrowingArray<std::int32_t> array;
  std::vector<std::int32_t> expected;
  EXPECT_TRUE(array.empty());
  std::mt19937 random(1);
  // To 8 MB: through every way of allocating.
  for (std::int32_t next = 0; expected.size() < (std::size_t{1} << 21);) {
    if (random() % 2 == 0) {
      array.push_back(next);
      expected.push_back(next++);
    } else {
      const std::vector<std::int32_t> more = count_from(next, random() % (expected.size() + 2));
      array.append(more);
      expected.insert(expected.end(), more.begin(), more.end());
      next += static_cast<std::int32_t>(more.size());
    }
    ASSERT_EQ(array.size(), expected.size());
    ASSERT_TRUE(starts_a_cache_line(array.data()));
  }
  EXPECT_TRUE(std::ranges::equal(array, expected));

  const GrowingArray<std::int32_t> copy = array;
  EXPECT_EQ(copy.capacity(), copy.size());
  array.resize(10);
  EXPECT_EQ(array.size(), 10);
  array.resize(12);
  EXPECT_EQ(array[9], 9);
  EXPECT_EQ(array[10], 0) << "and not what was there";
  EXPECT_TRUE(std::ranges::equal(copy, expected)) << "a copy is of its own";
  GrowingArray<std::int32_t> moved = std::move(array);
  EXPECT_EQ(moved.size(), 12);
  moved = copy;
  moved.push_back(-1);
  EXPECT_EQ(moved.back(), -1);
  EXPECT_EQ(moved.size(), expected.size() + 1);
  EXPECT_TRUE(std::ranges::equal(std::span(moved).first(expected.size()), expected));
}

/// Pages that this process has touched for the first time while `action` ran.
template <class Action>
long page_faults(const Action& action) {
  rusage before{}, after{};
  ::getrusage(RUSAGE_SELF, &before);
  action();
  ::getrusage(RUSAGE_SELF, &after);
  return after.ru_minflt - before.ru_minflt;
}

TEST(GrowingArray, MovesByItsPagesWhereItIsLarge) {
#if defined(CAIRN_SANITIZED)
  GTEST_SKIP() << "sanitizers watch over memory of their own";
#endif
  constexpr std::size_t kSize = std::size_t{1} << 23;  // 64 MB
  GrowingArray<double> array;
  array.resize(kSize);
  array.back() = 17.0;
  AlignedVector copied(array.begin(), array.end());
  EXPECT_LT(page_faults([&] { array.reserve(2 * kSize); }), 10);
  EXPECT_GT(page_faults([&] { copied.reserve(2 * kSize); }), 25) << "of 2 MB: so it can be seen";
  EXPECT_EQ(array.size(), kSize);
  EXPECT_EQ(array.back(), 17.0);
}

TEST(GrowingArray, TakesValuesOfItsOwn) {
  for (const std::size_t size : {1, 3, 100, 20000, 300000}) {
    GrowingArray<double> array;
    std::vector<double> expected(size);
    std::iota(expected.begin(), expected.end(), 1.0);
    array.append(expected);
    array.append(array);  // a copy has no room to spare: it moves
    expected.insert(expected.end(), expected.begin(), expected.begin() + std::ptrdiff_t(size));
    ASSERT_TRUE(std::ranges::equal(array, expected)) << size;
    const auto part = std::span<const double>(array).subspan(size / 2, size);
    const std::vector<double> middle(part.begin(), part.end());
    array.append(part);
    ASSERT_TRUE(std::ranges::equal(std::span<const double>(array).last(size), middle)) << size;
    array.push_back(array.front());
    ASSERT_EQ(array.back(), 1.0);
  }
}

TEST(GrowingArray, RefusesWhatNoMemoryHolds) {
  GrowingArray<double> array;
  array.resize(3);
  constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();
  for (const std::size_t size : {kAll, kAll / 8, kAll / 8 + 2, kAll / 16}) {
    EXPECT_THROW(array.reserve(size), std::bad_alloc) << size;
    EXPECT_THROW(array.resize(size), std::bad_alloc) << size;
  }
  EXPECT_EQ(array.size(), 3);
  array.push_back(17.0);
  EXPECT_EQ(array.back(), 17.0);
}

TEST(GrowingArray, TakesWhatItNeedsWhereTwiceAsMuchIsRefused) {
#if defined(CAIRN_SANITIZED)
  GTEST_SKIP() << "sanitizers take address space of their own";
#endif
  constexpr std::size_t kSize = std::size_t{1} << 23;  // 64 MB
  const auto grow = [] {
    GrowingArray<double> array;
    array.resize(kSize);
    array.back() = 17.0;
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    const rlim_t now = pages * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE));
    rlimit limit{};
    ::getrlimit(RLIMIT_AS, &limit);
    limit.rlim_cur = now + (rlim_t{32} << 20);
    if (::setrlimit(RLIMIT_AS, &limit) != 0) std::_Exit(2);
    array.push_back(1.0);
    const bool fits = array.capacity() < kSize + kSize / 2 && array[kSize - 1] == 17.0;
    try {
      array.reserve(2 * kSize);
    } catch (const std::bad_alloc&) {
      std::_Exit(fits && array.size() == kSize + 1 && array.back() == 1.0 ? 0 : 3);
    }
    std::_Exit(4);
  };
  EXPECT_EXIT(grow(), testing::ExitedWithCode(0), "");
}

TEST(GrowingArray, CopiesLieInHugePages) {
#if defined(CAIRN_SANITIZED)
  GTEST_SKIP() << "sanitizers watch over memory of their own";
#endif
  constexpr std::size_t kBytes = std::size_t{8} << 20;
  const long pages = page_faults([] {
    void* const memory = allocate_aligned(kBytes);  // of huge pages, where there are any
    std::memset(memory, 1, kBytes);
    release_aligned(memory, kBytes);
  });
  if (pages > 100) GTEST_SKIP() << "the system has no huge pages: " << pages << " were touched";
  GrowingArray<double> array;
  array.resize(kBytes / sizeof(double));
  EXPECT_LT(page_faults([&] { const GrowingArray<double> copy = array; }), pages + 50);
}

}  // namespace
}  // namespace cairn::test
