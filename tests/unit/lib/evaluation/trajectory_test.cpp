// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/trajectory.hpp"

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "cairn/io/format.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using testing::ElementsAre;
using testing::EndsWith;
using testing::IsEmpty;

constexpr double kQuarter = std::numbers::pi / 2;

TrajectoryPose pose(const Vector3d& t, const Matrix3d& R) {
  TrajectoryPose made;
  made.id = 7;
  made.stamp = 0.25;
  Vector3d::Map(made.t.data()) = t;
  Matrix3d::Map(made.R.data()) = R;
  return made;
}

void expect_pose(const Trajectory& poses, const Vector3d& t, const Matrix3d& R) {
  ASSERT_EQ(poses.size(), 1u);
  EXPECT_EQ(poses[0].id, 7);
  EXPECT_EQ(poses[0].stamp, 0.25);
  EXPECT_LT((Vector3d::Map(poses[0].t.data()) - t).norm(), 1e-15) << t.transpose();
  EXPECT_LT((Matrix3d::Map(poses[0].R.data()) - R).norm(), 1e-15) << R;
}

Matrix3d about(const Vector3d& axis, double angle) {
  return AngleAxisd(angle, axis).toRotationMatrix();
}

// Frames -----------------------------------------------------------------------------------------

// A camera that has driven 10 m forward and 2 m to the right, uphill by 1 m (up is -y), and has
// turned left (about -y, which is up).
TEST(CameraToRobotAxes, TurnsForwardIntoXAndLeftIntoY) {
  expect_pose(camera_to_robot_axes({pose({2, -1, 10}, about(-Vector3d::UnitY(), kQuarter))}),
              {10, -2, 1}, about(Vector3d::UnitZ(), kQuarter));
}

TEST(CameraToRobotAxes, KeepsRollPitchAndYawWhatTheyAre) {
  const Vector3d zero = Vector3d::Zero();
  // Roll is about what is forward, pitch about what is left.
  expect_pose(camera_to_robot_axes({pose(zero, about(Vector3d::UnitZ(), 0.3))}), zero,
              about(Vector3d::UnitX(), 0.3));
  expect_pose(camera_to_robot_axes({pose(zero, about(-Vector3d::UnitX(), 0.3))}), zero,
              about(Vector3d::UnitY(), 0.3));
}

TEST(ProjectedToPlane, KeepsPositionAndHeadingOnTheMap) {
  // Yaw, then pitch and roll, which the map does not show.
  const Matrix3d R = about(Vector3d::UnitZ(), 2.5) * about(Vector3d::UnitY(), -0.7) *
                     about(Vector3d::UnitX(), 1.2);
  expect_pose(projected_to_plane({pose({1, 2, 3}, R)}), {1, 2, 0}, about(Vector3d::UnitZ(), 2.5));
}

TEST(ProjectedToPlane, MakesExactlyPlanarPoses) {
  const Trajectory poses =
      projected_to_plane({pose({1, 2, 3}, about(Vector3d(1, 2, 3).normalized(), 0.5))});
  EXPECT_EQ(poses[0].t[2], 0.0);
  EXPECT_EQ(poses[0].R[8], 1.0);
}

// Stamps -----------------------------------------------------------------------------------------

class ReadStamps : public testing::Test {
 protected:
  ~ReadStamps() override { std::filesystem::remove(file_); }
  std::vector<double> read(const std::string& text) {
    write_file(file_, text);
    notes_.clear();
    return read_stamps(file_, notes_);
  }
  std::string refusal(const std::string& text) {
    try {
      read(text);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::input);
      return error.what();
    }
    ADD_FAILURE() << "no error";
    return "";
  }

  std::vector<std::string> notes_;

 private:
  std::filesystem::path file_ = std::filesystem::temp_directory_path() /
                                ("cairn-stamps-" + std::to_string(::getpid()) + ".txt");
};

TEST_F(ReadStamps, OneNumberALine) {
  EXPECT_THAT(read("0.000000e+00\n1.037359e-01\r\n# a comment\n\n  0.5 # and another\n7"),
              ElementsAre(0.0, 0.1037359, 0.5, 7.0));
  EXPECT_THAT(read("-1305031102.175304\n"), ElementsAre(-1305031102.175304));
  EXPECT_THAT(read("\n#\n"), IsEmpty());
}

TEST_F(ReadStamps, NamesTheLineThatIsWrong) {
  EXPECT_THAT(refusal("1\n2 3\n"),
              EndsWith("txt:2: found '2 3'; expected a time stamp, one finite number per line"));
  for (const char* bad : {"nan", "inf", "1e999", "one", "1,5"}) {
    EXPECT_THAT(refusal(std::string("1\n\n") + bad), testing::HasSubstr("txt:3: found '")) << bad;
  }
  EXPECT_THAT(refusal("1.5\n1.25\n"),
              EndsWith("txt:2: stamp 1.25 after 1.5; expected rising stamps"));
}

TEST_F(ReadStamps, AnInstantMayBeTwice) {
  EXPECT_THAT(read("1.5\n1.5\n2\n"), ElementsAre(1.5, 1.5, 2.0));
  EXPECT_THAT(notes_, IsEmpty());
}

TEST_F(ReadStamps, TimesInOtherUnitsAreMadeSecondsToTheLastBit) {
  EXPECT_THAT(read("1403715524907143168\n1403715525107143168\n"),
              ElementsAre(1403715524.907143168, 1403715525.107143168));
  EXPECT_THAT(notes_, ElementsAre(EndsWith("txt: the stamps are nanoseconds, read as seconds")));
  EXPECT_THAT(read("1.403715524907143e15\n1.403715525107143e15\n"),
              ElementsAre(1403715524.907143, 1403715525.107143));
  EXPECT_THAT(notes_, ElementsAre(EndsWith("microseconds, read as seconds")));
  EXPECT_THAT(read("1403715524907\n"), ElementsAre(1403715524.907));
  EXPECT_THAT(notes_, ElementsAre(EndsWith("milliseconds, read as seconds")));
  // Seconds, ids of symbols, and what does not agree.
  EXPECT_THAT(read("1403715524\n1e12\n"), ElementsAre(1403715524.0, 1e12));
  EXPECT_THAT(read("2286984185774080\n"), ElementsAre(2286984185774080.0));  // A0
  EXPECT_THAT(notes_, IsEmpty());
}

TEST(WithStamps, KeepsTheFirstOfPosesWithOneStamp) {
  Trajectory poses(4);
  for (std::size_t k = 0; k < 4; ++k) poses[k].id = static_cast<Id>(k);
  std::vector<std::string> notes;
  const Trajectory timed = with_stamps(poses, {1.0, 1.5, 1.5, 1.75}, notes);
  ASSERT_EQ(timed.size(), 3U);
  EXPECT_EQ(timed[1].id, 1);
  EXPECT_EQ(timed[2].id, 3);
  EXPECT_EQ(*timed[2].stamp, 1.75);
  EXPECT_THAT(notes, ElementsAre("1 pose has the stamp of the pose before: of poses with one "
                                 "stamp the first is kept"));
}

}  // namespace
}  // namespace cairn
