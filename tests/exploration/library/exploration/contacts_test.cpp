// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/contacts.hpp"

#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/exploration/path_planner.hpp"
#include "exploration/library/exploration/drawn_map.hpp"

namespace cairn {
namespace {

using Eigen::Vector2d;

constexpr double kRadius = 0.2;

FloorMap room() { return test::drawn_map(std::vector<std::string>(40, std::string(40, '.')), 0.1); }

TEST(Contacts, OneIsNoObstacleTwoAtAPlaceAre) {
  FloorMap map = room();
  map.caution = map.clearance;
  const GridFrame& frame = map.frame;
  Contacts contacts(kRadius);
  const Vector2d at(2.05, 2.05);
  const Vector2d ahead(0.0, 3.0), touched = at + Vector2d(0.0, kRadius);
  EXPECT_EQ(&contacts.seen_by(map, 0.0), &map);
  contacts.add(at, ahead, 1.0);
  contacts.add(at, Vector2d(-1.0, 0.0), 2.0);  // elsewhere
  EXPECT_EQ(&contacts.seen_by(map, 2.0), &map);
  contacts.add(at, ahead, 3.0);
  const FloorMap& seen = contacts.seen_by(map, 3.0);
  ASSERT_NE(&seen, &map);
  EXPECT_EQ(seen.cells, map.cells);
  int nearer = 0;
  for (int y = 0; y < frame.height; ++y) {
    for (int x = 0; x < frame.width; ++x) {
      const std::size_t k = frame.index(x, y);
      const double distance = (frame.centre(x, y) - touched).norm();
      if (distance < 2.0) {
        EXPECT_NEAR(seen.clearance[k], std::min<double>(map.clearance[k], distance), 1e-6);
        EXPECT_NEAR(seen.caution[k], std::min<double>(map.caution[k], distance), 1e-6);
      }
      EXPECT_LE(seen.clearance[k], map.clearance[k]);
      nearer += seen.clearance[k] < needed_clearance(kRadius, frame) &&
                map.clearance[k] >= needed_clearance(kRadius, frame);
    }
  }
  EXPECT_GT(nearer, 5);
  EXPECT_LT(nearer, 30);  // a body's width or so
}

TEST(Contacts, WhatIsSeenIsAnObstacleAtOnceAndNewButOnce) {
  const FloorMap map = room();
  Contacts contacts(kRadius);
  const Vector2d point(2.05, 2.05);
  EXPECT_TRUE(contacts.see(point, 1.0));
  const FloorMap& seen = contacts.seen_by(map, 1.0);
  EXPECT_NEAR(seen.clearance[map.frame.index(22, 20)], 0.2, 1e-6);
  EXPECT_FALSE(contacts.see(point + Vector2d(0.03, 0.0), 2.0));
  EXPECT_TRUE(contacts.see(point + Vector2d(0.08, 0.0), 2.0));
  EXPECT_TRUE(contacts.doubt());
  EXPECT_TRUE(contacts.see(point, 3.0)) << "it was doubted";
}

TEST(Contacts, AreForgottenAfterAWay) {
  const FloorMap map = room();
  Contacts contacts(kRadius);
  for (const double driven : {1.0, 2.0}) contacts.add({2.0, 2.0}, {1.0, 0.0}, driven);
  EXPECT_NE(&contacts.seen_by(map, 50.0), &map);
  EXPECT_EQ(&contacts.seen_by(map, 53.0), &map);
}

TEST(Contacts, OfWhichOneIsDoubtedAreNoneUntilTouchedOnceMore) {
  const FloorMap map = room();
  Contacts contacts(kRadius);
  const auto touch = [&] { contacts.add({2.0, 2.0}, {1.0, 0.0}, 1.0); };
  touch();
  EXPECT_FALSE(contacts.doubt());
  touch();
  EXPECT_NE(&contacts.seen_by(map, 3.0), &map);
  EXPECT_TRUE(contacts.doubt());
  EXPECT_FALSE(contacts.doubt());
  EXPECT_EQ(&contacts.seen_by(map, 3.0), &map);
  touch();
  EXPECT_NE(&contacts.seen_by(map, 3.0), &map);
  contacts.forget();
  touch();
  EXPECT_EQ(&contacts.seen_by(map, 3.0), &map);
}

TEST(Contacts, AtTheEdgeOfTheMapAndBeyond) {
  const FloorMap map = room();
  Contacts contacts(kRadius);
  for (const double driven : {1.0, 2.0}) {
    contacts.add({3.55, 0.35}, {1.0, 0.0}, driven);
    contacts.add({-3.0, 99.0}, {1.0, 0.0}, driven);
  }
  const FloorMap& seen = contacts.seen_by(map, 3.0);
  EXPECT_LT(seen.clearance[map.frame.index(37, 3)], 0.05F);
  EXPECT_EQ(seen.clearance[map.frame.index(39, 0)], map.clearance[map.frame.index(39, 0)]);
  EXPECT_EQ(seen.clearance[map.frame.index(0, 39)], map.clearance[map.frame.index(0, 39)]);
}

}  // namespace
}  // namespace cairn
