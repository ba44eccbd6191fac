// SPDX-License-Identifier: BSD-3-Clause
// Wheels that slip and matches that are wrong: what `cairn map` must cope with.
#include "cairn/exploration/scan_slam.hpp"

#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/exploration/map_log.hpp"
#include "cairn/exploration/map_truth.hpp"
#include "cairn/grid/ray_caster.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/typed/build.hpp"
#include "exploration/library/exploration/drawn_map.hpp"

namespace cairn {
namespace {

constexpr double pi = std::numbers::pi;
constexpr const char* kPolicy =
    "compact_pose:strategy=apfl,range=3,angle=3.14,loop_gain=0.8,reuse=false";

/// A log of a robot that drives there and back in a hall, five times; scans are exact.
struct Drive {
  OccupancyGrid floor = test::drawn_floor({"##############", "#............#", "#..##........#",
                                           "#..##....##..#", "#........##..#", "#............#",
                                           "#...##.......#", "#............#", "##############"});
  ScanLog log;
  std::vector<Pose2> truth;

  /// `slip`: by which part wheels slip, at one motion of six.
  explicit Drive(double slip) {
    const RayCaster rays(floor);
    Pose2 pose(2.0, 3.5, 0.0), odometry = pose;
    for (int k = 0; k < 250; ++k) {
      LaserScan scan{
          .first_angle = -0.5 * pi, .angle_step = pi / 180, .max_range = 8.0, .ranges = {}};
      for (std::size_t beam = 0; beam <= 180; ++beam) {
        const RayHit hit = rays.cast(pose.translation(), pose.theta() + scan.angle(beam), 8.0);
        scan.ranges.push_back(static_cast<float>(hit.range));
      }
      log.scans.push_back({.stamp = 0.1 * k, .odometry = odometry, .scan = std::move(scan)});
      truth.push_back(pose);
      const bool turns = k % 50 >= 40;
      const Pose2 motion = turns ? Pose2(0.0, 0.0, 0.1 * pi) : Pose2(0.22, 0.0, 0.0);
      const double part = k % 6 == 3 ? 1.0 + slip : 1.0;
      pose = pose * motion;
      odometry = odometry * Pose2(part * motion.x(), 0.0, part * motion.theta());
    }
  }
  double odometry_error() const { return error(log.scans.back().odometry); }
  double error(const Pose2& last) const {
    return (last.translation() - truth.back().translation()).norm();
  }
};

/// `icp` with one wrong loop closure of ten, half a metre and a quarter of a radian off.
class SometimesWrong final : public Registration, public ScanRegistration {
 public:
  explicit SometimesWrong(Registry& registry)
      : registry_(registry), icp_(registry.make<Registration>("icp")) {}

  void begin(const RegistrationData& data) override { icp_->begin(data); }
  std::vector<Factor> match(Id earlier, Id later) override { return icp_->match(earlier, later); }
  std::vector<Factor> match_proposed(const MatchProposal& proposal) override {
    std::vector<Factor> found = icp_->match_proposed(proposal);
    if (found.empty() || proposal.later == proposal.earlier + 1 || ++matches_ % 10 != 0)
      return found;
    const Pose2 wrong = Pose2::from_state(found.front().measurement) * Pose2(0.4, 0.3, 0.25);
    return {make_factor(Between(proposal.earlier, proposal.later, wrong),
                        Information::sigmas(0.01, 0.01, 0.005), nullptr, registry_)};
  }
  void pose_ended(Id pose, bool kept) override { icp_->pose_ended(pose, kept); }
  void take(Id pose, LaserScan scan) override {
    query<ScanRegistration>(*icp_)->take(pose, std::move(scan));
  }
  void* ability(std::string_view name) override {
    return name == ScanRegistration::kAbility ? static_cast<ScanRegistration*>(this) : nullptr;
  }

 private:
  Registry& registry_;
  std::unique_ptr<Registration> icp_;
  int matches_ = 0;
};

class ScanSlamTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!registry_.has("registration", "icp")) GTEST_SKIP() << "without icp";
    if (!registry_.has("mapper", "log_odds")) GTEST_SKIP() << "without log_odds";
  }

  struct Outcome {
    double error = 0.0;
    MapAgreement agreement;
    ScanSlamCounts counts;
  };
  Outcome map(const Drive& drive, Registration& registration, const char* loss,
              bool match_consecutive = true) {
    const auto policy = registry_.make<PosePolicy>(parse_component(kPolicy));
    const auto mapper = registry_.make<Mapper>("log_odds");
    ScanSlam slam({.policy = *policy,
                   .registration = registration,
                   .mapper = *mapper,
                   .registry = registry_,
                   .match_consecutive = match_consecutive,
                   .loop_loss = loss ? registry_.make<Loss>(loss) : nullptr});
    map_log(drive.log, slam,
            {.step = 0.2,
             .turn = 0.2,
             .odometry = {.absolute = {0.01, 0.01, 0.005}, .relative = 0.05}});
    return {.error = drive.error(slam.poses().back()),
            .agreement = map_agreement(scan_agreement(slam.map(), slam.scans(), slam.poses())),
            .counts = slam.counts()};
  }

  Registry registry_;
};

TEST_F(ScanSlamTest, WheelsMaySlip) {
  const Drive drive(0.6);  // twelve standard deviations
  EXPECT_GT(drive.odometry_error(), 1.0);
  const auto icp = registry_.make<Registration>("icp");
  const Outcome outcome = map(drive, *icp, nullptr);
  EXPECT_GT(outcome.counts.consecutive, 240);
  EXPECT_LT(outcome.error, 0.05);
  EXPECT_GT(outcome.agreement.least, 0.95);
}

TEST_F(ScanSlamTest, OdometryThatErrsMoreThanItSaysIsLearnt) {
  const Drive right(0.0), wrong(0.6);
  const auto icp = registry_.make<Registration>("icp");
  EXPECT_EQ(map(right, *icp, nullptr).counts.contradicted, 0);
  const auto again = registry_.make<Registration>("icp");
  const Outcome outcome = map(wrong, *again, nullptr);
  EXPECT_GT(outcome.counts.contradicted, 0);
  EXPECT_LT(outcome.counts.contradicted, 20);  // of the 41 motions that slip
}

TEST_F(ScanSlamTest, WithARobustLossWrongMatchesDoNotBendTheMap) {
  const Drive drive(0.3);
  SometimesWrong plain(registry_), robust(registry_);
  const Outcome bent = map(drive, plain, nullptr), right = map(drive, robust, "cauchy:scale=2");
  EXPECT_LT(right.error, 0.05);
  EXPECT_GT(right.agreement.least, 0.9);
  EXPECT_GT(bent.error, 2.0 * right.error);
}

TEST_F(ScanSlamTest, AMapWithAPartOutOfPlaceDoesNotExplainItsScans) {
  const Drive drive(0.0);
  std::vector<LaserScan> scans;
  for (const LoggedScan& logged : drive.log.scans) scans.push_back(logged.scan);
  const auto least = [&](const Pose2& off) {
    std::vector<Pose2> poses = drive.truth;
    for (std::size_t k = 200; k < poses.size(); ++k) poses[k] = off * poses[k];
    const auto mapper = registry_.make<Mapper>("log_odds");
    for (std::size_t k = 0; k < poses.size(); ++k) mapper->add(poses[k], scans[k]);
    return map_agreement(scan_agreement(mapper->map(), scans, poses));
  };
  EXPECT_GT(least(Pose2()).least, 0.95);
  const MapAgreement wrong = least(Pose2(0.4, 0.3, 0.1));
  EXPECT_LT(wrong.least, kPlausibleAgreement);
  EXPECT_GE(wrong.first, 190U);
}

TEST(MapAgreement, IsTheMeanAndTheLeastOfAnyTwentyInARow) {
  std::vector<double> scans(100, 1.0);
  for (std::size_t k = 50; k < 60; ++k) scans[k] = 0.5;
  scans[55] = std::numeric_limits<double>::quiet_NaN();
  const MapAgreement agreement = map_agreement(scans);
  EXPECT_NEAR(agreement.mean, (90.0 + 9 * 0.5) / 99.0, 1e-12);
  EXPECT_NEAR(agreement.least, (11.0 + 9 * 0.5) / 20.0, 1e-12);
  EXPECT_GE(agreement.first, 39U);
  EXPECT_LE(agreement.first, 50U);
  EXPECT_EQ(map_agreement({}).least, 1.0);
  EXPECT_NEAR(map_agreement(std::vector{0.2, 0.4}).least, 0.3, 1e-12);
}

TEST(MapAgreement, CountsEndPointsAtObstaclesAndBesideThem) {
  FloorMap map = test::drawn_map({"#......#", "#......#", "#......#"}, 1.0);
  LaserScan scan{.first_angle = 0.0, .angle_step = pi, .max_range = 10.0, .ranges = {3.5F, 1.2F}};
  // Looking to the right from (3.5, 1.5): to the cell of the wall; and 1.2 m to the left: to none.
  const std::vector<Pose2> poses{Pose2(3.5, 1.5, 0.0)};
  EXPECT_EQ(scan_agreement(map, {{scan}}, poses), std::vector{0.5});
  scan.ranges = {20.0F, std::numeric_limits<float>::quiet_NaN()};
  EXPECT_TRUE(std::isnan(scan_agreement(map, {{scan}}, poses).front()));
}

}  // namespace
}  // namespace cairn
