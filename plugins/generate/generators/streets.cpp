// SPDX-License-Identifier: BSD-3-Clause
#include "streets.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

namespace cairn::generate {
namespace {

// Headings in quarter turns: east, north, west, south.
constexpr std::array<int, 4> kEast{1, 0, -1, 0};
constexpr std::array<int, 4> kNorth{0, 1, 0, -1};
constexpr std::array<double, 4> kHeading{0.0, kPi / 2.0, -kPi, -kPi / 2.0};

/// A robot at a crossing that writes down its poses as it drives.
class Driver {
 public:
  Driver(const StreetWorld& world, std::int64_t poses) : world_(world), wanted_(poses) {
    path_.reserve(static_cast<std::size_t>(poses));
    east_street_ = static_cast<int>(world.east_gaps.size()) / 2;
    north_street_ = static_cast<int>(world.north_gaps.size()) / 2;
    record();
  }

  bool done() const { return static_cast<std::int64_t>(path_.size()) >= wanted_; }
  int heading() const { return heading_; }
  int east_street() const { return east_street_; }
  int north_street() const { return north_street_; }
  bool can_go(int heading) const {
    const int east = east_street_ + kEast[heading], north = north_street_ + kNorth[heading];
    return east >= 0 && east <= static_cast<int>(world_.east_gaps.size()) && north >= 0 &&
           north <= static_cast<int>(world_.north_gaps.size());
  }

  /// Drives to the next crossing: turning is part of the step before, as a robot turns where it
  /// stops.
  void drive(int heading) {
    turn(heading);
    const int steps =
        kEast[heading] != 0
            ? world_.east_gaps[std::min(east_street_, east_street_ + kEast[heading])]
            : world_.north_gaps[std::min(north_street_, north_street_ + kNorth[heading])];
    for (int k = 0; k < steps && !done(); ++k) {
      east_ += kEast[heading];
      north_ += kNorth[heading];
      record();
    }
    east_street_ += kEast[heading];
    north_street_ += kNorth[heading];
  }

  std::vector<Pose2> take() { return std::move(path_); }

 private:
  void turn(int heading) {
    heading_ = heading;
    path_.back().theta = kHeading[heading];
  }
  void record() {
    path_.push_back({static_cast<double>(east_) * world_.step,
                     static_cast<double>(north_) * world_.step, kHeading[heading_]});
  }

  const StreetWorld& world_;
  std::int64_t wanted_;
  std::vector<Pose2> path_;
  int heading_ = 0;
  int east_street_ = 0, north_street_ = 0;  // the crossing
  std::int64_t east_ = 0, north_ = 0;       // in steps; the first crossing is the origin
};

}  // namespace

int streets_for(std::int64_t poses, int block, double visits) {
  // s streets each way of (s - 1) blocks: 2 s² block places, about.
  const double streets = std::sqrt(static_cast<double>(poses) / (2.0 * block * visits));
  return std::max(3, static_cast<int>(std::floor(streets + 0.5)));
}

std::vector<Pose2> random_walk(const StreetWorld& world, std::int64_t poses, Random& random) {
  Driver driver(world, poses);
  while (!driver.done()) {
    const int ahead = driver.heading(), left = (ahead + 1) % 4, right = (ahead + 3) % 4;
    const double draw = random.uniform();
    const std::array<int, 3> wishes = draw < 0.5    ? std::array{ahead, left, right}
                                      : draw < 0.75 ? std::array{left, right, ahead}
                                                    : std::array{right, left, ahead};
    const auto wish =
        std::find_if(wishes.begin(), wishes.end(), [&](int h) { return driver.can_go(h); });
    driver.drive(wish != wishes.end() ? *wish : (ahead + 2) % 4);
  }
  return driver.take();
}

std::vector<Pose2> errands(const StreetWorld& world, std::int64_t poses, Random& random) {
  Driver driver(world, poses);
  const auto go = [&](int blocks, int forward) {
    const int heading = blocks > 0 ? forward : (forward + 2) % 4;
    for (int k = 0; k < std::abs(blocks) && !driver.done(); ++k) driver.drive(heading);
  };
  while (!driver.done()) {
    const int east =
        static_cast<int>(random.below(static_cast<std::int64_t>(world.east_gaps.size()) + 1));
    const int north =
        static_cast<int>(random.below(static_cast<std::int64_t>(world.north_gaps.size()) + 1));
    const int blocks_east = east - driver.east_street(),
              blocks_north = north - driver.north_street();
    // First along the street that the robot is not facing away from, where it has the choice.
    const bool facing_east_west = driver.heading() % 2 == 0;
    const int ahead = facing_east_west ? blocks_east * kEast[driver.heading()]
                                       : blocks_north * kNorth[driver.heading()];
    const bool east_first = ahead > 0 ? facing_east_west : !facing_east_west;
    if (east_first) go(blocks_east, 0);
    go(blocks_north, 1);
    if (!east_first) go(blocks_east, 0);
  }
  return driver.take();
}

}  // namespace cairn::generate
