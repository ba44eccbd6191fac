// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/trajectory.hpp"

#include <array>
#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"

namespace cairn {
namespace {

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;

class Poses {
 public:
  explicit Poses(unsigned seed) : engine_(seed) {}
  double draw(double reach = 1.0) {
    return std::uniform_real_distribution<>(-reach, reach)(engine_);
  }
  Vector3d vector(double reach = 1.0) { return {draw(reach), draw(reach), draw(reach)}; }
  Isometry3d pose(double reach, double angle) {
    Isometry3d T = Isometry3d::Identity();
    T.translation() = vector(reach);
    T.linear() = AngleAxisd(draw(angle), vector().normalized()).toRotationMatrix();
    return T;
  }
  Isometry3d planar_pose(double reach) {
    Isometry3d T = Isometry3d::Identity();
    T.translation() = Vector3d(draw(reach), draw(reach), 0.0);
    const double angle = draw(3.0);
    T.linear() << std::cos(angle), -std::sin(angle), 0, std::sin(angle), std::cos(angle), 0, 0, 0,
        1;
    return T;
  }

 private:
  std::mt19937 engine_;
};

TrajectoryPose entry(Id id, const Isometry3d& T) {
  TrajectoryPose pose;
  pose.id = id;
  Vector3d::Map(pose.t.data()) = T.translation();
  Matrix3d::Map(pose.R.data()) = T.linear();
  return pose;
}
Isometry3d pose_of(const TrajectoryPose& pose) {
  Isometry3d T = Isometry3d::Identity();
  T.translation() = Vector3d::Map(pose.t.data());
  T.linear() = Matrix3d::Map(pose.R.data());
  return T;
}
Trajectory moved(const Isometry3d& motion, const Trajectory& trajectory) {
  Trajectory result;
  for (const TrajectoryPose& pose : trajectory)
    result.push_back(entry(pose.id, motion * pose_of(pose)));
  return result;
}

void expect_no_error(const TrajectoryError& error) {
  EXPECT_LT(error.ate_translation, 1e-12);
  EXPECT_LT(error.ate_rotation, 1e-6);
  EXPECT_LT(error.rpe_translation, 1e-12);
  EXPECT_LT(error.rpe_rotation, 1e-6);
  EXPECT_LT(error.rpe_all_translation, 1e-12);
  EXPECT_LT(error.rpe_all_rotation, 1e-6);
}

// By hand ---------------------------------------------------------------------------------------
// Four poses at the corners of a unit square, one side a step, looking along x; four sides of
// length 1 and two diagonals of √2.

/// What is done to a corner: moved on the square's plane, and its body turned.
struct Change {
  Isometry3d body = Isometry3d::Identity();
  Vector3d moved = Vector3d::Zero();
};
Trajectory square(const std::array<Change, 4>& changes, const Isometry3d& where) {
  const double x[] = {0, 1, 1, 0}, y[] = {0, 0, 1, 1};
  Trajectory poses;
  for (Id id = 0; id < 4; ++id) {
    Isometry3d T = Isometry3d::Identity();
    T.translation() = Vector3d(x[id], y[id], 0.0) + changes[id].moved;
    poses.push_back(entry(id, where * T * changes[id].body));
  }
  return poses;
}
Isometry3d turn(double degrees, const Vector3d& axis) {
  return Isometry3d(AngleAxisd(degrees * M_PI / 180.0, axis));
}

struct Six {
  double ate_translation, ate_rotation, rpe_translation, rpe_rotation, all_translation,
      all_rotation;
};
enum class Where { in_space, in_space_and_in_the_plane };

/// Compares a changed square with the true one. In space both stand askew, far from each other.
void expect_errors(const std::array<Change, 4>& changes, const Six& expected, Where where) {
  const Isometry3d here = Isometry3d::Identity(), askew = turn(70.0, Vector3d::UnitY()),
                   elsewhere = Eigen::Translation3d(3.0, -20.0, 5.0) *
                               turn(60.0, Vector3d(1.0, 2.0, -0.5).normalized());
  for (const bool in_space : {true, false}) {
    if (!in_space && where == Where::in_space) continue;
    SCOPED_TRACE(in_space ? "in space" : "in the plane");
    const Trajectory estimate = square(changes, in_space ? askew : here),
                     truth = square({}, in_space ? elsewhere : here);
    const TrajectoryError error = compare(estimate, truth);
    EXPECT_EQ(error.poses, 4);
    EXPECT_EQ(absolute_error(estimate, truth), error.ate_translation);
    EXPECT_NEAR(error.ate_translation, expected.ate_translation, 1e-12);
    EXPECT_NEAR(error.ate_rotation, expected.ate_rotation, 1e-6);
    EXPECT_NEAR(error.rpe_translation, expected.rpe_translation, 1e-12);
    EXPECT_NEAR(error.rpe_rotation, expected.rpe_rotation, 1e-6);
    EXPECT_NEAR(error.rpe_all_translation, expected.all_translation, 1e-12);
    EXPECT_NEAR(error.rpe_all_rotation, expected.all_rotation, 1e-6);
  }
}

// The last corner moves by d away from the middle, which turns nothing. Alignment shifts all back
// by d/4: three corners are off by d/4, one by 3d/4. One of three steps is off by d, and three of
// six pairs.
TEST(Compare, AgreesByHandWhereOneCornerHasMoved) {
  std::array<Change, 4> changes;
  changes[3].moved = Vector3d(-0.3, 0.3, 0.0);
  const double d = 0.3 * std::sqrt(2.0);
  expect_errors(changes,
                {d * std::sqrt(3.0) / 4.0, 0, d / std::sqrt(3.0), 0, d / std::sqrt(2.0), 0},
                Where::in_space_and_in_the_plane);
}

// Every body turned by φ about its own z: a motion of length l is off by 2 sin(φ/2) l, and turns as
// it should.
TEST(Compare, AgreesByHandWhereBodiesAreTurned) {
  for (const double degrees : {60.0, -60.0, 180.0}) {
    std::array<Change, 4> changes;
    for (Change& change : changes) change.body = turn(degrees, Vector3d::UnitZ());
    const double step = 2.0 * std::sin(std::abs(degrees) * M_PI / 360.0);
    expect_errors(changes, {0, std::abs(degrees), step, 0, step * std::sqrt(4.0 / 3.0), 0},
                  Where::in_space_and_in_the_plane);
  }
}

// Every body turned by 90° about its x axis: of a motion only the part along y is off, by √2 of it.
// One step of three has such a part, and four of six pairs.
TEST(Compare, AgreesByHandWhereBodiesAreRolled) {
  std::array<Change, 4> changes;
  for (Change& change : changes) change.body = turn(90.0, Vector3d::UnitX());
  expect_errors(changes, {0, 90, std::sqrt(2.0 / 3.0), 0, std::sqrt(4.0 / 3.0), 0},
                Where::in_space);
}

// The second body looks back. Two of three steps have that turn, and three of six pairs; of the
// motions, those that begin there: a step of length 1, which is off by 2, and a diagonal, by 2√2.
TEST(Compare, AgreesByHandWhereOneBodyLooksBack) {
  std::array<Change, 4> changes;
  changes[1].body = turn(180.0, Vector3d::UnitZ());
  expect_errors(changes,
                {0, 90, std::sqrt(4.0 / 3.0), 180 * std::sqrt(2.0 / 3.0), std::sqrt(2.0),
                 180 / std::sqrt(2.0)},
                Where::in_space_and_in_the_plane);
}

// The same about x: of the two motions the part along y, of length 1, is off by 2.
TEST(Compare, AgreesByHandWhereOneBodyIsUpsideDown) {
  std::array<Change, 4> changes;
  changes[1].body = turn(180.0, Vector3d::UnitX());
  expect_errors(changes,
                {0, 90, std::sqrt(4.0 / 3.0), 180 * std::sqrt(2.0 / 3.0), std::sqrt(4.0 / 3.0),
                 180 / std::sqrt(2.0)},
                Where::in_space);
}

// From the third pose on everything is turned by 90° about it: the last corner lies where the
// second is. That moves the centre by (1, -1)/4 and, by hand, turns nothing: positions off their
// centres have Σ t × e = 0, Σ t · e = 1, Σ t · t = 2 and Σ e · e = 3/2. All steps are as they
// should be but for one turn; from the first two to the last, (0, 1) becomes (1, 0) and (-1, 1)
// becomes (0, 0).
TEST(Compare, AgreesByHandWhereTheHeadingDrifts) {
  std::array<Change, 4> changes;
  changes[3].moved = Vector3d(1.0, -1.0, 0.0);
  for (const int k : {2, 3}) changes[k].body = turn(90.0, Vector3d::UnitZ());
  expect_errors(changes,
                {std::sqrt((2.0 + 1.5 - 2.0) / 4.0), 90 / std::sqrt(2.0), 0, 90 / std::sqrt(3.0),
                 std::sqrt(4.0 / 6.0), 90 * std::sqrt(4.0 / 6.0)},
                Where::in_space_and_in_the_plane);
}

TEST(Compare, DoesNotChangeWithARigidMotionOfEither) {
  Poses draw(10);
  Trajectory truth, estimate, planar_truth, planar_estimate;
  for (Id id = 0; id < 30; ++id) {
    truth.push_back(entry(id, draw.pose(10.0, 3.0)));
    estimate.push_back(entry(id, pose_of(truth.back()) * draw.pose(1.0, 0.5)));
    planar_truth.push_back(entry(id, draw.planar_pose(10.0)));
    planar_estimate.push_back(entry(id, pose_of(planar_truth.back()) * draw.planar_pose(1.0)));
  }
  const auto expect_same = [](const TrajectoryError& a, const TrajectoryError& b) {
    EXPECT_NEAR(a.ate_translation, b.ate_translation, 1e-11);
    EXPECT_NEAR(a.ate_rotation, b.ate_rotation, 1e-9);
    EXPECT_NEAR(a.rpe_translation, b.rpe_translation, 1e-11);
    EXPECT_NEAR(a.rpe_rotation, b.rpe_rotation, 1e-9);
    EXPECT_NEAR(a.rpe_all_translation, b.rpe_all_translation, 1e-11);
    EXPECT_NEAR(a.rpe_all_rotation, b.rpe_all_rotation, 1e-9);
  };
  for (int k = 0; k < 10; ++k) {
    const Isometry3d motion = draw.pose(20.0, 3.1), planar_motion = draw.planar_pose(20.0);
    expect_same(compare(moved(motion, estimate), truth), compare(estimate, truth));
    expect_same(compare(estimate, moved(motion, truth)), compare(estimate, truth));
    expect_same(compare(moved(planar_motion, planar_estimate), planar_truth),
                compare(planar_estimate, planar_truth));
  }
}

// General ---------------------------------------------------------------------------------------

TEST(Compare, FindsNoErrorAfterAKnownRigidMotion) {
  Poses draw(1);
  Trajectory truth;
  for (Id id = 0; id < 50; ++id) truth.push_back(entry(3 * id, draw.pose(10.0, 3.0)));
  for (int k = 0; k < 20; ++k) expect_no_error(compare(moved(draw.pose(5.0, 3.1), truth), truth));
}

TEST(Compare, FindsNoErrorAfterAPlanarMotion) {
  Poses draw(2);
  Trajectory truth;
  for (Id id = 0; id < 50; ++id) truth.push_back(entry(id, draw.planar_pose(10.0)));
  for (int k = 0; k < 20; ++k)
    expect_no_error(compare(moved(draw.planar_pose(30.0), truth), truth));
}

// Positions on a line leave the rotation about it to the orientations, and must not be mirrored.
TEST(Compare, AlignsPosesOnALine) {
  Poses draw(3);
  Trajectory truth;
  for (Id id = 0; id < 20; ++id) {
    Isometry3d T = draw.pose(1.0, 3.0);
    T.translation() = 0.7 * static_cast<double>(id) * Vector3d(1.0, 2.0, -0.5);
    truth.push_back(entry(id, T));
  }
  for (int k = 0; k < 20; ++k) expect_no_error(compare(moved(draw.pose(5.0, 3.1), truth), truth));
  truth.resize(2);
  for (int k = 0; k < 20; ++k) expect_no_error(compare(moved(draw.pose(5.0, 3.1), truth), truth));
}

TEST(Compare, AlignsPosesInOnePointByTheirOrientations) {
  Poses draw(4);
  Trajectory truth;
  for (Id id = 0; id < 20; ++id) {
    Isometry3d T = draw.pose(1.0, 3.0);
    T.translation() = Vector3d(1.0, 2.0, 3.0);
    truth.push_back(entry(id, T));
  }
  for (int k = 0; k < 20; ++k) expect_no_error(compare(moved(draw.pose(5.0, 3.1), truth), truth));
}

// A mirror image fits best, in space, after turning the plane over. A robot on a floor has not done
// that.
TEST(Compare, KeepsAPlanarTrajectoryInThePlane) {
  Trajectory truth, mirrored;
  const double x[] = {0, 4, 4, 0, 1}, y[] = {0, 0, 1, 1, 3};
  for (Id id = 0; id < 5; ++id) {
    Isometry3d T = Isometry3d::Identity();
    T.translation() = Vector3d(x[id], y[id], 0.0);
    truth.push_back(entry(id, T));
    T.translation().y() = -T.translation().y();
    mirrored.push_back(entry(id, T));
  }
  double best = 1e9;  // over rotations about z, centres together
  Vector3d centre = Vector3d::Zero();
  for (const TrajectoryPose& pose : truth) centre += pose_of(pose).translation() / 5.0;
  for (int k = 0; k < 36000; ++k) {
    const Matrix3d R = AngleAxisd(k * M_PI / 18000, Vector3d::UnitZ()).toRotationMatrix();
    double sum = 0.0;
    for (int i = 0; i < 5; ++i) {
      const Vector3d t(x[i] - centre.x(), y[i] - centre.y(), 0.0);
      sum += (t - R * Vector3d(t.x(), -t.y(), 0.0)).squaredNorm();
    }
    best = std::min(best, std::sqrt(sum / 5.0));
  }
  EXPECT_GT(best, 0.5);
  EXPECT_NEAR(compare(mirrored, truth).ate_translation, best, 1e-6);
}

TEST(Compare, DoesNotReflectPositionsInSpace) {
  Poses draw(5);
  Trajectory truth, mirrored;
  for (Id id = 0; id < 30; ++id) {
    Isometry3d T = draw.pose(5.0, 0.0);
    truth.push_back(entry(id, T));
    T.translation().z() = -T.translation().z();
    mirrored.push_back(entry(id, T));
  }
  EXPECT_GT(compare(mirrored, truth).ate_translation, 0.5);
}

/// The definitions, word by word.
struct BruteForce {
  double translation = 0.0, rotation = 0.0;
  int pairs = 0;
  void add(const Isometry3d& truth_i, const Isometry3d& truth_j, const Isometry3d& estimate_i,
           const Isometry3d& estimate_j) {
    const Isometry3d E =
        (truth_i.inverse() * truth_j).inverse() * (estimate_i.inverse() * estimate_j);
    const double degrees = AngleAxisd(E.linear()).angle() * 180.0 / M_PI;
    translation += E.translation().squaredNorm();
    rotation += degrees * degrees;
    ++pairs;
  }
  double rms_translation() const { return std::sqrt(translation / pairs); }
  double rms_rotation() const { return std::sqrt(rotation / pairs); }
};

TEST(Compare, AgreesWithTheDefinitionsOfRelativeErrors) {
  Poses draw(6);
  Trajectory truth, estimate;
  for (Id id = 0; id < 40; ++id) {
    const Isometry3d T = draw.pose(10.0, 3.0);
    truth.push_back(entry(id, T));
    estimate.push_back(entry(id, T * draw.pose(0.5, id % 2 == 0 ? 0.01 : 2.5)));
  }
  BruteForce consecutive, all;
  for (int i = 0; i < 40; ++i) {
    for (int j = i + 1; j < 40; ++j) {
      const auto add = [&](BruteForce& to) {
        to.add(pose_of(truth[i]), pose_of(truth[j]), pose_of(estimate[i]), pose_of(estimate[j]));
      };
      add(all);
      if (j == i + 1) add(consecutive);
    }
  }
  const TrajectoryError error = compare(estimate, truth);
  EXPECT_EQ(error.poses, 40);
  EXPECT_NEAR(error.rpe_translation, consecutive.rms_translation(), 1e-12);
  EXPECT_NEAR(error.rpe_rotation, consecutive.rms_rotation(), 1e-11);
  EXPECT_NEAR(error.rpe_all_translation, all.rms_translation(), 1e-12);
  EXPECT_NEAR(error.rpe_all_rotation, all.rms_rotation(), 1e-11);
}

TEST(Compare, FindsTheBestRigidMotion) {
  Poses draw(7);
  Trajectory truth, estimate;
  for (Id id = 0; id < 40; ++id) {
    const Isometry3d T = draw.pose(10.0, 3.0);
    truth.push_back(entry(id, T));
    estimate.push_back(entry(id, T * draw.pose(1.0, 0.1)));
  }
  // Umeyama's method as Eigen has it is the oracle for positions.
  Eigen::Matrix3Xd from(3, 40), to(3, 40);
  for (int k = 0; k < 40; ++k) {
    from.col(k) = pose_of(estimate[k]).translation();
    to.col(k) = pose_of(truth[k]).translation();
  }
  const Eigen::Matrix4d motion = Eigen::umeyama(from, to, /*with_scaling=*/false);
  const Eigen::Matrix3Xd left = to - ((motion.topLeftCorner<3, 3>() * from).colwise() +
                                      Vector3d(motion.topRightCorner<3, 1>()));
  EXPECT_NEAR(compare(moved(draw.pose(9.0, 3.0), estimate), truth).ate_translation,
              std::sqrt(left.squaredNorm() / 40.0), 1e-10);
}

TEST(Compare, KnowsSmallAnglesPrecisely) {
  Trajectory truth, estimate;
  for (Id id = 0; id < 3; ++id) {
    Isometry3d T = Isometry3d::Identity();
    T.translation() = Vector3d(static_cast<double>(id), static_cast<double>(id * id), 0.5);
    truth.push_back(entry(id, T));
    if (id == 1) T.linear() = AngleAxisd(1e-10, Vector3d::UnitX()).toRotationMatrix();
    estimate.push_back(entry(id, T));
  }
  EXPECT_NEAR(compare(estimate, truth).ate_rotation, 1e-10 * 180.0 / M_PI / std::sqrt(3.0), 1e-13);
}

TEST(Compare, UsesPosesOfEqualIdOnly) {
  Poses draw(8);
  Trajectory truth, estimate;
  for (Id id = 0; id < 30; ++id) {
    const TrajectoryPose pose = entry(id, draw.pose(10.0, 3.0));
    if (id % 2 == 0) truth.push_back(pose);
    if (id % 3 == 0) estimate.push_back(pose);
  }
  const TrajectoryError error = compare(estimate, truth);
  EXPECT_EQ(error.poses, 5);
  expect_no_error(error);
}

TEST(Compare, SaysWhenThereIsTooLittleToCompare) {
  const Trajectory one = {entry(1, Isometry3d::Identity())},
                   other = {entry(2, Isometry3d::Identity())};
  try {
    compare(one, other);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::input);
    EXPECT_THAT(error.what(), testing::HasSubstr("at least two"));
  }
}

TEST(Compare, GivesTheSameBitsForAnyNumberOfThreads) {
  Poses draw(9);
  Trajectory truth, estimate;
  for (Id id = 0; id < 300; ++id) {
    truth.push_back(entry(id, draw.pose(10.0, 3.0)));
    estimate.push_back(entry(id, draw.pose(10.0, 3.0)));
  }
  const int before = threads();
  set_threads(1);
  const TrajectoryError one = compare(estimate, truth);
  for (int count : {2, 3}) {
    set_threads(count);
    const TrajectoryError several = compare(estimate, truth);
    EXPECT_EQ(several.rpe_all_translation, one.rpe_all_translation);
    EXPECT_EQ(several.rpe_all_rotation, one.rpe_all_rotation);
  }
  set_threads(before);
}

}  // namespace
}  // namespace cairn
