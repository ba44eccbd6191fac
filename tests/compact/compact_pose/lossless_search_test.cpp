// SPDX-License-Identifier: BSD-3-Clause
// The index, and the test of means alone, lose nothing: what is found is what testing every pose
// finds.
#include <ostream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "compact/support/policy_runs.hpp"

namespace cairn::compact {
namespace {

using test::PolicyRun;
using test::run;
using test::simulate;

struct World {
  std::string name, generator, registration, range;
};
std::ostream& operator<<(std::ostream& out, const World& world) { return out << world.generator; }
const std::vector<World>& worlds() {
  static const std::vector<World> all{
      {"manhattan", "manhattan:poses=300,streets=6", "simulated:range=3", "range=4"},
      {"manhattan_oblong", "manhattan:poses=250,streets=5,rotation_sigma=0.03", "recorded",
       "range=6,range_y=1.5,angle=1"},
      {"sphere", "sphere:turns=8,poses_per_turn=18,radius=8", "simulated:range=5",
       "range=5,angle=0.7"},
      {"ellipse3d", "ellipse3d:translation_sigma=0.02,rotation_sigma=0.01",
       "simulated:range=4,angle=0.6", "range=4,range_z=2,angle=0.6"}};
  return all;
}

class Lossless : public testing::TestWithParam<World> {
 protected:
  void compare(const std::string& options) {
    const auto with = [&](const std::string& search) {
      return run(
          registry, world,
          "compact_pose:reuse=true," + GetParam().range + "," + options + ",search=" + search,
          GetParam().registration);
    };
    const PolicyRun index = with("index"), all = with("all");
    ASSERT_EQ(index.reports.size(), all.reports.size());
    std::int64_t near = 0, tested = 0;
    for (std::size_t k = 0; k < all.reports.size(); ++k) {
      const PoseReport &a = index.reports[k], &b = all.reports[k];
      SCOPED_TRACE(options + ", pose " + std::to_string(b.id));
      near += a.near, tested += b.near;
      ASSERT_EQ(a.candidates, b.candidates);
      ASSERT_EQ(a.kept, b.kept);
      ASSERT_EQ(a.closed_loop, b.closed_loop);
      if (b.candidates > 0) {
        ASSERT_NEAR(a.least_gain, b.least_gain, 1e-9 * (1.0 + b.least_gain));
      }
      ASSERT_EQ(a.links.size(), b.links.size());
      for (std::size_t i = 0; i < b.links.size(); ++i) {
        ASSERT_EQ(a.links[i].earlier, b.links[i].earlier);
        ASSERT_EQ(a.links[i].later, b.links[i].later);
        ASSERT_EQ(a.links[i].verdict, b.links[i].verdict);
        ASSERT_NEAR(a.links[i].gain, b.links[i].gain, 1e-9 * (1.0 + b.links[i].gain));
        ASSERT_NEAR(a.links[i].expected_gain, b.links[i].expected_gain,
                    1e-9 * (1.0 + b.links[i].expected_gain));
      }
      candidates += b.candidates;
    }
    saved += tested - near;
  }

  Registry registry;
  Simulation world = simulate(registry, GetParam().generator);
  std::int64_t candidates = 0, saved = 0;
};
INSTANTIATE_TEST_SUITE_P(Worlds, Lossless, testing::ValuesIn(worlds()),
                         [](const auto& world) { return world.param.name; });

TEST_P(Lossless, ForEveryProbability) {
  for (const char* s :
       {"0", "1e-9", "1e-4", "0.02", "0.1", "0.3", "0.4999", "0.5", "0.5001", "0.7", "0.95", "1"})
    compare(std::string("probability=") + s);
  EXPECT_GT(candidates, 1000);
  EXPECT_GT(saved, 1000);
}

TEST_P(Lossless, ForEveryTestOfRotations) {
  for (const std::string rotation : {"elements", "magnitude", "view,view_axis=x", "view"}) {
    compare("rotation=" + rotation + ",probability=0.05");
    compare("rotation=" + rotation + ",probability=0.6");
  }
  EXPECT_GT(candidates, 100);
}

TEST_P(Lossless, ForEveryStrategy) {
  for (const std::string strategy : {"apal", "apfl", "fpfl"}) {
    compare("strategy=" + strategy);
  }
  compare("gate=0.99");
  EXPECT_GT(candidates, 100);
}

}  // namespace
}  // namespace cairn::compact
