// SPDX-License-Identifier: BSD-3-Clause
#include "system.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

namespace cairn::incremental {
namespace {

System system_of(std::initializer_list<std::int32_t> sizes) {
  System system;
  for (const std::int32_t size : sizes) system.add_variable(size);
  return system;
}

TEST(System, NumbersVariablesAndTheirScalarsOneAfterTheOther) {
  const System system = system_of({3, 2, 6});
  EXPECT_EQ(system.variables(), 3);
  EXPECT_EQ(system.scalars(), 11);
  EXPECT_EQ(system.offset(2), 5);
  EXPECT_EQ(system.size(1), 2);
  EXPECT_TRUE(
      std::all_of(system.diagonal(2), system.diagonal(2) + 36, [](double x) { return x == 0.0; }));
}

TEST(System, KeepsABlockAsLongAsAFactorNeedsIt) {
  System system = system_of({3, 2, 6});
  const std::int32_t entry = system.connect(2, 0);
  EXPECT_EQ(system.connect(0, 2), entry);
  EXPECT_EQ(system.find(0, 2), entry);
  EXPECT_EQ(system.find(2, 0), entry);
  ASSERT_EQ(system.links(0).size(), 1U);
  EXPECT_EQ(system.links(0)[0].other, 2);
  system.block(entry)[17] = 5.0;
  system.disconnect(0, 2);
  ASSERT_EQ(system.links(2).size(), 1U);
  EXPECT_EQ(system.block(entry)[17], 5.0);
  system.disconnect(2, 0);
  EXPECT_TRUE(system.links(0).empty());
  EXPECT_TRUE(system.links(2).empty());
}

TEST(System, UsesTheRoomOfABlockThatWentForOneOfItsSize) {
  System system = system_of({3, 2, 2, 3, 6});
  const std::int32_t entry = system.connect(0, 1);
  std::fill_n(system.block(entry), 6, 4.0);
  const std::int64_t doubles = system.doubles();
  system.disconnect(1, 0);
  const std::int32_t again = system.connect(2, 3);
  EXPECT_EQ(system.doubles(), doubles);
  for (int k = 0; k < 6; ++k) EXPECT_EQ(system.block(again)[k], 0.0);
  system.connect(0, 1);
  EXPECT_EQ(system.doubles(), doubles + 6);
}

TEST(System, ClearsValuesAndKeepsBlocks) {
  System system = system_of({1, 2});
  const std::int32_t entry = system.connect(0, 1);
  system.block(entry)[1] = system.diagonal(1)[3] = system.g(1)[1] = 3.0;
  system.clear_values();
  EXPECT_EQ(system.find(1, 0), entry);
  EXPECT_EQ(system.block(entry)[1], 0.0);
  EXPECT_EQ(system.diagonal(1)[3], 0.0);
  EXPECT_EQ(system.g(1)[1], 0.0);
}

TEST(System, HasTheBlocksOfWhateverCameAndWent) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    std::mt19937 rng(seed);
    System system;
    std::map<std::pair<int, int>, int> factors;  // and how many there are on a pair
    std::map<std::pair<int, int>, double> written;
    for (int k = 0; k < 400; ++k) {
      if (k < 3 || rng() % 20 == 0) system.add_variable(1 + static_cast<std::int32_t>(rng() % 6));
      const int a = static_cast<int>(rng() % system.variables()),
                b = static_cast<int>(rng() % system.variables());
      if (a == b) continue;
      const std::pair pair = std::minmax(a, b);
      const int doubles = system.size(a) * system.size(b);
      if (factors[pair] > 0 && rng() % 2 == 0) {
        system.disconnect(a, b);
        --factors[pair];
      } else {
        const std::int32_t entry = system.connect(a, b);
        if (factors[pair]++ == 0) {
          ASSERT_EQ(system.block(entry)[doubles - 1], 0.0) << "seed " << seed;
          written[pair] = k;
          std::fill_n(system.block(entry), doubles, k);
        }
      }
    }
    std::size_t links = 0, pairs = 0;
    for (int v = 0; v < system.variables(); ++v) links += system.links(v).size();
    for (const auto& [pair, count] : factors) {
      if (count == 0) continue;
      ++pairs;
      const double* block = system.block(system.find(pair.second, pair.first));
      const int doubles = system.size(pair.first) * system.size(pair.second);
      for (int i = 0; i < doubles; ++i) ASSERT_EQ(block[i], written[pair]) << "seed " << seed;
    }
    EXPECT_EQ(links, 2 * pairs) << "seed " << seed;
  }
}

}  // namespace
}  // namespace cairn::incremental
