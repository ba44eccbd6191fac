// SPDX-License-Identifier: BSD-3-Clause
// The map is brought up to date where it has changed. Asked for after every scan, it is, bit for
// bit, the one that a mapper computes as a whole that is asked for the first time then.
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/grid/floor_plan.hpp"
#include "cairn/grid/ray_caster.hpp"
#include "cairn/plugin/registry.hpp"
#include "support/pose_world.hpp"

namespace cairn {
namespace {

/// What a mapper is told.
struct Call {
  std::vector<Pose2> poses = {};  ///< empty: a scan is added
  Pose2 at = {};
  LaserScan scan = {};
};

void tell(Mapper& mapper, const Call& call) {
  if (call.poses.empty())
    mapper.add(call.at, call.scan);
  else
    mapper.move(call.poses);
}

std::unique_ptr<Mapper> mapper(const std::string& options) {
  return Registry().make<Mapper>(parse_component("log_odds:" + options));
}

template <class T>
void expect_same_bits(const std::vector<T>& a, const std::vector<T>& b, const char* what) {
  ASSERT_EQ(a.size(), b.size()) << what;
  EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof(T)), 0) << what;
}

void expect_same(const FloorMap& a, const FloorMap& b) {
  ASSERT_EQ(a.frame.width, b.frame.width);
  ASSERT_EQ(a.frame.height, b.frame.height);
  EXPECT_EQ(a.frame.origin, b.frame.origin);
  expect_same_bits(a.log_odds, b.log_odds, "log odds");
  expect_same_bits(a.cells, b.cells, "cells");
  expect_same_bits(a.clearance, b.clearance, "clearance");
  expect_same_bits(a.caution, b.caution, "caution");
  ASSERT_EQ(a.frontiers.size(), b.frontiers.size());
  for (std::size_t k = 0; k < a.frontiers.size(); ++k) {
    EXPECT_EQ(a.frontiers[k].cells, b.frontiers[k].cells) << k;
    EXPECT_EQ(a.frontiers[k].length, b.frontiers[k].length) << k;
    EXPECT_EQ(a.frontiers[k].middle, b.frontiers[k].middle) << k;
  }
}

/// After each call, or after every few.
void expect_updates_are_exact(const std::vector<Call>& calls, const std::string& options,
                              std::size_t every) {
  const auto updated = mapper(options);
  bool cautious = false;
  for (std::size_t count = 1; count <= calls.size(); ++count) {
    tell(*updated, calls[count - 1]);
    if (count % every != 0) continue;
    const auto whole = mapper(options);
    for (std::size_t k = 0; k < count; ++k) tell(*whole, calls[k]);
    SCOPED_TRACE("after call " + std::to_string(count) + ", " + options);
    expect_same(updated->map(), whole->map());
    if (testing::Test::HasFailure()) return;
    cautious = cautious || updated->map().caution != updated->map().clearance;
  }
  EXPECT_TRUE(cautious);
}

class LogOddsUpdates : public testing::TestWithParam<int> {
 protected:
  test::Draw draw_{static_cast<unsigned>(GetParam())};
};

/// Anywhere, of anything; few or most of them move.
TEST_P(LogOddsUpdates, OfRandomScansAreExact) {
  std::vector<Call> calls;
  std::vector<Pose2> poses;
  for (int k = 0; k < 24; ++k) {
    LaserScan scan{.first_angle = draw_.uniform(-3.0, 0.0),
                   .angle_step = 0.1,
                   .max_range = draw_.uniform(1.0, 5.0),
                   .ranges = {}};
    const int beams = 1 + draw_.integer(40);
    for (int beam = 0; beam < beams; ++beam) {
      const double range = draw_.chance(0.1) ? NAN : draw_.uniform(0.0, 1.3 * scan.max_range);
      scan.ranges.push_back(static_cast<float>(range));
    }
    const double far = draw_.chance(0.1) ? 15.0 : 4.0;
    poses.emplace_back(draw_.uniform(-far, far), draw_.uniform(-far, far),
                       draw_.uniform(-3.0, 3.0));
    calls.push_back({.at = poses.back(), .scan = std::move(scan)});
    if (!draw_.chance(0.25)) continue;
    const double part = draw_.chance(0.5) ? 0.1 : 0.8;
    for (Pose2& pose : poses) {
      if (!draw_.chance(part)) continue;
      pose = pose *
             Pose2(draw_.uniform(-0.5, 0.5), draw_.uniform(-0.5, 0.5), draw_.uniform(-0.2, 0.2));
    }
    calls.push_back({.poses = poses});
  }
  expect_updates_are_exact(calls, "resolution=0.2", 1);
  expect_updates_are_exact(calls, "resolution=0.13,smooth=false", 3);
}

/// A drive on a floor, on which obstacles come and go, so that clearances grow and shrink.
TEST_P(LogOddsUpdates, OfADriveAreExact) {
  Registry registry;
  if (!registry.has(FloorPlan::kKind, "rooms")) GTEST_SKIP() << "built without 'rooms'";
  const OccupancyGrid floor =
      registry.make<FloorPlan>(parse_component("rooms:width=12,height=9"))->generate(3);
  OccupancyGrid crowded = floor;
  for (std::int8_t& cell : crowded.occupancy) {
    if (draw_.integer(150) == 0) cell = 100;
  }
  const RayCaster rays(floor), others(crowded);
  std::vector<Call> calls;
  std::vector<Pose2> poses;
  for (int k = 0; k < 30; ++k) {
    const Pose2 at(6.0 + 0.14 * k * draw_.uniform(-1.0, 1.0), draw_.uniform(1.0, 8.0),
                   draw_.uniform(-3.0, 3.0));
    LaserScan scan{.first_angle = -1.5, .angle_step = 0.02, .max_range = 5.0, .ranges = {}};
    for (std::size_t beam = 0; beam < 151; ++beam) {
      const double angle = at.theta() + scan.angle(beam);
      const RayHit hit = (k % 3 == 1 ? others : rays).cast(at.translation(), angle, 5.0);
      scan.ranges.push_back(static_cast<float>(hit.hit ? hit.range : 5.0));
    }
    poses.push_back(at);
    calls.push_back({.at = at, .scan = std::move(scan)});
    if (k % 9 != 8) continue;
    poses[static_cast<std::size_t>(draw_.integer(k))] = at;
    calls.push_back({.poses = poses});
  }
  expect_updates_are_exact(calls, "resolution=0.1", 1);
}

INSTANTIATE_TEST_SUITE_P(Seeds, LogOddsUpdates, testing::Range(1, 9));

}  // namespace
}  // namespace cairn
