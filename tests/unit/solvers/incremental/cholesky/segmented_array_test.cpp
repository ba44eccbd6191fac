// SPDX-License-Identifier: BSD-3-Clause
#include "segmented_array.hpp"

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

namespace cairn::incremental {
namespace {

struct Taken {
  std::int64_t place;
  std::size_t doubles;
  double value;
};

void fill(SegmentedArray& values, const Taken& taken) {
  for (std::size_t k = 0; k < taken.doubles; ++k) values.at(taken.place)[k] = taken.value;
}

bool holds(const SegmentedArray& values, const Taken& taken, double value) {
  for (std::size_t k = 0; k < taken.doubles; ++k) {
    if (values.at(taken.place)[k] != value) return false;
  }
  return true;
}

// Arrays of many lengths, some longer than a segment: each begins with zeros, none overlaps
// another.
TEST(SegmentedArray, ArraysKeepWhatIsWrittenToThem) {
  SegmentedArray values;
  std::vector<Taken> all;
  std::int64_t doubles = 0;
  for (int k = 0; k < 5000; ++k) {
    const std::size_t length = k % 1000 == 999 ? 100000 : static_cast<std::size_t>(k % 97);
    const Taken taken{values.take(length), length, 1.0 + k};
    ASSERT_TRUE(holds(values, taken, 0.0)) << k;
    fill(values, taken);
    all.push_back(taken);
    doubles += static_cast<std::int64_t>(length);
  }
  EXPECT_EQ(values.size(), doubles);
  for (const Taken& taken : all) EXPECT_TRUE(holds(values, taken, taken.value)) << taken.value;

  SegmentedArray copy = values;
  values.fill_with_zeros();
  for (const Taken& taken : all) {
    EXPECT_TRUE(holds(values, taken, 0.0)) << taken.value;
    EXPECT_TRUE(holds(copy, taken, taken.value)) << taken.value;
  }
}

// A segment that is full to the last double; nothing after it; one that is longer before all
// others.
TEST(SegmentedArray, FullSegmentsAndLongFirstOnes) {
  SegmentedArray values;
  const Taken full{values.take(32768), 32768, 1.0}, none{values.take(0), 0, 2.0};
  const Taken next{values.take(3), 3, 3.0};
  for (const Taken& taken : {full, none, next}) fill(values, taken);
  EXPECT_TRUE(holds(values, full, 1.0) && holds(values, next, 3.0));
  SegmentedArray longer;
  const Taken first{longer.take(70000), 70000, 4.0}, second{longer.take(5), 5, 5.0};
  for (const Taken& taken : {first, second}) fill(longer, taken);
  EXPECT_TRUE(holds(longer, first, 4.0) && holds(longer, second, 5.0));
  EXPECT_EQ(longer.size(), 70005);
}

// Past the first segment nothing moves, which is what it is for.
TEST(SegmentedArray, LargeOnesAreNotCopiedWhenTheyGrow) {
  SegmentedArray values;
  std::vector<std::pair<std::int64_t, const double*>> found;
  for (int k = 0; k < 100000; ++k) {
    const std::int64_t place = values.take(30);
    if (k > 2000) found.emplace_back(place, values.at(place));
  }
  for (const auto& [place, address] : found) ASSERT_EQ(values.at(place), address);
}

}  // namespace
}  // namespace cairn::incremental
