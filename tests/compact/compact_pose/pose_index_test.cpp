// SPDX-License-Identifier: BSD-3-Clause
#include "pose_index.hpp"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/pose_world.hpp"

namespace cairn::compact {
namespace {

using Eigen::Vector3d;
using test::Draw;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// An index, and the same without one.
class Both {
 public:
  explicit Both(int dimension) : dimension_(dimension), index_(dimension) {}

  void add(const Vector3d& x) {
    index_.add(x);
    positions_.push_back(x);
  }
  void move(int pose, const Vector3d& x) {
    index_.move(pose, x);
    positions_[pose] = x;
  }
  const Vector3d& position(int pose) const { return positions_[pose]; }
  int size() const { return static_cast<int>(positions_.size()); }
  Vector3d random(Draw& draw, double reach) const {
    Vector3d x = draw.uniforms(3, -reach, reach);
    if (dimension_ == 2) x.z() = 0.0;
    return x;
  }
  /// How many are near.
  std::size_t compare(const Vector3d& x, double radius) {
    std::vector<int> expected;
    for (int k = 0; k < size(); ++k) {
      if ((positions_[k] - x).norm() <= radius) expected.push_back(k);
    }
    EXPECT_EQ(index_.near(x, radius), expected) << size() << " poses, radius " << radius;
    return expected.size();
  }

 private:
  int dimension_;
  PoseIndex index_;
  std::vector<Vector3d> positions_;
};

class PoseIndexIn : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(PlaneAndSpace, PoseIndexIn, testing::Values(2, 3));

TEST_P(PoseIndexIn, FindsWhatBruteForceFindsWhilePosesComeAndMove) {
  Draw draw(GetParam());
  for (const double shake : {0.0, 0.01, 0.5, 20.0}) {
    Both both(GetParam());
    std::size_t found = 0;
    for (int k = 0; k < 700; ++k) {
      both.add(both.random(draw, 20.0));
      if (k % 7 == 3) {  // all of them, as after a loop closure
        for (int pose = 0; pose < both.size(); ++pose)
          both.move(pose, both.position(pose) + both.random(draw, shake));
      } else if (k % 3 == 0) {
        const int pose = draw.integer(both.size());
        both.move(pose, both.position(pose) + both.random(draw, 3.0 * shake));
      }
      const Vector3d x =
          draw.chance(0.5) ? both.position(draw.integer(both.size())) : both.random(draw, 25.0);
      found += both.compare(x, draw.uniform(0.0, 6.0));
    }
    EXPECT_GT(found, 300U);
  }
}

TEST_P(PoseIndexIn, FindsPosesJustAsFarAsTheRadius) {
  Both both(GetParam());
  for (int x = -8; x <= 8; ++x) {
    for (int y = -8; y <= 8; ++y) both.add(0.1 * Vector3d(x, y, GetParam() == 3 ? (x + y) % 3 : 0));
  }
  for (int pose = 0; pose < both.size(); ++pose) {
    const Vector3d x = both.position(pose);
    both.compare(x, 0.0);
    both.compare(x, 0.1);
    both.compare(x, (both.position((37 * pose + 11) % both.size()) - x).norm());
  }
}

TEST_P(PoseIndexIn, AnInfiniteRadiusHoldsAll) {
  Draw draw(3);
  Both both(GetParam());
  both.compare(Vector3d::Zero(), 1.0);
  for (int k = 0; k < 200; ++k) both.add(both.random(draw, 100.0));
  EXPECT_EQ(both.compare(both.position(0), kInfinity), 200U);
  EXPECT_EQ(both.compare(both.position(0), 1.0), 1U);
  EXPECT_EQ(both.compare(both.position(0), kInfinity), 200U);
}

TEST_P(PoseIndexIn, ManyPosesMayBeInOnePlace) {
  Both both(GetParam());
  for (int k = 0; k < 300; ++k) both.add(Vector3d(1.0, 2.0, 0.0));
  EXPECT_EQ(both.compare(Vector3d(1.0, 2.0, 0.0), 0.0), 300U);
  EXPECT_EQ(both.compare(Vector3d(1.0, 2.5, 0.0), 0.4), 0U);
}

}  // namespace
}  // namespace cairn::compact
