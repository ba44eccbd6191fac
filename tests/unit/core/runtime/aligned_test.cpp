// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/runtime/aligned.hpp"

#include <gtest/gtest.h>

#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <numeric>
#include <random>
#include <thread>
#include <utility>
#include <vector>

namespace cairn::test {
namespace {

bool starts_a_cache_line(const void* memory) {
  return reinterpret_cast<std::uintptr_t>(memory) % 64 == 0;
}

/// Sizes on both sides of where the way of allocating changes, and a few huge pages.
std::vector<std::size_t> sizes() {
  std::vector<std::size_t> all(300);
  std::iota(all.begin(), all.end(), std::size_t{0});
  for (const std::size_t edge : {std::size_t{1} << 12, std::size_t{1} << 14, std::size_t{1} << 20,
                                 std::size_t{1} << 21, std::size_t{5} << 20}) {
    for (const std::size_t size : {edge - 1, edge, edge + 1}) all.push_back(size);
  }
  return all;
}

TEST(AlignedMemory, StartsACacheLineAndIsThereToItsLastByteWhateverItsSize) {
  std::vector<std::pair<unsigned char*, std::size_t>> arrays;
  for (const std::size_t bytes : sizes()) {
    auto* const array = static_cast<unsigned char*>(allocate_aligned(bytes));
    EXPECT_TRUE(starts_a_cache_line(array)) << bytes;
    std::fill_n(array, bytes, static_cast<unsigned char>(bytes));
    arrays.emplace_back(array, bytes);
  }
  for (const auto& [array, bytes] : arrays) {  // none overlaps another
    const auto mark = static_cast<unsigned char>(bytes);
    EXPECT_EQ(std::count(array, array + bytes, mark), static_cast<std::ptrdiff_t>(bytes));
    release_aligned(array, bytes);
  }
}

TEST(AlignedMemory, HoldsAVectorThatGrows) {
  AlignedVector numbers;
  for (int k = 0; k < 3000; ++k) {
    numbers.push_back(k);
    ASSERT_TRUE(starts_a_cache_line(numbers.data())) << k;
  }
  for (int k = 0; k < 3000; ++k) EXPECT_EQ(numbers[k], k);
}

/// Arrays of random sizes, some of them huge pages, that come and go; each is full of its number.
void juggle(unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::pair<unsigned char*, std::size_t>> arrays(40);
  for (int k = 0; k < 400; ++k) {
    auto& [array, bytes] = arrays[random() % arrays.size()];
    const auto mark = static_cast<unsigned char>(bytes);
    ASSERT_EQ(std::count(array, array + bytes, mark), static_cast<std::ptrdiff_t>(bytes));
    if (array) release_aligned(array, bytes);
    bytes = std::size_t{1} << random() % 22U;
    bytes += random() % bytes;
    array = static_cast<unsigned char*>(allocate_aligned(bytes));
    ASSERT_TRUE(starts_a_cache_line(array)) << bytes;
    std::fill_n(array, bytes, static_cast<unsigned char>(bytes));
  }
  for (const auto& [array, bytes] : arrays) release_aligned(array, bytes);
}

TEST(AlignedMemory, IsNobodyElsesWhateverComesAndGoesInSeveralThreads) {
  std::vector<std::jthread> threads;
  for (unsigned seed = 1; seed <= 4; ++seed) threads.emplace_back(juggle, seed);
}

/// Memory of this process that is in use, in bytes.
std::int64_t resident() {
  std::ifstream file("/proc/self/statm");
  std::int64_t all = 0, pages = 0;
  file >> all >> pages;
  return pages * ::sysconf(_SC_PAGESIZE);
}

TEST(AlignedMemory, GoesBackToTheSystemOnceItIsReleased) {
  constexpr std::size_t kBytes = 300000, kCount = 400;
  const std::int64_t before = resident();
  std::vector<void*> arrays;
  for (std::size_t k = 0; k < kCount; ++k) {
    arrays.push_back(allocate_aligned(kBytes));
    std::fill_n(static_cast<unsigned char*>(arrays.back()), kBytes, static_cast<unsigned char>(k));
  }
  const std::int64_t most = resident() - before;
  EXPECT_GT(most, static_cast<std::int64_t>(kBytes * kCount / 2));
  for (void* array : arrays) release_aligned(array, kBytes);
#if !defined(CAIRN_SANITIZED)  // sanitizers keep what was released, to notice its use
  EXPECT_LT(resident() - before, most / 4);
#endif
}

}  // namespace
}  // namespace cairn::test
