// SPDX-License-Identifier: BSD-3-Clause
// Landmarks and measurements of them that leave the graph, since with them there is no covariance.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/plugin/registry.hpp"
#include "compact/compact_pose/robot.hpp"
#include "compact_graph.hpp"
#include "support/pose_world.hpp"

namespace cairn::compact {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

constexpr Id kLandmark = 1000;

/// A robot in the plane that drives along x, sees bearings, and knows where it truly is.
class WithBearings : public testing::Test {
 protected:
  static constexpr double kBearing = 0.02;  ///< [rad]

  Factor bearing(Id pose, double angle, Id landmark = kLandmark, double sigma = kBearing) {
    return {registry_.factor_type("EDGE_BEARING_RANGE_SE2_XY"),
            {pose, landmark},
            {angle, 1.0},
            {1.0 / (sigma * sigma), 0.0, 0.0}};
  }
  /// From where it is at x = `pose`.
  Factor exact(Id pose, const Eigen::Vector2d& landmark) {
    return bearing(pose, std::atan2(landmark.y(), landmark.x() - static_cast<double>(pose)));
  }
  Variable point(Id id, double x, double y) { return {point_, id, {x, y}}; }

  Registry registry_;
  test::PoseWorld world_{test::planar_types(registry_)};
  std::shared_ptr<const VariableType> point_ = registry_.variable_type("VERTEX_XY");
};

/// The graph alone.
class LeftOutOfTheGraph : public WithBearings {
 protected:
  void drive(int poses) {
    graph_.start(world_.variable(0, world_.identity(), true), seconds_);
    const Eigen::MatrixXd Sigma = Eigen::Vector3d(1e-4, 1e-4, 1e-6).asDiagonal();
    for (Id id = 1; id < poses; ++id) {
      graph_.advance(world_.variable(id), world_.motion({1.0, 0.0, 0.0}, Sigma),
                     world_.types().edge);
      graph_.keep(seconds_);
    }
  }

  PolicySeconds seconds_;
  CompactGraph graph_{registry_.make<Estimator>("incremental_cholesky"), CompositionOrder::first};
};

TEST_F(LeftOutOfTheGraph, IsALandmarkThatItsBearingsDoNotDetermine) {
  drive(4);
  // Straight ahead: nothing tells how far it is.
  std::vector<Factor> seen;
  for (Id pose = 0; pose < 4; ++pose) seen.push_back(bearing(pose, 0.0));
  graph_.see({point(kLandmark, 20.0, 0.0)}, seen, seconds_);
  EXPECT_THAT(graph_.landmarks().ids(), IsEmpty());
  EXPECT_EQ(graph_.landmarks().type(kLandmark), nullptr);
  const std::vector<LeftOut> left = graph_.take_left_out();
  ASSERT_THAT(left, SizeIs(1));
  EXPECT_TRUE(left.front().removed);
  EXPECT_EQ(left.front().landmark.id, kLandmark);
  ASSERT_THAT(left.front().factors, SizeIs(4));
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_EQ(left.front().factors[k].first, static_cast<Id>(k));
    EXPECT_EQ(left.front().factors[k].second.variables, seen[k].variables);
    EXPECT_EQ(left.front().factors[k].second.information, seen[k].information);
  }
  EXPECT_THAT(graph_.take_left_out(), IsEmpty());  // said once
  // What is left is the odometry.
  EXPECT_EQ(graph_.factor_count(), 3);
  EXPECT_NEAR(graph_.covariance(3)(0, 0), 3e-4, 1e-9);
}

TEST_F(LeftOutOfTheGraph, AreTheLandmarksThatAreToBeReleased) {
  drive(4);
  for (const Id id : {kLandmark, kLandmark + 1}) {
    const Eigen::Vector2d at(2.0, static_cast<double>(id - kLandmark) + 2.0);
    std::vector<Factor> seen;
    for (Id pose = 0; pose < 4; ++pose) {
      seen.push_back(exact(pose, at));
      seen.back().variables.back() = id;
    }
    graph_.see({point(id, at.x(), at.y())}, seen, seconds_);
  }
  EXPECT_THAT(graph_.take_left_out(), IsEmpty());
  ASSERT_THAT(graph_.landmarks().ids(), ElementsAre(kLandmark, kLandmark + 1));
  const std::array<Id, 1> one{kLandmark};
  graph_.release(one, seconds_);
  EXPECT_THAT(graph_.landmarks().ids(), ElementsAre(kLandmark + 1));
  EXPECT_THAT(graph_.take_left_out(), SizeIs(1));
  EXPECT_EQ(graph_.factor_count(), 3 + 4);
}

TEST_F(LeftOutOfTheGraph, IsABearingOfALandmarkOnItsPose) {
  drive(6);
  // Where it truly is, (3, 1e-9), pose 3 is as well.
  const Eigen::Vector2d at(3.0, 1e-9);
  std::vector<Factor> seen;
  for (const Id pose : {0, 1, 4, 5}) seen.push_back(exact(pose, at));
  // Parallax tells how far it is from 0 and 1: they see it beside the road.
  seen.push_back(bearing(2, 0.02));
  Factor position{
      registry_.factor_type("EDGE_SE2_XY"), {2, kLandmark}, {1.0, 0.0}, {100.0, 0.0, 100.0}};
  seen.push_back(position);
  graph_.see({point(kLandmark, at.x(), at.y())}, seen, seconds_);
  ASSERT_THAT(graph_.take_left_out(), IsEmpty());
  const Factor on_it = bearing(3, 1.0);
  graph_.add({&on_it, 1}, seconds_);
  // Either the estimate has covariances with it, or it has left alone.
  for (const LeftOut& left : graph_.take_left_out()) {
    EXPECT_FALSE(left.removed);
    ASSERT_THAT(left.factors, SizeIs(1));
    EXPECT_EQ(left.factors.front().first, 3);
  }
  EXPECT_THAT(graph_.landmarks().ids(), ElementsAre(kLandmark));
  EXPECT_TRUE(graph_.covariance(3).allFinite());
}

/// A policy.
class LeftOutOfASession : public WithBearings {
 protected:
  void begin(const std::string& options) {
    policy_ = registry_.make<PosePolicy>("compact_pose:reuse=true," + options);
    policy_->add_pose(world_.variable(0, world_.identity(), true), {});
  }
  PoseReport advance() {
    PoseReport report = policy_->end_pose();
    begin_next(false);
    return report;
  }
  void begin_next(bool fixed) {
    const Eigen::MatrixXd Sigma = Eigen::Vector3d(1e-4, 1e-4, 1e-6).asDiagonal();
    const Factor moved = world_.edge(newest_, newest_ + 1, {1.0, 0.0, 0.0}, Sigma);
    ++newest_;
    const test::PoseWorld::Pose x{static_cast<double>(newest_), 0.0, 0.0};
    policy_->add_pose(world_.variable(newest_, fixed ? x : test::PoseWorld::Pose(), fixed),
                      {&moved, 1});
  }
  void see(const Factor& factor) {
    policy_->offer_landmark(
        {{.type = point_, .id = factor.variables.back(), .state = {}}, {factor}});
  }

  std::unique_ptr<PosePolicy> policy_;
  Id newest_ = 0;
};

TEST_F(LeftOutOfASession, AreBearingsOfALandmarkThatIsNearerThanItIsKnown) {
  begin("strategy=apfl,several_views=true,landmark_gain=0");
  // 0.05 m beside the road where pose 6 is.
  const Eigen::Vector2d at(6.0, 0.05);
  const Eigen::Vector2d known(4.0, 3.0);
  std::vector<LandmarkReport> of_near;
  test::Draw draw(4);
  for (int pose = 0; pose < 12; ++pose) {
    if (pose != 6) {
      Factor position{registry_.factor_type("EDGE_SE2_XY"),
                      {newest_, kLandmark},
                      {at.x() - pose + 0.3 * draw.normal(), at.y() + 0.3 * draw.normal()},
                      {1.0 / 0.09, 0.0, 1.0 / 0.09}};
      if (std::abs(pose - 6) < 3) see(position);
    } else {
      see(bearing(newest_, 0.5 * std::numbers::pi));
    }
    const PoseReport report = advance();
    if (report.id == 6) std::ranges::copy(report.landmarks, std::back_inserter(of_near));
  }
  ASSERT_THAT(of_near, SizeIs(1));
  EXPECT_EQ(of_near.front().verdict, LinkVerdict::nonlinear);
  EXPECT_FALSE(of_near.front().removed);
  policy_->end_pose();
  EXPECT_TRUE(policy_->finish());
  EXPECT_THAT(policy_->landmarks(), ElementsAre(kLandmark));
}

// The newest pose is kept for what it measures of a landmark that waits, and measures it twice.
TEST_F(LeftOutOfASession, IsNoSecondMeasurementByThePoseThatDeterminesTheLandmark) {
  begin("several_views=true,landmark_gain=0,pose_gain=20,range=100");
  const Eigen::Vector2d at(20.0, 3.0);
  see(exact(0, at));
  policy_->end_pose();
  begin_next(true);
  see(exact(1, at));
  EXPECT_THAT(advance().landmarks, SizeIs(1));
  while (newest_ < 16) EXPECT_FALSE(advance().kept) << newest_;
  ASSERT_THAT(policy_->landmarks(), IsEmpty());
  see(exact(16, at));
  see(exact(16, at));
  const PoseReport report = advance();
  EXPECT_TRUE(report.kept);
  EXPECT_THAT(policy_->landmarks(), ElementsAre(kLandmark));
  std::vector<Id> poses;
  for (const LandmarkReport& one : report.landmarks) {
    EXPECT_EQ(one.verdict, LinkVerdict::linked);
    poses.push_back(one.pose);
  }
  EXPECT_THAT(poses, ElementsAre(0, 1, 16, 16));
}

/// With a gate, what the first pose sees may be something else.
class FalseFirstView : public LeftOutOfASession {
 protected:
  Eigen::Vector2d position() {
    const auto state = policy_->estimator().state(kLandmark);
    return {state[0], state[1]};
  }
  /// What the newest pose measures of where it is.
  Factor seen_at(const Eigen::Vector2d& at) {
    return {registry_.factor_type("EDGE_SE2_XY"),
            {newest_, kLandmark},
            {at.x() - static_cast<double>(newest_), at.y()},
            {100.0, 0.0, 100.0}};
  }
  const Eigen::Vector2d at_{5.0, 3.0};
};

TEST_F(FalseFirstView, OfABearingIsOutvoted) {
  begin("strategy=apfl,several_views=true,gate=0.999,landmark_gain=0");
  see(bearing(0, -1.0));
  std::vector<LandmarkReport> reports = advance().landmarks;
  while (newest_ < 8) {
    see(exact(newest_, at_));
    std::ranges::copy(advance().landmarks, std::back_inserter(reports));
  }
  ASSERT_THAT(policy_->landmarks(), ElementsAre(kLandmark));
  EXPECT_LT((position() - at_).norm(), 0.1);
  const auto of_first = [](const LandmarkReport& one) { return one.pose == 0; };
  EXPECT_EQ(std::ranges::count_if(reports, of_first), 2);  // it waits, then is judged
  const auto last = std::ranges::find_if(reports.rbegin(), reports.rend(), of_first);
  EXPECT_EQ(last->verdict, LinkVerdict::inconsistent);
}

TEST_F(FalseFirstView, IsNotAgreedWithByOneOther) {
  for (const bool gate : {false, true}) {
    newest_ = 0;
    begin(std::string("strategy=apfl,several_views=true") + (gate ? ",gate=0.999" : ""));
    for (int pose = 0; pose < 6; ++pose) {
      if (pose == 0 || pose == 4) see(exact(newest_, at_));
      advance();
    }
    // Two bearings meet wherever they point to.
    EXPECT_EQ(policy_->landmarks().empty(), gate);
    see(exact(newest_, at_));
    advance();
    EXPECT_THAT(policy_->landmarks(), ElementsAre(kLandmark));
  }
}

TEST_F(FalseFirstView, OfAPositionIsContradictedByTwo) {
  begin("strategy=apfl,several_views=true,gate=0.999,landmark_gain=0");
  see(seen_at({-3.0, -7.0}));
  advance();
  EXPECT_THAT(policy_->landmarks(), ElementsAre(kLandmark));
  std::vector<LandmarkReport> reports;
  while (newest_ < 6) {
    see(seen_at(at_));
    std::ranges::copy(advance().landmarks, std::back_inserter(reports));
  }
  ASSERT_THAT(policy_->landmarks(), ElementsAre(kLandmark));
  EXPECT_LT((position() - at_).norm(), 0.1);
  EXPECT_EQ(std::ranges::count_if(reports, &LandmarkReport::removed), 1);
}

TEST_F(LeftOutOfASession, IsWhatWaitsForLongestWhereMoreWaitThanMay) {
  begin("strategy=apfl,several_views=true,waiting=2");
  for (Id id = kLandmark; id < kLandmark + 3; ++id) {
    see(bearing(newest_, 0.5, id));
    const PoseReport report = advance();
    const auto given_up =
        std::ranges::count(report.landmarks, LinkVerdict::unmatched, &LandmarkReport::verdict);
    EXPECT_EQ(given_up, id == kLandmark + 2 ? 1 : 0);
    if (given_up > 0) {
      EXPECT_EQ(report.landmarks.back().landmark, kLandmark);
    }
  }
  EXPECT_THAT(policy_->undetermined(), SizeIs(3));
  // What waits is of two: the first begins anew.
  const Eigen::Vector2d at(6.0, 4.0);
  see(exact(newest_, at));
  advance();
  EXPECT_THAT(policy_->landmarks(), IsEmpty());
}

TEST_F(LeftOutOfASession, IsALandmarkTooFarAwayForItsDigits) {
  for (const double range : {1e14, 1e200, 1e308}) {
    newest_ = 0;
    begin("several_views=true");
    Factor far = bearing(0, 0.3);
    far.measurement[1] = range;
    far.information = {2500.0, 0.0, 100.0};
    see(far);
    const PoseReport report = advance();
    ASSERT_THAT(report.notes, SizeIs(1)) << range;
    EXPECT_THAT(report.notes.front(), testing::HasSubstr("what pose 0 measured of landmark 1000"));
    ASSERT_THAT(report.landmarks, SizeIs(1));
    EXPECT_EQ(report.landmarks.front().verdict, LinkVerdict::unmatched);
    EXPECT_THAT(policy_->landmarks(), IsEmpty());
    for (int k = 0; k < 3; ++k) advance();
    policy_->end_pose();
    EXPECT_TRUE(policy_->finish());
    for (const double x : policy_->newest_state()) EXPECT_TRUE(std::isfinite(x));
  }
}

}  // namespace
}  // namespace cairn::compact
