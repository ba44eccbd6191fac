// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/trajectory.hpp"

#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "cairn/error.hpp"
#include "cairn/threads.hpp"

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
  EXPECT_NEAR(error.rpe_translation, consecutive.rms_translation(), 1e-10);
  EXPECT_NEAR(error.rpe_rotation, consecutive.rms_rotation(), 1e-6);
  EXPECT_NEAR(error.rpe_all_translation, all.rms_translation(), 1e-10);
  EXPECT_NEAR(error.rpe_all_rotation, all.rms_rotation(), 1e-6);
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
