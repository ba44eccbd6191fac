// SPDX-License-Identifier: BSD-3-Clause
// Every target of ./dev fuzz over its seeds and over all inputs that once were findings
// (tests/fuzz/regressions/TARGET), without a fuzzer.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>

#include <gtest/gtest.h>

#include "fuzz/targets/target.hpp"

namespace cairn::fuzz {
namespace {

namespace fs = std::filesystem;

class FuzzTarget : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    for (const Needed& needed : target_.needs) {
      if (!registry().has(needed.kind, needed.name))
        GTEST_SKIP() << "there is no " << needed.kind << " " << needed.name;
    }
  }
  void run(const std::string& name, std::string_view input) const {
    const Bytes bytes(reinterpret_cast<const std::uint8_t*>(input.data()), input.size());
    EXPECT_NO_THROW(target_.run(bytes)) << target_.name << ", " << name;
  }
  const Target& target_ = target(GetParam());
};

TEST_P(FuzzTarget, HoldsForItsSeeds) {
  const std::vector<std::string> seeds = target_.seeds();
  ASSERT_GT(seeds.size(), 5U);
  for (std::size_t k = 0; k < seeds.size(); ++k) run("seed " + std::to_string(k), seeds[k]);
}

TEST_P(FuzzTarget, HoldsForBeginningsOfItsSeeds) {
  for (const std::string& seed : target_.seeds()) {
    const std::size_t step = std::max<std::size_t>(1, seed.size() / 8);
    for (std::size_t size = 0; size < seed.size(); size += step)
      run("cut after " + std::to_string(size), seed.substr(0, size));
  }
}

TEST_P(FuzzTarget, HoldsForWhatWasFoundBefore) {
  const fs::path folder = fs::path(CAIRN_REGRESSIONS) / target_.name;
  if (!fs::exists(folder)) return;
  std::vector<fs::path> files(fs::directory_iterator(folder), {});
  std::ranges::sort(files);
  for (const fs::path& file : files) {
    std::ifstream in(file, std::ios::binary);
    run(file.filename().string(), std::string(std::istreambuf_iterator<char>(in), {}));
  }
}

std::vector<std::string> names() {
  std::vector<std::string> all;
  for (const Target& target : targets()) all.emplace_back(target.name);
  return all;
}

INSTANTIATE_TEST_SUITE_P(All, FuzzTarget, testing::ValuesIn(names()),
                         [](const auto& named) { return named.param; });

TEST(FuzzTargets, FailWhereAGuaranteeDoesNotHold) {
  EXPECT_THROW(expect(false, [] { return "broken"; }), Finding);
  EXPECT_NO_THROW(expect(true, [] { return "not called"; }));
  EXPECT_THROW(target("none"), std::out_of_range);
}

TEST(FuzzTargets, ReadZerosPastTheEndOfTheirInput) {
  const std::uint8_t bytes[] = {255, 129};
  Source source(bytes);
  EXPECT_EQ(source.below(10), 5);
  EXPECT_EQ(source.unit(), -1.0);
  EXPECT_TRUE(source.empty());
  EXPECT_EQ(source.byte(), 0);
  EXPECT_EQ(source.below(0), 0);
}

}  // namespace
}  // namespace cairn::fuzz
