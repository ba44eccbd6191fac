// SPDX-License-Identifier: BSD-3-Clause
// Landmarks of which bearings alone are measured: what waits, until when, and what the map is then.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/graph/packed.hpp"
#include "cairn/lie/point.hpp"
#include "cairn/lie/se3.hpp"
#include "cairn/lie/so3.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/types/define_factor.hpp"
#include "compact/compact_pose/landmark_course.hpp"
#include "compact/compact_pose/robot.hpp"
#include "support/dense_algebra.hpp"
#include "support/dense_system.hpp"
#include "support/pose_world.hpp"
#include "support/sample_graphs.hpp"

namespace cairn::compact {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using test::dense_system;
using test::log_determinant_of;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

/// The direction in which a landmark is seen, as a unit vector in the frame of the pose.
struct SeenDirection {
  static constexpr std::string_view kTag = "TEST_SEEN_DIRECTION";
  static constexpr int kResidual = 3, kMeasurement = 3;
  using Variables = std::tuple<Se3, PointXYZ>;
  template <class S>
  static Vector<S, 3> residual(const Vector<S, 7>& pose, const Vector<S, 3>& point,
                               const Vector<double, 3>& z) {
    using std::sqrt;
    const Vector<S, 3> seen = so3::rotate_back<S>(Se3::quaternion<S>(pose),
                                                  Vector<S, 3>(point - Se3::translation<S>(pose)));
    return seen / sqrt(seen.squaredNorm()) - z.template cast<S>();
  }
};

/// A robot that goes round and round among landmarks, and everything that it measures as a graph.
class Bearings : public LandmarkCourse {
 protected:
  static constexpr double kBearing = 0.03;  ///< [rad]

  void begin(const std::string& options) {
    begin_course("range=3,angle=0.6" + (options.empty() ? "" : "," + options));
  }
  /// The bearing alone of what the newest pose sees.
  LandmarkObservation bearing_of(int landmark) {
    const auto [R, t] = world_.split(truth_.back());
    const Vector3d at = R.transpose() * (landmarks_[static_cast<std::size_t>(landmark)] - t);
    Factor factor{direction_, {newest(), kFirstLandmark + landmark}, {}, {}};
    const double w = 1.0 / (kBearing * kBearing);
    if (GetParam() == 2) {
      factor.type = registry_.factor_type("EDGE_BEARING_RANGE_SE2_XY");
      factor.measurement = {std::atan2(at.y(), at.x()) + kBearing * draw_.normal(), 1.0};
      factor.information = {w, 0.0, 0.0};
    } else {
      const Vector3d seen =
          (at.normalized() + kBearing * Vector3d(draw_.normal(), draw_.normal(), draw_.normal()))
              .normalized();
      factor.measurement = {seen.x(), seen.y(), seen.z()};
      factor.information = pack(MatrixXd(MatrixXd::Identity(3, 3) * w));
    }
    return {{.type = point_, .id = kFirstLandmark + landmark, .state = {}}, {factor}};
  }
  void offer(const LandmarkObservation& observation) {
    policy_->offer_landmark(observation);
    const Id id = observation.landmark.id;
    if (!all_.find(id)) {
      std::vector<double> state(static_cast<std::size_t>(GetParam()));
      std::copy_n(landmarks_[static_cast<std::size_t>(id - kFirstLandmark)].data(), GetParam(),
                  state.begin());
      all_.add_variable(point_, id, state);
    }
    put(observation.factors.front());
  }
  std::vector<PoseReport> drive(int poses) {
    std::vector<PoseReport> reports;
    for (int k = 0; k < poses; ++k) {
      for (const int landmark : visible()) offer(bearing_of(landmark));
      reports.push_back(advance());
    }
    return reports;
  }
  double distance_to_truth(Id landmark) {
    const auto state = policy_->estimator().state(landmark);
    Vector3d at = Vector3d::Zero();
    std::copy_n(state.begin(), GetParam(), at.data());
    return (at - landmarks_[static_cast<std::size_t>(landmark - kFirstLandmark)]).norm();
  }

  const std::shared_ptr<const FactorType> direction_ = define_factor<SeenDirection>();
};

INSTANTIATE_TEST_SUITE_P(InThePlaneAndInSpace, Bearings, testing::Values(2, 3));

TEST_P(Bearings, AllOfThemAreTheBatchSolution) {
  begin("strategy=apal");
  drive(2 * kLap);
  policy_->end_pose();
  ASSERT_TRUE(policy_->finish());
  EXPECT_THAT(policy_->landmarks(), SizeIs(8));
  EXPECT_THAT(policy_->undetermined(), IsEmpty());
  test::solve_densely(all_);
  const double chi2 = test::chi2_of(all_);
  EXPECT_NEAR(policy_->estimator().chi2(), chi2, 1e-6 * chi2);
  EXPECT_EQ(policy_->factor_count(), all_.factor_count());
  for (int v = 0; v < all_.variable_count(); ++v) {
    const auto there = all_.state(v), estimate = policy_->estimator().state(all_.id(v));
    VectorXd difference(all_.type(v).tangent_size());
    all_.type(v).local(1, there.data(), estimate.data(), difference.data());
    EXPECT_LT(difference.norm(), 1e-6) << all_.describe_variable(v);
  }
}

TEST_P(Bearings, WaitUntilPosesThatAreKeptDetermineTheLandmark) {
  begin("strategy=apfl");
  std::vector<LandmarkReport> all;
  for (const PoseReport& report : drive(kLap)) {
    EXPECT_TRUE(report.kept);
    std::ranges::copy(report.landmarks, std::back_inserter(all));
  }
  for (const Id landmark : policy_->landmarks()) {
    std::vector<LandmarkReport> of_one;
    std::ranges::copy_if(all, std::back_inserter(of_one),
                         [&](const LandmarkReport& one) { return one.landmark == landmark; });
    // The first waits, and is said to be in the graph when it is, with the landmark.
    ASSERT_GT(of_one.size(), 2U);
    EXPECT_EQ(of_one.front().verdict, LinkVerdict::waiting);
    const auto added = std::ranges::find_if(of_one, &LandmarkReport::added);
    ASSERT_NE(added, of_one.end());
    EXPECT_EQ(added->pose, of_one.front().pose);
    EXPECT_EQ(added->verdict, LinkVerdict::linked);
    EXPECT_EQ(std::ranges::count_if(of_one, &LandmarkReport::added), 1);
    for (auto one = of_one.begin(); one != added; ++one)
      EXPECT_EQ(one->verdict, LinkVerdict::waiting);
    for (auto one = added; one != of_one.end(); ++one)
      EXPECT_NE(one->verdict, LinkVerdict::waiting);
  }
  EXPECT_GT(policy_->landmarks().size(), 5U);
}

/// A graph without one of its variables, and what was measured of it.
Graph without(const Graph& all, Id left_out) {
  Graph rest;
  for (int v = 0; v < all.variable_count(); ++v) {
    if (all.id(v) != left_out) rest.add(all.variable(v));
  }
  for (int f = 0; f < all.factor_count(); ++f) {
    const Factor factor = all.factor(f);
    if (!std::ranges::count(factor.variables, left_out)) rest.add(factor);
  }
  return rest;
}

/// Of everything but one variable, dense: ½ ln |Σ|.
double half_log_covariance(const Graph& graph, Id but) {
  const test::DenseSystem system = dense_system(graph);
  const MatrixXd Sigma = system.Sigma();
  std::vector<Eigen::Index> rows;
  for (const auto& [id, place] : system.rows) {
    for (Eigen::Index r = 0; r < place.size && id != but; ++r) rows.push_back(place.first + r);
  }
  return 0.5 * log_determinant_of(MatrixXd(Sigma(rows, rows)));
}

TEST_P(Bearings, TheGainIsTheEntropyThatThePosesLose) {
  begin("strategy=apfl,estimator=batch");
  int compared = 0;
  double most = 0.0;
  for (int k = 0; k < 2 * kLap; ++k) {
    // One at a time, so that each is judged by itself.
    const std::vector<int> near = visible();
    ASSERT_FALSE(near.empty());
    const LandmarkObservation observation =
        bearing_of(near[static_cast<std::size_t>(k) % std::min<std::size_t>(near.size(), 2)]);
    const Id id = observation.landmark.id;
    policy_->offer_landmark(observation);
    const PoseReport report = policy_->end_pose();
    const auto added = std::ranges::find_if(report.landmarks, &LandmarkReport::added);
    if (added != report.landmarks.end()) {
      const Graph after = policy_->estimator().graph();
      const double gain =
          half_log_covariance(without(after, id), id) - half_log_covariance(after, id);
      // It was evaluated where the landmark was put first, and the poses were then.
      EXPECT_NEAR(added->gain, gain, 0.1 * gain + 1e-3) << k;
      most = std::max(most, gain);
      ++compared;
    }
    const Factor odometry = moved_on();
    policy_->add_pose(world_.variable(newest()), {&odometry, 1});
  }
  EXPECT_GT(compared, 3);
  // Two bearings in the plane determine a landmark, and tell nothing else.
  if (GetParam() == 2) {
    EXPECT_LT(most, 1e-9);
  } else {
    EXPECT_GT(most, 0.1);
  }
}

TEST_P(Bearings, FewOfThemBoundTheErrorOfOdometry) {
  begin("landmark_gain=1.5");
  int dropped = 0;
  for (const PoseReport& report : drive(8 * kLap)) dropped += !report.kept;
  policy_->end_pose();
  ASSERT_TRUE(policy_->finish());
  EXPECT_GT(dropped, 2 * kLap);
  EXPECT_THAT(policy_->landmarks(), SizeIs(8));
  const auto last = policy_->estimator().state(policy_->kept().back());
  EXPECT_LT(world_.log(world_.between(truth_.back(), last)).norm(), 0.5);
  for (const Id landmark : policy_->landmarks()) EXPECT_LT(distance_to_truth(landmark), 1.0);
}

TEST_P(Bearings, OfALandmarkThatNothingDeterminesAreCounted) {
  begin("strategy=apfl");
  for (int k = 0; k < 4; ++k) advance();
  offer(bearing_of(visible().front()));
  const Id seen_once = kFirstLandmark + visible().front();
  const PoseReport report = advance();
  ASSERT_THAT(report.landmarks, SizeIs(1));
  EXPECT_EQ(report.landmarks.front().verdict, LinkVerdict::waiting);
  EXPECT_THAT(policy_->undetermined(), ElementsAre(seen_once));
  EXPECT_THAT(policy_->landmarks(), IsEmpty());
  // No pose has the id of a landmark, whether that is in the graph or waits.
  policy_->end_pose();
  const Factor odometry = world_.edge(newest(), seen_once, world_.identity(), Sigma(0.05, 0.02));
  EXPECT_THAT(message_of(
                  [&] {
                    policy_->add_pose(world_.variable(seen_once), {&odometry, 1});
                  },
                  ErrorCode::input),
              HasSubstr("has the id of a landmark"));
  ASSERT_TRUE(policy_->finish());
  EXPECT_THAT(policy_->undetermined(), ElementsAre(seen_once));
}

TEST_P(Bearings, ThatWaitAreJudgedWhenAMeasurementDeterminesTheLandmark) {
  begin("strategy=apfl,landmark_gain=0");
  offer(bearing_of(visible().front()));
  const int landmark = visible().front();
  EXPECT_EQ(advance().landmarks.front().verdict, LinkVerdict::waiting);
  const LandmarkObservation position = see(landmark);
  policy_->offer_landmark(position);
  const PoseReport report = advance();
  ASSERT_THAT(report.landmarks, SizeIs(2));
  EXPECT_TRUE(report.landmarks.front().added);
  EXPECT_EQ(report.landmarks.front().pose, 0);
  EXPECT_EQ(report.landmarks.back().pose, 1);
  for (const LandmarkReport& one : report.landmarks) EXPECT_EQ(one.verdict, LinkVerdict::linked);
  EXPECT_THAT(policy_->landmarks(), ElementsAre(kFirstLandmark + landmark));
  EXPECT_THAT(policy_->undetermined(), IsEmpty());
}

TEST_P(Bearings, WaitNoMoreWhereTheirPosesLeave) {
  begin("keep=4");
  const Id seen_once = kFirstLandmark + visible().front();
  offer(bearing_of(visible().front()));
  EXPECT_EQ(advance().landmarks.front().verdict, LinkVerdict::waiting);
  // On the second pose: the first stays for ever.
  offer(bearing_of(visible().front()));
  std::vector<LandmarkReport> later;
  for (int k = 0; k < 3 * kLap; ++k)
    std::ranges::copy(advance().landmarks, std::back_inserter(later));
  for (const LandmarkReport& one : later) {
    EXPECT_EQ(one.landmark, seen_once);
    if (one.verdict == LinkVerdict::unmatched) {
      EXPECT_THAT(policy_->kept(), Not(Contains(one.pose)));
    }
  }
  policy_->end_pose();
  ASSERT_TRUE(policy_->finish());
  EXPECT_LE(policy_->kept().size(), 4U);
}

TEST_P(Bearings, LetPosesLeaveWhereLittleIsLost) {
  const auto kept = [&](const std::string& options) {
    draw_ = test::Draw(7);
    begin(options);
    drive(4 * kLap);
    policy_->end_pose();
    EXPECT_TRUE(policy_->finish());
    EXPECT_THAT(policy_->landmarks(), SizeIs(8));
    EXPECT_LT(policy_->estimator().chi2(), 1.5 * GetParam() * policy_->estimator().factor_count());
    return policy_->kept().size();
  };
  EXPECT_LT(2 * kept("landmark_loss=3"), kept("landmark_loss=0"));
}

TEST_P(Bearings, ThatContradictAreNotUsedWithAGate) {
  begin("strategy=apfl,gate=0.999");
  std::vector<LandmarkObservation> first;
  int landmark = visible().front();
  offer(bearing_of(landmark));
  advance();
  bool contradicted = false;
  for (int k = 0; k < 2 * kLap && !contradicted; ++k) {
    const auto near = visible();
    if (std::ranges::find(near, landmark) == near.end()) {
      advance();
      continue;
    }
    LandmarkObservation seen = bearing_of(landmark);
    if (!policy_->landmarks().empty()) {
      seen.factors.front().measurement = bearing_of((landmark + 4) % 8).factors.front().measurement;
      policy_->offer_landmark(seen);
      const PoseReport report = advance();
      ASSERT_THAT(report.landmarks, SizeIs(1));
      EXPECT_EQ(report.landmarks.front().verdict, LinkVerdict::inconsistent);
      contradicted = true;
    } else {
      policy_->offer_landmark(seen);
      advance();
    }
  }
  EXPECT_TRUE(contradicted);
}

}  // namespace
}  // namespace cairn::compact
