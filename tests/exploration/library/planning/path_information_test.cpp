// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/path_information.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "cairn/exploration/exploration.hpp"
#include "cairn/runtime/error.hpp"
#include "path_graphs.hpp"

namespace cairn {
namespace {

using Eigen::Matrix3d;
using test::PathGraph;
using State = PathInformation::State;

constexpr PathInformationOptions kThesisEntropy{.entropy = EntropyForm::thesis};

TEST(PathInformation, AStartIsWhereTheRobotIs) {
  const PathGraph graph = test::wandering(40, 6.0, 1);
  PathInformation information(graph.situation(), kThesisEntropy);
  const State start = information.start();
  EXPECT_EQ(start.steps(), 0);
  EXPECT_EQ(start.trajectory_change(), 0.0);
  EXPECT_EQ(start.loops(), 0);
  EXPECT_EQ(start.before().steps(), 0);
  EXPECT_EQ(information.poses(), 40);
  EXPECT_NEAR(information.trajectory_entropy(),
              trajectory_entropy(*graph.estimator, graph.poses, graph.first_sigma), 1e-9);
  const test::FullInference now = test::infer(graph, start);
  EXPECT_LT((start.covariance() - now.end).norm(), 1e-9 * now.end.norm());
}

TEST(PathInformation, WithoutLoopsItIsOdometry) {
  PathGraph graph = test::wandering(50, 8.0, 2);
  graph.match.range = 0.0;
  PathInformation information(graph.situation(), kThesisEntropy);
  RandomNumbers random(3);
  const std::vector<Pose2> motions = test::random_motions(graph.pose, 25, 8.0, random);
  const State end = information.extended(information.start(), motions);
  EXPECT_EQ(end.loops(), 0);
  EXPECT_EQ(end.steps(), 25);
  const test::FullInference full = test::infer(graph, end);
  EXPECT_NEAR(end.trajectory_change(), full.trajectory_entropy, 1e-9);
  EXPECT_LT((end.covariance() - full.end).norm(), 1e-9 * full.end.norm());
  EXPECT_EQ(end.loop_log_determinant(), 0.0);
}

/// Paths that close several loops, each against an estimator that has them all.
TEST(PathInformation, ExactLoopsAreThoseOfFullInference) {
  int loops = 0, most = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const PathGraph graph = test::wandering(45, 7.0, seed);
    PathInformation information(graph.situation(),
                                {.entropy = EntropyForm::thesis, .loop_gain = 0.2});
    RandomNumbers random(seed + 100);
    for (int path = 0; path < 4; ++path) {
      const std::vector<Pose2> motions = test::random_motions(graph.pose, 25, 7.0, random);
      const State end = information.extended(information.start(), motions);
      const test::FullInference full = test::infer(graph, end);
      EXPECT_NEAR(end.trajectory_change(), full.trajectory_entropy, 1e-8);
      EXPECT_LT((end.covariance() - full.end).norm(), 1e-8 * full.end.norm());
      loops += end.loops();
      most = std::max(most, end.loops());
    }
  }
  EXPECT_GT(loops, 60);
  EXPECT_GE(most, 4);
}

/// So many that the stretches between them fill several registers.
TEST(PathInformation, ManyLoopsAreThoseOfFullInference) {
  int most = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const PathGraph graph = test::wandering(60, 5.0, seed);
    PathInformation information(graph.situation(),
                                {.entropy = EntropyForm::thesis, .loop_gain = 0.02});
    RandomNumbers random(seed + 100);
    State end = information.start();
    for (const Pose2& motion : test::random_motions(graph.pose, 150, 5.0, random)) {
      end = information.extended(end, motion);
      if (end.steps() % 10 > 0) continue;
      const test::FullInference full = test::infer(graph, end);
      EXPECT_NEAR(end.trajectory_change(), full.trajectory_entropy, 1e-8);
      EXPECT_LT((end.covariance() - full.end).norm(), 1e-8 * full.end.norm());
    }
    most = std::max(most, end.loops());
  }
  EXPECT_GT(most, 20);
}

TEST(PathInformation, LogDeterminantsAreTheDenseOnes) {
  int loops = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const PathGraph graph = test::wandering(40, 4.0, seed);
    PathInformation information(graph.situation(), {.loop_gain = 0.1});
    RandomNumbers random(seed);
    const State end = information.extended(information.start(),
                                           test::random_motions(graph.pose, 30, 4.0, random));
    loops += end.loops();
    std::vector<Id> poses;
    const auto after = test::with_path(graph, end, poses);
    const double dense = test::dense_log_determinant(*graph.estimator, graph.poses) -
                         test::dense_log_determinant(*after, poses);
    EXPECT_NEAR(end.odometry_log_determinant() + end.loop_log_determinant(), dense,
                1e-9 * std::abs(dense));
  }
  EXPECT_GT(loops, 20);
}

/// Covariances that were dropped for want of memory are computed again, to the same values.
TEST(PathInformation, PathsOfATreeDoNotDependOnTheOrderOrTheMemory) {
  const PathGraph graph = test::wandering(60, 6.0, 5);
  PathInformation plenty(graph.situation(), {.loop_gain = 0.2});
  PathInformation none(graph.situation(), {.loop_gain = 0.2, .memory = 0.0});
  RandomNumbers random(7);
  std::vector<State> a{plenty.start()}, b{none.start()};
  for (int k = 0; k < 300; ++k) {
    const std::size_t from = random.below(a.size());
    const Pose2 motion = test::random_motions(a[from].pose(), 1, 6.0, random).front();
    a.push_back(plenty.extended(a[from], motion));
    b.push_back(none.extended(b[from], motion));
    ASSERT_EQ(a.back().loops(), b.back().loops());
    ASSERT_NEAR(a.back().trajectory_change(), b.back().trajectory_change(), 1e-12);
  }
  std::size_t best = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    if (a[k].loops() > a[best].loops()) best = k;
  }
  ASSERT_GE(a[best].loops(), 3);
  PathInformation again(graph.situation(), {.loop_gain = 0.2});
  std::vector<Pose2> motions;
  for (State at = a[best]; at.steps() > 0; at = at.before())
    motions.insert(motions.begin(), at.before().pose().between(at.pose()));
  EXPECT_NEAR(again.extended(again.start(), motions).trajectory_change(),
              a[best].trajectory_change(), 1e-9);
}

/// Estimated by the poses in the middle of parts of the trajectory, from full inference.
TEST(PathInformation, AnEstimateIsByTheMiddlePoseOfEachPart) {
  constexpr int kPoses = 45, kSampled = 7, kPart = 7, kLastPart = 3;
  static_assert((kSampled - 1) * kPart + kLastPart == kPoses);
  int loops = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const PathGraph graph = test::wandering(kPoses, 7.0, seed);
    PathInformation information(
        graph.situation(),
        {.entropy = EntropyForm::thesis, .loop_gain = 0.2, .sampled_poses = kSampled});
    RandomNumbers random(seed + 100);
    const State end = information.extended(information.start(),
                                           test::random_motions(graph.pose, 25, 7.0, random));
    loops += end.loops();
    const std::vector<double> now = test::infer(graph, information.start()).log_determinants;
    const test::FullInference full = test::infer(graph, end);
    double sum = 0.0, sum_now = 0.0;
    for (std::size_t i = 0; i < full.log_determinants.size(); ++i) {
      if (i >= kPoses)
        sum += full.log_determinants[i];
      else
        sum_now += now[i];
    }
    for (int part = 0; part < kSampled; ++part) {
      const int length = part + 1 < kSampled ? kPart : kLastPart;
      const auto middle = static_cast<std::size_t>(part * kPart + length / 2);
      sum += length * (full.log_determinants[middle] - now[middle]);
    }
    const double expected = (sum_now + sum) / (kPoses + end.steps()) - sum_now / kPoses;
    EXPECT_NEAR(end.estimated_trajectory_change(), expected, 1e-8);
    EXPECT_NEAR(end.trajectory_change(), full.trajectory_entropy, 1e-8);
  }
  EXPECT_GT(loops, 10);
}

TEST(PathInformation, AnEstimateByAllPosesHasTheBitsOfTheExactValue) {
  for (const int sampled : {0, 45, 1000, std::numeric_limits<int>::max()}) {
    int loops = 0;
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      const PathGraph graph = test::wandering(45, 7.0, seed);
      PathInformation information(graph.situation(), {.loop_gain = 0.2, .sampled_poses = sampled});
      RandomNumbers random(seed + 100);
      const State end = information.extended(information.start(),
                                             test::random_motions(graph.pose, 25, 7.0, random));
      loops += end.loops();
      EXPECT_EQ(end.estimated_trajectory_change(), end.trajectory_change());
    }
    EXPECT_GT(loops, 0);
  }
}

/// On a long trajectory, where the default samples every fifth pose.
TEST(PathInformation, AnEstimateIsNearTheExactValue) {
  const PathGraph graph = test::wandering(600, 12.0, 4);
  PathInformation information(graph.situation(), {.loop_gain = 0.2});
  RandomNumbers random(5);
  double error = 0.0, size = 0.0;
  for (int path = 0; path < 40; ++path) {
    const State end = information.extended(information.start(),
                                           test::random_motions(graph.pose, 30, 12.0, random));
    const double exact = end.trajectory_change();
    error += std::pow(end.estimated_trajectory_change() - exact, 2);
    size += exact * exact;
  }
  EXPECT_GT(error, 0.0);
  EXPECT_LT(std::sqrt(error), 0.05 * std::sqrt(size)) << std::sqrt(error / size);
}

TEST(PathInformation, ExpectsTheLoopClosuresOfThePolicy) {
  int many = 0, few = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    PathGraph graph = test::wandering(45, 7.0, seed);
    RandomNumbers random(seed + 100);
    const std::vector<Pose2> motions = test::random_motions(graph.pose, 40, 7.0, random);
    const auto loops = [&](double of_policy, double option) {
      graph.match.loop_gain = of_policy;
      PathInformation information(graph.situation(), {.loop_gain = option});
      return information.extended(information.start(), motions).loops();
    };
    many += loops(0.2, -1.0);
    few += loops(5.0, -1.0);
    EXPECT_EQ(loops(0.2, -1.0), loops(5.0, 0.2));
    EXPECT_EQ(loops(5.0, -1.0), loops(0.2, 5.0));
  }
  EXPECT_GT(many, few);
}

TEST(PathInformation, TheStandardEntropyChangesHalfAsMuch) {
  const PathGraph graph = test::wandering(40, 6.0, 9);
  PathInformation standard(graph.situation()), thesis(graph.situation(), kThesisEntropy);
  RandomNumbers random(7);
  const std::vector<Pose2> motions = test::random_motions(graph.pose, 15, 6.0, random);
  EXPECT_NEAR(standard.extended(standard.start(), motions).trajectory_change(),
              0.5 * thesis.extended(thesis.start(), motions).trajectory_change(), 1e-12);
}

TEST(PathInformation, ARobotBeyondTheLastPoseThatIsKept) {
  PathGraph graph = test::wandering(40, 6.0, 4);
  const Pose2 since(0.4, 0.0, 0.2);
  const Matrix3d before = test::infer(graph, PathInformation(graph.situation()).start()).end;
  graph.pose = graph.pose * since;
  PathInformation information(graph.situation());
  const Matrix3d Ad = since.inverse().adjoint();
  const Matrix3d expected = Ad * before * Ad.transpose() + graph.robot.odometry.covariance(since);
  EXPECT_LT((information.start().covariance() - expected).norm(), 1e-9 * expected.norm());
}

/// A robot that has driven along a line, turns back, and drives along it.
std::vector<Pose2> there_and_back(int steps) {
  std::vector<Pose2> motions(static_cast<std::size_t>(steps), Pose2(-0.4, 0.0, 0.0));
  return motions;
}

TEST(PathInformation, PosesInReachAlreadyAreLeftOut) {
  PathGraph graph = test::straight(30, Pose2(0.4, 0.0, 0.0));
  PathInformation information(graph.situation(), {.loop_gain = 0.0});
  State at = information.start();
  for (const Pose2& motion : there_and_back(29)) {
    at = information.extended(at, motion);
    if (!at.closes_with()) continue;
    const Pose2 other = Pose2::from_state(graph.estimator->state(*at.closes_with()));
    EXPECT_GT((other.translation() - graph.pose.translation()).norm(), graph.match.range);
  }
  EXPECT_GT(at.loops(), 0);
}

TEST(PathInformation, WhatCannotBeMatchedIsNotClosed) {
  const PathGraph graph = test::straight(30, Pose2(0.4, 0.0, 0.0));
  int asked = 0;
  PathInformation information(graph.situation(), {.loop_gain = 0.0},
                              [&](const Pose2& older, const Pose2& newer) {
                                EXPECT_LE((older.translation() - newer.translation()).norm(), 1.5);
                                ++asked;
                                return false;
                              });
  EXPECT_EQ(information.extended(information.start(), there_and_back(29)).loops(), 0);
  EXPECT_GT(asked, 10);
}

TEST(PathInformation, ALoopMustExceedTheGain) {
  const PathGraph graph = test::straight(60, Pose2(0.4, 0.0, 0.0));
  int before = 1000;
  for (const double gain : {0.0, 3.5, 6.0, 1000.0}) {
    PathInformation information(graph.situation(), {.loop_gain = gain});
    const State end = information.extended(information.start(), there_and_back(59));
    EXPECT_LT(end.loops(), before);
    EXPECT_GE(end.loop_log_determinant(), 2.0 * gain * end.loops());
    before = end.loops();
  }
  EXPECT_EQ(before, 0);
}

/// (5.13) to (5.16) written out: covariances by (2.26) on the right tangents, and the mean of
/// logarithms with ratios along the loop.
TEST(PathInformation, LoopsOfTheThesisAreItsEquations) {
  const PathGraph graph = test::straight(30, Pose2(0.4, 0.0, 0.0));
  PathInformation information(
      graph.situation(),
      {.loops = LoopForm::thesis, .entropy = EntropyForm::thesis, .loop_gain = 0.5});
  const std::vector<Pose2> motions = there_and_back(29);
  const test::FullInference now = test::infer(graph, information.start());
  std::vector<double> log_determinants = now.log_determinants;
  const auto mean = [&] {
    double sum = 0.0;
    for (const double value : log_determinants) sum += value;
    return sum / static_cast<double>(log_determinants.size());
  };
  const double mean_now = mean();
  Matrix3d Sigma = now.end;
  State at = information.start();
  int loops = 0;
  for (const Pose2& motion : motions) {
    at = information.extended(at, motion);
    const Matrix3d F = motion.inverse().adjoint();
    Sigma = F * Sigma * F.transpose() + graph.robot.odometry.covariance(motion);
    log_determinants.push_back(std::log(Sigma.determinant()));
    if (const auto other = at.closes_with()) {
      ++loops;
      const Pose2 older = Pose2::from_state(graph.estimator->state(*other));
      std::array<double, 9> block{};
      graph.estimator->covariance(*other, *other, block);
      const Pose2 first = Pose2::from_state(graph.estimator->state(0));
      const Matrix3d prior = graph.first_sigma.array().square().matrix().asDiagonal();
      const Matrix3d A = older.between(first).adjoint();
      Matrix3d old = Eigen::Map<Matrix3d>(block.data()) + A * prior * A.transpose();
      // What loops before have made of it.
      const auto l = static_cast<std::size_t>(*other);
      old *= std::exp((log_determinants[l] - now.log_determinants[l]) / 3.0);
      const Matrix3d G = at.pose().between(older).adjoint();
      const Matrix3d closed = G * old * G.transpose() + graph.match.covariance();
      const double ratio = closed.determinant() / Sigma.determinant();
      EXPECT_LT(ratio, 1.0);
      const std::size_t k = log_determinants.size() - 1;
      for (std::size_t j = 1; j <= k - l; ++j) {
        log_determinants[l + j] +=
            std::log(1.0 + static_cast<double>(j) * (ratio - 1.0) / static_cast<double>(k - l));
      }
      Sigma = closed;
    }
    ASSERT_NEAR(at.trajectory_change(), mean() - mean_now, 1e-9);
    ASSERT_LT((at.covariance() - Sigma).norm(), 1e-9 * Sigma.norm());
  }
  EXPECT_GE(loops, 2);
}

TEST(PathInformation, WithoutPosesItSaysSo) {
  PathGraph graph = test::straight(3, Pose2(0.4, 0.0, 0.0));
  graph.poses.clear();
  EXPECT_THROW(PathInformation(graph.situation()), Error);
}

}  // namespace
}  // namespace cairn
