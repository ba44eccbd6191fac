// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/runtime/aligned.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
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
  for (const std::size_t edge : {std::size_t{4096}, std::size_t{1} << 21, std::size_t{5} << 20}) {
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

}  // namespace
}  // namespace cairn::test
