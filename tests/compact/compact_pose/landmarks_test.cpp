// SPDX-License-Identifier: BSD-3-Clause
// Landmarks that a robot sees under a policy: which measurements are used, and what the map is
// then.
#include "observations.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/graph/packed.hpp"
#include "cairn/lie/point.hpp"
#include "cairn/lie/se2.hpp"
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
using test::Draw;
using test::log_determinant_of;
using test::PoseWorld;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using Pose = PoseWorld::Pose;

// The choice among observations -----------------------------------------------------------------

TEST(ChooseObservations, IsTheGreedyOneOfDenseAlgebra) {
  Draw draw(11);
  for (int trial = 0; trial < 40; ++trial) {
    const std::vector<int> sizes{2, 3, 2};
    constexpr int kPose = 3, kAll = 10;
    const std::array<int, 3> offsets{0, 2, 5};
    const MatrixXd prior = draw.covariance(kAll, 1.0);
    std::vector<ObservationRows> observations;
    std::vector<MatrixXd> dense;
    for (int k = 0; k < 5; ++k) {
      ObservationRows rows;
      rows.e = draw.normals(2);
      rows.landmark = k % 3;
      rows.J_pose = MatrixXd::NullaryExpr(2, kPose, [&] { return draw.normal(); });
      rows.J_landmark = MatrixXd::NullaryExpr(2, sizes[k % 3], [&] { return draw.normal(); });
      MatrixXd J = MatrixXd::Zero(2, kAll);
      J.rightCols(kPose) = rows.J_pose;
      J.middleCols(offsets[k % 3], sizes[k % 3]) = rows.J_landmark;
      dense.push_back(J);
      observations.push_back(rows);
    }
    const double least = 0.8;
    const std::vector<ObservationFit> fits =
        choose_observations(observations, sizes, prior, least,
                            {.fits = [](const MeasuredFit&) { return true; },
                             .linear = [](std::size_t, const MatrixXd&) { return true; }});
    // The same, with information matrices, always from the beginning.
    std::vector<bool> used(dense.size());
    for (;;) {
      MatrixXd H = test::symmetric_inverse(prior);
      VectorXd g = VectorXd::Zero(kAll);
      for (std::size_t k = 0; k < dense.size(); ++k) {
        if (!used[k]) continue;
        H += dense[k].transpose() * dense[k];
        g += dense[k].transpose() * observations[k].e;
      }
      const VectorXd mean = -test::dense_solution(H, g);
      std::size_t best = dense.size();
      double most = least;
      for (std::size_t k = 0; k < dense.size(); ++k) {
        if (used[k]) continue;
        const MatrixXd more = H + dense[k].transpose() * dense[k];
        const double gain = 0.5 * (log_determinant_of(more) - log_determinant_of(H));
        if (gain > most) {
          best = k;
          most = gain;
        }
        const MatrixXd V =
            MatrixXd::Identity(2, 2) + dense[k] * test::symmetric_inverse(H) * dense[k].transpose();
        const VectorXd e = observations[k].e + dense[k] * mean;
        if (fits[k].used) continue;  // those that never were: of the end
        EXPECT_GE(gain, fits[k].fit.gain * (1.0 - 1e-9));
        if (std::ranges::count(used, true) ==
            std::ranges::count_if(fits, [](const ObservationFit& f) { return f.used; })) {
          EXPECT_NEAR(fits[k].fit.gain, gain, 1e-9 * (1.0 + gain));
          EXPECT_NEAR(fits[k].fit.innovation, e.dot(test::dense_solution(V, e)), 1e-8);
        }
      }
      if (best == dense.size()) break;
      EXPECT_TRUE(fits[best].used) << trial;
      EXPECT_NEAR(fits[best].fit.gain, most, 1e-9 * (1.0 + most));
      used[best] = true;
    }
    for (std::size_t k = 0; k < dense.size(); ++k) EXPECT_EQ(fits[k].used, used[k]);
  }
}

TEST(ChooseObservations, LeavesOutWhatDoesNotPass) {
  const std::vector<int> sizes{1};
  const ObservationRows rows{.e = VectorXd::Constant(1, 3.0),
                             .J_pose = MatrixXd::Identity(1, 1),
                             .J_landmark = -MatrixXd::Identity(1, 1),
                             .landmark = 0};
  const std::vector<ObservationRows> both{rows, rows};
  const auto fits =
      choose_observations(both, sizes, 4.0 * MatrixXd::Identity(2, 2), 0.1,
                          {.fits = [](const MeasuredFit& fit) { return fit.innovation > 1.5; },
                           .linear = [](std::size_t, const MatrixXd&) { return true; }});
  // V = 1 + 8: ½ ln 9, and 9/9 for e = 3.
  EXPECT_NEAR(fits[0].fit.gain, 0.5 * std::log(9.0), 1e-12);
  EXPECT_NEAR(fits[0].fit.innovation, 1.0, 1e-12);
  for (const ObservationFit& fit : fits) {
    EXPECT_TRUE(fit.informative);
    EXPECT_FALSE(fit.used);
  }
}

TEST(ChooseObservations, AsksWhetherOneIsLinearWithTheCovarianceThatIsLeft) {
  const std::vector<int> sizes{1, 1};
  const ObservationRows first{.e = VectorXd::Zero(1),
                              .J_pose = 3.0 * MatrixXd::Identity(1, 1),
                              .J_landmark = MatrixXd::Zero(1, 1),
                              .landmark = 0};
  const ObservationRows second{.e = VectorXd::Zero(1),
                               .J_pose = MatrixXd::Identity(1, 1),
                               .J_landmark = -MatrixXd::Identity(1, 1),
                               .landmark = 1};
  const MatrixXd prior = Eigen::Vector3d(1.0, 4.0, 9.0).asDiagonal();
  const std::vector<ObservationRows> both{second, first};
  double most = 100.0;
  std::vector<MatrixXd> asked;
  const auto choose = [&] {
    return choose_observations(both, sizes, prior, 0.1,
                               {.fits = [](const MeasuredFit&) { return true; },
                                .linear =
                                    [&](std::size_t k, const MatrixXd& joint) {
                                      if (k == 0) asked.push_back(joint);
                                      return joint(1, 1) < most;
                                    }});
  };
  for (const ObservationFit& fit : choose()) EXPECT_TRUE(fit.used && fit.linear);
  // The landmark of the second, then the pose; once after the first was used: 9/(1 + 81).
  EXPECT_NEAR((asked.front() - MatrixXd(Eigen::Vector2d(4.0, 9.0).asDiagonal())).norm(), 0.0,
              1e-12);
  EXPECT_NEAR((asked.back() - MatrixXd(Eigen::Vector2d(4.0, 9.0 / 82.0).asDiagonal())).norm(), 0.0,
              1e-12);
  most = 0.0;
  for (const ObservationFit& fit : choose()) {
    EXPECT_TRUE(fit.informative);
    EXPECT_FALSE(fit.used || fit.linear);
  }
}

// The policy --------------------------------------------------------------------------------------

/// Everything that is measured as a graph of its own, too.
class Landmarks : public LandmarkCourse {
 protected:
  void begin(const std::string& options) {
    begin_course("range=3,angle=3.15" + (options.empty() ? "" : "," + options));
  }
  /// Drives on, and sees what is near.
  std::vector<PoseReport> drive(int poses) {
    std::vector<PoseReport> reports;
    for (int k = 0; k < poses; ++k) {
      offer_all();
      reports.push_back(advance());
    }
    return reports;
  }
  void offer_all() {
    for (const int landmark : visible()) {
      const LandmarkObservation observation = see(landmark);
      policy_->offer_landmark(observation);
      if (!all_.find(observation.landmark.id)) {
        std::vector<double> state(static_cast<std::size_t>(GetParam()));
        std::copy_n(landmarks_[landmark].data(), GetParam(), state.begin());
        all_.add_variable(point_, observation.landmark.id, state);
      }
      put(observation.factors.front());
    }
  }
  double distance_to_truth(Id landmark) {
    const auto state = policy_->estimator().state(landmark);
    Vector3d at = Vector3d::Zero();
    std::copy_n(state.begin(), GetParam(), at.data());
    return (at - landmarks_[static_cast<std::size_t>(landmark - kFirstLandmark)]).norm();
  }
};

INSTANTIATE_TEST_SUITE_P(InThePlaneAndInSpace, Landmarks, testing::Values(2, 3));

TEST_P(Landmarks, AllOfThemAreTheBatchSolution) {
  begin("strategy=apal");
  drive(2 * kLap);
  policy_->end_pose();
  ASSERT_TRUE(policy_->finish());
  Graph batch = all_.clone();
  test::solve_densely(batch);
  const double chi2 = test::chi2_of(batch);
  EXPECT_NEAR(policy_->estimator().chi2(), chi2, 1e-6 * chi2);
  EXPECT_EQ(policy_->factor_count(), batch.factor_count());
  EXPECT_THAT(policy_->landmarks(), SizeIs(8));
  for (int v = 0; v < batch.variable_count(); ++v) {
    const auto there = batch.state(v), estimate = policy_->estimator().state(batch.id(v));
    VectorXd difference(batch.type(v).tangent_size());
    batch.type(v).local(1, there.data(), estimate.data(), difference.data());
    EXPECT_LT(difference.norm(), 1e-6) << batch.describe_variable(v);
  }
}

TEST_P(Landmarks, TheGainIsTheEntropyThatTheGraphLoses) {
  begin("strategy=apfl,estimator=batch,landmark_gain=0.7");
  int compared = 0;
  for (int k = 0; k < kLap + 6; ++k) {
    // One at a time, so that each is judged by itself.
    const std::vector<int> near = visible();
    const int landmark = near[static_cast<std::size_t>(k) % near.size()];
    const Id id = kFirstLandmark + landmark;
    const LandmarkObservation observation = see(landmark);
    policy_->offer_landmark(observation);
    const bool known = all_.find(id).has_value();
    if (!known) {
      std::vector<double> state(static_cast<std::size_t>(GetParam()));
      std::copy_n(landmarks_[landmark].data(), GetParam(), state.begin());
      all_.add_variable(point_, id, state);
    }
    Graph before = all_.clone();
    for (int v = 0; v < before.variable_count() && known; ++v) {
      before.set_state(v, before.id(v) == newest() ? policy_->newest_state()
                                                   : policy_->estimator().state(before.id(v)));
    }
    Graph after = before.clone();
    after.add_factor(seen_, std::array{*after.find(newest()), *after.find(id)},
                     observation.factors.front().measurement,
                     observation.factors.front().information);
    const PoseReport report = advance();
    ASSERT_THAT(report.landmarks, SizeIs(1));
    const LandmarkReport& said = report.landmarks.front();
    EXPECT_EQ(said.landmark, id);
    EXPECT_EQ(said.added, !known);
    if (known) {
      const double gain = 0.5 * (log_determinant_of(dense_system(after).H) -
                                 log_determinant_of(dense_system(before).H));
      EXPECT_NEAR(said.gain, gain, 1e-6 * gain) << k;
      EXPECT_EQ(said.verdict, gain > 0.7 ? LinkVerdict::linked : LinkVerdict::uninformative);
      ++compared;
    } else {
      EXPECT_EQ(said.verdict, LinkVerdict::linked);
    }
    if (said.verdict == LinkVerdict::linked) {
      Factor factor = observation.factors.front();
      put(factor);
    }
  }
  EXPECT_GT(compared, 15);
}

TEST_P(Landmarks, FewOfThemBoundTheErrorOfOdometry) {
  begin("landmark_gain=1.5");
  int offered = 0, used = 0, dropped = 0;
  for (const PoseReport& report : drive(6 * kLap)) {
    dropped += !report.kept;
    for (const LandmarkReport& landmark : report.landmarks) {
      ++offered;
      used += landmark.verdict == LinkVerdict::linked;
    }
  }
  policy_->end_pose();
  ASSERT_TRUE(policy_->finish());
  EXPECT_LT(used, offered / 2);
  EXPECT_GT(dropped, 2 * kLap);
  const auto last = policy_->estimator().state(policy_->kept().back());
  EXPECT_LT(world_.log(world_.between(truth_.back(), last)).norm(), 0.5);
  for (const Id landmark : policy_->landmarks()) EXPECT_LT(distance_to_truth(landmark), 0.5);
}

TEST_P(Landmarks, OnesThatAreNewWaitForAPoseThatIsKept) {
  begin("pose_gain=1e9");
  EXPECT_TRUE(advance().kept);
  policy_->offer_landmark(see(0));
  const PoseReport dropped = advance();
  EXPECT_FALSE(dropped.kept);
  ASSERT_THAT(dropped.landmarks, SizeIs(1));
  EXPECT_EQ(dropped.landmarks.front().verdict, LinkVerdict::unmatched);
  EXPECT_EQ(dropped.landmarks.front().gain, std::numeric_limits<double>::infinity());
  EXPECT_THAT(policy_->landmarks(), IsEmpty());
  // A pose that is fixed is kept, and the landmark with it.
  begin("pose_gain=1e9");
  policy_->offer_landmark(see(0));
  const PoseReport kept = advance();
  ASSERT_THAT(kept.landmarks, SizeIs(1));
  EXPECT_TRUE(kept.landmarks.front().added);
  EXPECT_THAT(policy_->landmarks(), ElementsAre(kFirstLandmark));
}

TEST_P(Landmarks, ThatContradictAreNotUsedWithAGate) {
  begin("gate=0.999,landmark_gain=0.01");
  drive(kLap);
  const int landmark = visible().front();
  LandmarkObservation wrong = see(landmark);
  wrong.factors.front().measurement[0] += 40.0;
  policy_->offer_landmark(wrong);
  const PoseReport report = advance();
  ASSERT_THAT(report.landmarks, SizeIs(1));
  EXPECT_EQ(report.landmarks.front().verdict, LinkVerdict::inconsistent);
  EXPECT_GT(report.landmarks.front().innovation, 100.0);
}

TEST_P(Landmarks, ThatOverflowAreNotUsed) {
  begin("");
  drive(kLap);
  LandmarkObservation far = see(visible().front(), 1e-3);
  far.factors.front().measurement[0] = 1e160;
  policy_->offer_landmark(far);
  const PoseReport report = advance();
  ASSERT_THAT(report.landmarks, SizeIs(1));
  EXPECT_EQ(report.landmarks.front().verdict, LinkVerdict::inconsistent);
  EXPECT_TRUE(std::isfinite(policy_->estimator().chi2()));
}

TEST_P(Landmarks, MoveWithAGraphThatAbsoluteMeasurementsPutInItsPlace) {
  // Nothing is fixed: the first pose is at the origin of a frame of its own.
  const Pose start = world_.exp(VectorXd::Constant(world_.tangent(), 0.9));
  begin("strategy=apal");
  policy_ = registry_.make<PosePolicy>("compact_pose:range=3,angle=3.15,strategy=apal");
  policy_->add_pose(world_.variable(0, world_.identity()), {});
  all_.set_fixed(0, false);
  const auto prior_type =
      registry_.factor_type(GetParam() == 2 ? "EDGE_PRIOR_SE2" : "EDGE_PRIOR_SE3:QUAT");
  const MatrixXd S = Sigma(0.1, 0.05);
  for (int k = 0; k < kLap; ++k) {
    offer_all();
    if (k == 7 || k == 13) {
      const Factor prior{prior_type,
                         {newest()},
                         world_.moved(world_.compose(start, truth_.back()), draw_.error(S)),
                         pack(test::symmetric_inverse(S))};
      policy_->offer_prior(prior);
      put(prior);
    }
    advance();
  }
  policy_->end_pose();
  ASSERT_TRUE(policy_->finish());
  EXPECT_GT(policy_->landmarks().size(), 6U);
  Graph batch = all_.clone();
  for (int v = 0; v < batch.variable_count(); ++v)
    batch.set_state(v, policy_->estimator().state(batch.id(v)));
  test::solve_densely(batch);
  const double there = policy_->estimator().chi2(), chi2 = test::chi2_of(batch);
  EXPECT_NEAR(there, chi2, 1e-6 * chi2);
  EXPECT_LT(chi2, 2.0 * 3.0 * batch.factor_count());
  const auto first = policy_->estimator().state(0);
  EXPECT_LT(world_.log(world_.between(start, first)).norm(), 0.5);
}

TEST_P(Landmarks, OfAMapAreSeenAgainInASecondSession) {
  begin("");
  drive(kLap);
  policy_->end_pose();
  ASSERT_TRUE(policy_->finish());
  const Graph map = policy_->estimator().graph();
  const std::vector<Id> known = policy_->landmarks();
  ASSERT_THAT(known, SizeIs(8));
  policy_ = registry_.make<PosePolicy>("compact_pose:range=3,angle=3.15,reuse=true");
  policy_->load(map);
  EXPECT_THAT(policy_->landmarks(), testing::UnorderedElementsAreArray(known));
  EXPECT_EQ(policy_->unlocated().size(), map.variable_count() - known.size());
  // From the beginning again, with other ids.
  constexpr Id kSecond = 100;
  policy_->add_pose(world_.variable(kSecond, world_.identity()), {});
  truth_ = {world_.identity()};
  const auto observation = [&](Id pose) {
    LandmarkObservation seen = see(visible().front());
    seen.factors.front().variables.front() = pose;
    return seen;
  };
  EXPECT_THAT(message_of([&] { policy_->offer_landmark(observation(kSecond)); }, ErrorCode::input),
              HasSubstr("not known where the pose is on the map"));
  const MatrixXd S = Sigma(0.05, 0.02);
  const Factor link = world_.edge(0, kSecond, world_.identity(), S);
  EXPECT_EQ(policy_->offer(0, {&link, 1}).verdict, LinkVerdict::linked);
  policy_->offer_landmark(observation(kSecond));
  const PoseReport report = policy_->end_pose();
  ASSERT_THAT(report.landmarks, SizeIs(1));
  EXPECT_FALSE(report.landmarks.front().added);
  EXPECT_TRUE(policy_->finish());
  EXPECT_THAT(policy_->landmarks(), SizeIs(8));
}

TEST_P(Landmarks, StayWherePosesLeave) {
  begin("keep=8");
  drive(4 * kLap);
  policy_->end_pose();
  ASSERT_TRUE(policy_->finish());
  EXPECT_LE(policy_->kept().size(), 8U);
  EXPECT_THAT(policy_->landmarks(), SizeIs(8));
  EXPECT_EQ(policy_->estimator().graph().variable_count(),
            static_cast<int>(policy_->kept().size() + 8));
  for (const Id landmark : policy_->landmarks()) EXPECT_LT(distance_to_truth(landmark), 1.0);
}

TEST_P(Landmarks, WhatIsNoLandmarkIsRefused) {
  begin("");
  drive(3);
  const LandmarkObservation good = see(visible().front());
  const auto refusal = [&](LandmarkObservation observation) {
    return message_of([&] { policy_->offer_landmark(observation); }, ErrorCode::input);
  };
  LandmarkObservation bad = good;
  bad.landmark.fixed = true;
  EXPECT_THAT(refusal(bad), HasSubstr("is fixed"));
  bad = good;
  bad.landmark.type = world_.types().pose;
  EXPECT_THAT(refusal(bad), HasSubstr("not a landmark"));
  bad = good;
  bad.landmark.id = newest();
  EXPECT_THAT(refusal(bad), HasSubstr("has the id of something else"));
  bad = good;
  bad.factors.front().variables.front() = 0;
  EXPECT_THAT(refusal(bad), HasSubstr("is not on these two"));
  bad = good;
  bad.factors.front().type = world_.types().edge;
  EXPECT_THAT(refusal(bad), HasSubstr("is not a measurement of"));
  bad = good;
  bad.factors.front().information.pop_back();
  EXPECT_THAT(refusal(bad), HasSubstr("expected"));
  bad = good;
  bad.factors.front().type = nullptr;
  EXPECT_THAT(refusal(bad), HasSubstr("without a type"));
  bad.landmark.type = nullptr;
  EXPECT_THAT(refusal(bad), HasSubstr("has no type"));
  // An id that is a landmark's is no pose's.
  const Id landmark = policy_->landmarks().front();
  policy_->end_pose();
  const Factor odometry = world_.edge(newest(), landmark, world_.identity(), Sigma(0.05, 0.02));
  EXPECT_THAT(message_of(
                  [&] {
                    policy_->add_pose(world_.variable(landmark), {&odometry, 1});
                  },
                  ErrorCode::input),
              HasSubstr("has the id of a landmark"));
}

struct SeenBearing {
  static constexpr std::string_view kTag = "TEST_SEEN_BEARING";
  static constexpr int kResidual = 1, kMeasurement = 1;
  using Variables = std::tuple<Se2, PointXY>;
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 3>& pose, const Vector<S, 2>& point,
                               const Vector<double, 1>& z) {
    using std::atan2;
    const Vector<S, 3> seen = Se2::between<S>(pose, Vector<S, 3>(point[0], point[1], S(0.0)));
    return Vector<S, 1>(atan2(seen[1], seen[0]) - z[0]);
  }
};

TEST(LandmarksOfABearing, WaitWhereItDoesNotDetermineThemIfAsked) {
  Registry registry;
  const auto pose = registry.variable_type("VERTEX_SE2"),
             point = registry.variable_type("VERTEX_XY");
  for (const bool several_views : {false, true}) {
    const auto policy = registry.make<PosePolicy>(
        ComponentSpec{"compact_pose", {{"several_views", several_views ? "true" : "false"}}});
    policy->add_pose({.type = pose, .id = 0, .state = {0.0, 0.0, 0.0}, .fixed = true}, {});
    policy->offer_landmark({{.type = point, .id = 7, .state = {2.0, 1.0}},
                            {{define_factor<SeenBearing>(), {0, 7}, {0.46}, {400.0}}}});
    const PoseReport report = policy->end_pose();
    ASSERT_THAT(report.landmarks, SizeIs(1));
    EXPECT_EQ(report.landmarks.front().verdict,
              several_views ? LinkVerdict::waiting : LinkVerdict::unmatched);
    EXPECT_THAT(policy->landmarks(), IsEmpty());
    EXPECT_THAT(policy->undetermined(), ElementsAre(7));
    EXPECT_TRUE(policy->finish());
  }
}

}  // namespace
}  // namespace cairn::compact
