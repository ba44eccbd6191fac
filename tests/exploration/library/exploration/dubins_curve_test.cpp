// SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "cairn/exploration/dubins_curve.hpp"

namespace cairn {
namespace {

using Eigen::Vector3d;
using std::numbers::pi;

using Word = std::array<int, 3>;
constexpr std::array<Word, 6> kWords{
    {{1, 0, 1}, {-1, 0, -1}, {1, 0, -1}, {-1, 0, 1}, {-1, 1, -1}, {1, -1, 1}}};

/// Where a word leads on arcs of radius 1, by the equations of motion alone: no circle's centre, no
/// tangent.
Vector3d driven(const Word& word, const Vector3d& parts) {
  double x = 0.0, y = 0.0, theta = 0.0;
  for (int k = 0; k < 3; ++k) {
    const double turn = word[static_cast<std::size_t>(k)], part = parts[k];
    if (turn == 0.0) {
      x += part * std::cos(theta);
      y += part * std::sin(theta);
    } else {
      x += (std::sin(theta + turn * part) - std::sin(theta)) / turn;
      y -= (std::cos(theta + turn * part) - std::cos(theta)) / turn;
      theta += turn * part;
    }
  }
  return {x, y, theta};
}

Vector3d missed(const Word& word, const Vector3d& parts, const Pose2& to) {
  Vector3d apart = driven(word, parts) - Vector3d(to.x(), to.y(), to.theta());
  apart[2] = std::remainder(apart[2], 2.0 * pi);
  return apart;
}

/// Newton's method from one guess; none: it leads to no curve.
std::optional<Vector3d> refined(const Word& word, Vector3d parts, const Pose2& to) {
  constexpr double kStep = 1e-6, kThere = 1e-10;
  for (int k = 0; k < 25; ++k) {
    const Vector3d error = missed(word, parts, to);
    if (error.norm() < kThere) {
      for (int n = 0; n < 3; ++n) {
        if (word[static_cast<std::size_t>(n)] != 0)
          parts[n] -= 2.0 * pi * std::floor(parts[n] / (2.0 * pi));
      }
      if (parts.minCoeff() < 0.0) return std::nullopt;
      return parts;
    }
    Eigen::Matrix3d J;
    for (int n = 0; n < 3; ++n) {
      Vector3d more = parts;
      more[n] += kStep;
      Vector3d change = missed(word, more, to) - error;
      change[2] = std::remainder(change[2], 2.0 * pi);
      J.col(n) = change / kStep;
    }
    if (std::abs(J.determinant()) < 1e-9) return std::nullopt;
    parts -= J.partialPivLu().solve(error);
    if (!parts.allFinite() || parts.norm() > 100.0) return std::nullopt;
  }
  return std::nullopt;
}

/// The shortest curve of all words, searched from a dense grid of guesses.
double searched_length(const Pose2& to) {
  constexpr int kGrid = 7;
  const double farthest = to.translation().norm() + 4.0;
  double shortest = std::numeric_limits<double>::infinity();
  for (const Word& word : kWords) {
    for (int a = 0; a < kGrid; ++a) {
      for (int b = 0; b < kGrid; ++b) {
        for (int c = 0; c < kGrid; ++c) {
          const double most = word[1] == 0 ? farthest : 2.0 * pi;
          const Vector3d guess(2.0 * pi * (a + 0.5) / kGrid, most * (b + 0.5) / kGrid,
                               2.0 * pi * (c + 0.5) / kGrid);
          if (const auto parts = refined(word, guess, to))
            shortest = std::min(shortest, parts->sum());
        }
      }
    }
  }
  return shortest;
}

TEST(DubinsCurve, TheShortestIsThatOfADenseSearchOverAllWords) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> side(-4.0, 4.0), angle(-pi, pi);
  int three_arcs = 0;
  for (int k = 0; k < 60; ++k) {
    // Near targets are those for which three arcs are shortest.
    const double scale = k % 2 == 0 ? 1.0 : 0.25;
    const Pose2 to(scale * side(random), scale * side(random), angle(random));
    const DubinsCurve shortest = dubins_curves(to, 1.0).front();
    three_arcs += shortest.turns[1] != 0;
    EXPECT_NEAR(shortest.length(), searched_length(to), 1e-7) << to_string(to);
  }
  EXPECT_GT(three_arcs, 3);
}

TEST(DubinsCurve, AllWordsEndExactlyAtTheirTarget) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> side(-5.0, 5.0), angle(-pi, pi), size(0.1, 3.0);
  std::array<int, 6> found{};
  for (int k = 0; k < 2000; ++k) {
    const double radius = size(random);
    const Pose2 to(side(random), side(random), angle(random));
    double before = 0.0;
    for (const DubinsCurve& curve : dubins_curves(to, radius)) {
      EXPECT_GE(curve.length(), before);
      before = curve.length();
      EXPECT_LT(to.local(curve.at(curve.length())).norm(), 1e-9);
      Vector3d parts;
      for (int n = 0; n < 3; ++n) parts[n] = curve.lengths[static_cast<std::size_t>(n)] / radius;
      const Pose2 scaled(to.x() / radius, to.y() / radius, to.theta());
      EXPECT_LT(missed(curve.turns, parts, scaled).norm(), 1e-9);
      for (std::size_t w = 0; w < kWords.size(); ++w) found[w] += kWords[w] == curve.turns;
    }
  }
  for (const int count : found) EXPECT_GT(count, 100);
}

TEST(DubinsCurve, GoesStraightOrAlongOneArcWhereThatLeadsThere) {
  EXPECT_NEAR(dubins_curves(Pose2(3.0, 0.0, 0.0), 0.5).front().length(), 3.0, 1e-12);
  EXPECT_NEAR(dubins_curves(Pose2(), 0.5).front().length(), 0.0, 1e-12);
  EXPECT_NEAR(dubins_curves(Pose2(0.5, 0.5, 0.5 * pi), 0.5).front().length(), 0.25 * pi, 1e-9);
  EXPECT_NEAR(dubins_curves(Pose2(0.0, -1.0, pi), 0.5).front().length(), 0.5 * pi, 1e-9);
}

TEST(DubinsCurve, GoesOnWithoutJumps) {
  const DubinsCurve curve = dubins_curves(Pose2(-1.0, 0.3, 2.0), 0.7).front();
  constexpr double kStep = 1e-3;
  for (double s = 0.0; s + kStep < curve.length(); s += kStep) {
    const Pose2 motion = curve.at(s).between(curve.at(s + kStep));
    EXPECT_NEAR(motion.translation().norm(), kStep, 1e-6);
    EXPECT_LE(std::abs(motion.theta()), kStep / 0.7 + 1e-12);
  }
}

}  // namespace
}  // namespace cairn
