// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/fixed_variables.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <random>
#include <set>
#include <span>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/cairn.hpp"
#include "cairn/evaluation/graph_survey.hpp"
#include "cairn/evaluation/plausibility.hpp"
#include "cairn/geometry/pose.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/optimizer.hpp"
#include "support/components.hpp"
#include "support/planar_graph.hpp"

namespace cairn {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::StartsWith;

/// Two chains of three poses, 0 to 2 and 100 to 102, each along x from where it begins.
class FixedPosesTest : public ::testing::Test {
 protected:
  FixedPosesTest() {
    for (const Id first : {0, 100}) {
      for (Id k = 0; k < 3; ++k)
        graph_.add_variable(types_.pose, first + k, std::array{double(k), 0.0, 0.0});
      for (Id k = 0; k < 2; ++k) between(first + k, first + k + 1, {1.0, 0.0, 0.0});
    }
  }
  void between(Id a, Id b, std::array<double, 3> z, double information = 100.0) {
    const std::vector<double> omega = {information, 0, 0, information, 0, 4 * information};
    graph_.add_factor(types_.relative_pose, std::array{index(a), index(b)}, z, omega);
  }
  int index(Id id) const { return *graph_.find(id); }

  test::PlanarTypes types_;
  Graph graph_;
};

TEST_F(FixedPosesTest, TwoMapsWithTheirOwnOriginsContradictEachOther) {
  graph_.set_fixed(index(0));
  graph_.set_fixed(index(100));
  EXPECT_EQ(contradicting_fixed_variables(graph_), "") << "two components, each in its own frame";
  between(2, 100, {1.0, 5.0, 0.0});
  between(101, 1, {0.0, -5.0, 0.0}, 1e-6);  // which hardly says anything
  EXPECT_EQ(
      contradicting_fixed_variables(graph_),
      "VERTEX_SE2 0 and VERTEX_SE2 100 are both fixed, and contradict each other: 3 measurements "
      "between them leave a gap of 5.83 m and 0°. Fix one of them only, or bring both into one "
      "frame");
  EXPECT_THAT(survey_graph(graph_).suspicions,
              Contains(StartsWith("VERTEX_SE2 0 and VERTEX_SE2 100 are both fixed")));
  EXPECT_THAT(implausible_estimate(graph_, 1e6), HasSubstr("are both fixed, and contradict"));
}

TEST_F(FixedPosesTest, ThoseThatFitTheMeasurementsAreFine) {
  graph_.set_fixed(index(0));
  graph_.set_fixed(index(2));
  EXPECT_EQ(contradicting_fixed_variables(graph_), "");
  graph_.set_state(index(2), std::array{2.3, -0.2, 0.05});  // within two standard deviations
  EXPECT_EQ(contradicting_fixed_variables(graph_), "");
  graph_.set_state(index(2), std::array{4.0, 0.0, 0.0});
  EXPECT_THAT(contradicting_fixed_variables(graph_), StartsWith("VERTEX_SE2 0 and VERTEX_SE2 2"));
}

TEST_F(FixedPosesTest, AWrongMeasurementIsNamedWhereAnotherPathAgrees) {
  graph_.set_fixed(index(0));
  graph_.set_fixed(index(2));
  between(0, 2, {7.0, 3.0, 1.0});
  EXPECT_EQ(
      contradicting_fixed_variables(graph_),
      "VERTEX_SE2 0 and VERTEX_SE2 2 are both fixed: 1 measurement between them leaves a gap of "
      "5.83 m and 57.3°, though other measurements agree with both. EDGE_SE2 0 2 is wrong; a "
      "robust loss such as cauchy limits it");
}

TEST_F(FixedPosesTest, AWrongMeasurementWithinAPathIsNamed) {
  for (Id k = 2; k < 4; ++k) {
    graph_.add_variable(types_.pose, k + 1, std::array{double(k + 1), 0.0, 0.0});
    between(k, k + 1, {1.0, 0.0, 0.0});
  }
  graph_.set_fixed(index(0));
  graph_.set_fixed(index(4));
  between(1, 3, {9.0, 3.0, 1.0});
  EXPECT_THAT(contradicting_fixed_variables(graph_), HasSubstr("EDGE_SE2 1 3 is wrong"));
  between(0, 4, {4.0, 0.0, 0.0});
  EXPECT_THAT(contradicting_fixed_variables(graph_), HasSubstr("EDGE_SE2 1 3 is wrong"));
}

TEST_F(FixedPosesTest, OfSeveralThatMayBeWrongOneIsNamed) {
  graph_.set_fixed(index(0));
  graph_.set_fixed(index(2));
  graph_.set_measurement(1, std::array{1.0, 5.0, 0.0}, {});
  between(0, 2, {2.0, 0.0, 0.0});
  EXPECT_THAT(contradicting_fixed_variables(graph_),
              HasSubstr("EDGE_SE2 0 1 or another of 2 is wrong"));
}

TEST(FixedPoses, PosesPlacedByPriorsAreComparedToo) {
  CAIRN_NEEDS("types", "slam2d");
  Graph graph;
  const auto certain = Information::sigmas(0.1, 0.1, 0.05);
  for (int k = 0; k < 5; ++k) graph.add(k, Pose2(k, 0.0, 0.0));
  for (int k = 0; k < 4; ++k) graph.add(Between(k, k + 1, Pose2(1.0, 0.0, 0.0)), certain);
  graph.set_fixed(0);
  EXPECT_EQ(contradicting_fixed_variables(graph), "");
  graph.add(Prior(4, Pose2(9.0, 4.0, 0.0)), Information::sigmas(9.0, 9.0, 9.0));
  EXPECT_EQ(contradicting_fixed_variables(graph), "") << "which hardly says anything";
  graph.add(Prior(2, Pose2(2.0, 8.2, 0.0)), certain);
  EXPECT_EQ(contradicting_fixed_variables(graph),
            "VERTEX_SE2 0 and VERTEX_SE2 2 are placed by FIX and EDGE_PRIOR_SE2 2, and contradict "
            "each other: 2 measurements between them leave a gap of 8.2 m and 0°. Place one of "
            "them only, or bring both into one frame");
  graph.add(Prior(3, Pose2(3.0, 0.0, 0.0)), certain);
  EXPECT_THAT(contradicting_fixed_variables(graph),
              HasSubstr("VERTEX_SE2 2 and VERTEX_SE2 3 are placed by EDGE_PRIOR_SE2 2 and "
                        "EDGE_PRIOR_SE2 3"));
}

TEST_F(FixedPosesTest, TheWorstOfManyIsNamed) {
  for (const Id id : {0, 2, 100, 102}) graph_.set_fixed(index(id));
  graph_.set_state(index(2), std::array{5.0, 0.0, 0.0});
  graph_.set_state(index(102), std::array{9.0, 0.0, 0.0});
  EXPECT_THAT(contradicting_fixed_variables(graph_),
              StartsWith("VERTEX_SE2 100 and VERTEX_SE2 102"));
}

TEST_F(FixedPosesTest, AreComparedAgainstTheDirectionOfAFactorToo) {
  between(100, 2, {-1.0, 0.0, 0.0});
  graph_.set_fixed(index(0));
  graph_.set_fixed(index(100));
  graph_.set_state(index(100), std::array{3.0, 0.0, 0.0});
  EXPECT_EQ(contradicting_fixed_variables(graph_), "");
  graph_.set_state(index(100), std::array{1.0, 0.0, 0.0});
  EXPECT_THAT(contradicting_fixed_variables(graph_), HasSubstr("a gap of 2 m"));
}

/// Poses and landmarks in the plane, and landmarks that are seen, all by values.
class FixedLandmarks : public ::testing::Test {
 protected:
  void SetUp() override { CAIRN_NEEDS("types", "slam2d"); }
  /// Five poses along x, a metre apart.
  void drive(Id first, double y = 0.0) {
    for (int k = 0; k < 5; ++k) graph_.add(first + k, Pose2(k, y, 0.0));
    for (int k = 0; k < 4; ++k)
      graph_.add(Between(first + k, first + k + 1, Pose2(1.0, 0.0, 0.0)), certain_);
  }
  void see(Id pose, Id landmark, const Point2& measured) {
    graph_.add(Observation(pose, landmark, measured), Information::sigmas(0.1, 0.1));
  }
  void see_from_truth(Id pose, const Pose2& at, Id landmark, const Point2& point, bool range) {
    const Point2 seen = at.transform_to(point);
    graph_.add(BearingRange(pose, landmark, std::atan2(seen.y(), seen.x()), seen.norm()),
               Information::sigmas(0.01, range ? 0.1 : std::numeric_limits<double>::infinity()));
  }
  std::string named() const { return contradicting_fixed_variables(graph_); }

  Graph graph_;
  const Information certain_ = Information::sigmas(0.1, 0.1, 0.05);
};

TEST_F(FixedLandmarks, SeenFromTwoFixedPosesTheyTellThatTheseContradictEachOther) {
  for (const bool range : {true, false}) {
    graph_ = Graph();
    const Point2 point(2.0, 5.0);
    for (int k = 0; k < 3; ++k) {
      graph_.add(k, Pose2(2.0 * k, 0.0, 0.3 * k));
      graph_.set_fixed(k);
    }
    graph_.add(7, Point2(0.0, 0.0));
    for (int k = 0; k < 3; ++k) see_from_truth(k, Pose2(2.0 * k, 0.0, 0.3 * k), 7, point, range);
    EXPECT_EQ(named(), "") << range;
    const std::vector<double> elsewhere{5.0, 1.0, 0.3};
    graph_.set_state(1, elsewhere);
    EXPECT_THAT(named(), HasSubstr("VERTEX_SE2 1")) << range;
    EXPECT_THAT(named(), HasSubstr("contradict each other: ")) << range;
    EXPECT_THAT(named(), HasSubstr(range ? "2 measurements between them leave a gap of "
                                         : "3 measurements between them do not fit by "))
        << range;
  }
}

TEST_F(FixedLandmarks, AloneBetweenTwoMapsTheyTellThatTheirOriginsContradictEachOther) {
  drive(0);
  drive(100);  // 3 m to the left of the other, says what both see
  for (Id k = 0; k < 3; ++k) {
    graph_.add(1000 + k, Point2(0.0, 0.0));
    see(1 + k, 1000 + k, {0.5, 1.0});
    see(101 + k, 1000 + k, {0.5, -2.0});
  }
  graph_.set_fixed(0);
  EXPECT_EQ(named(), "");
  graph_.set_fixed(5);
  EXPECT_THAT(named(), StartsWith("VERTEX_SE2 0 and VERTEX_SE2 100 are both fixed, and contradict "
                                  "each other: 4 measurements between them leave a gap of 3 m."));
  graph_.set_state(5, std::vector{0.0, 3.0, 0.0});
  EXPECT_EQ(named(), "");
}

TEST_F(FixedLandmarks, ThatAreSeenFromADriveAreComparedWhereverItIs) {
  drive(0, 55.0);  // states that are far off
  graph_.add(10, Point2(0.0, 2.0));
  graph_.add(11, Point2(4.0, 2.0));
  graph_.add(12, Point2(2.0, -7.0));
  see(0, 10, {0.0, 2.0});
  see(4, 11, {0.0, 2.0});
  for (const int k : {5, 6}) graph_.set_fixed(k);
  EXPECT_EQ(named(), "");
  graph_.set_state(6, std::vector{0.0, 6.0});  // the same turned by a quarter
  EXPECT_EQ(named(), "");
  graph_.set_state(6, std::vector{14.0, 2.0});
  EXPECT_THAT(named(), StartsWith("VERTEX_XY 10 and VERTEX_XY 11 are both fixed, and contradict "
                                  "each other: 6 measurements between them leave gaps of up to "));
  graph_.set_fixed(0);  // which is not where either has it
  EXPECT_THAT(named(), HasSubstr("VERTEX_SE2 0"));
}

TEST_F(FixedLandmarks, SeenFromAFixedPoseAreCompared) {
  drive(0);
  graph_.add(10, Point2(4.0, 2.0));
  see(4, 10, {0.0, 2.0});
  graph_.set_fixed(0);
  graph_.set_fixed(5);
  EXPECT_EQ(named(), "");
  graph_.set_state(5, std::vector{4.0, 9.0});
  EXPECT_THAT(named(), StartsWith("VERTEX_SE2 0 and VERTEX_XY 10 are both fixed, and contradict "
                                  "each other: 5 measurements between them leave a gap of 7 m."));
}

TEST_F(FixedLandmarks, PlacedByPriorsAreComparedToo) {
  drive(0);
  graph_.add(10, Point2(4.0, 2.0));
  see(4, 10, {0.0, 2.0});
  graph_.set_fixed(0);
  graph_.add(Prior(10, Point2(4.0, 9.0)), Information::sigmas(0.1, 0.1));
  EXPECT_THAT(named(), StartsWith("VERTEX_SE2 0 and VERTEX_XY 10 are placed by FIX and "
                                  "EDGE_PRIOR_XY 10, and contradict each other"));
}

TEST_F(FixedLandmarks, AWrongSightIsNamedWhereOthersAgree) {
  drive(0);
  graph_.add(10, Point2(2.0, 2.0));
  graph_.set_fixed(0);
  graph_.set_fixed(5);
  for (const int k : {1, 3}) see(k, 10, {2.0 - k, 2.0});
  see(2, 10, {4.0, -3.0});
  EXPECT_THAT(named(), HasSubstr("EDGE_SE2_XY 2 10 is wrong; a robust loss"));
}

TEST_F(FixedLandmarks, AWrongSightOfALandmarkThatIsNotFixedIsNamedWhereOthersAgree) {
  graph_.add(10, Point2(0.0, 0.0));
  for (int k = 0; k < 4; ++k) {
    graph_.add(k, Pose2(k, 0.0, 0.0));
    graph_.set_fixed(k + 1);
    see(k, 10, k == 2 ? Point2(3.0, -3.0) : Point2(2.0 - k, 2.0));
  }
  graph_.add(Between(1, 2, Pose2(1.0, 0.0, 0.0)), certain_);
  graph_.add(Between(2, 3, Pose2(1.0, 0.0, 0.0)), certain_);
  EXPECT_THAT(named(), HasSubstr("EDGE_SE2_XY 2 10 is wrong; a robust loss"));
}

TEST(FixedCameras, ThatContradictEachOtherAreNamed) {
  CAIRN_NEEDS("types", "bundle");
  CAIRN_NEEDS("types", "slam3d");
  Registry registry;
  Graph graph;
  for (const int k : {0, 1}) {
    graph.add(Variable{registry.variable_type("VERTEX_CAMERA_BAL"),
                       k,
                       {500.0, 0.0, 0.0, 2.0 * k, 0.0, 6.0, 0.0, 0.0, 0.0, 1.0}});
    graph.set_fixed(k);
  }
  graph.add(Variable{registry.variable_type("VERTEX_TRACKXYZ"), 2, {0.0, 0.0, 0.0}});
  for (const int k : {0, 1})
    graph.add(Factor{registry.factor_type("EDGE_PROJECT_BAL"),
                     {k, 2},
                     {500.0 * (0.5 - 2.0 * k) / 6.0, 500.0 * 0.3 / 6.0},
                     {1.0, 0.0, 1.0}});
  EXPECT_EQ(contradicting_fixed_variables(graph), "");
  graph.set_state(1, std::vector{500.0, 0.0, 0.0, 2.0, 1.0, 6.0, 0.0, 0.0, 0.0, 1.0});
  EXPECT_THAT(contradicting_fixed_variables(graph),
              StartsWith("VERTEX_CAMERA_BAL 0 and VERTEX_CAMERA_BAL 1 are both fixed, and "
                         "contradict each other: 2 measurements between them do not fit by"));
}

/// CAIRN_FIXED_GRAPHS, or 50 in the plane and in space each.
unsigned graphs() {
  const char* count = std::getenv("CAIRN_FIXED_GRAPHS");
  return count ? static_cast<unsigned>(std::strtoul(count, nullptr, 10)) : 50;
}

/// A drive with noise, here and there interrupted, landmarks that are seen from it, in part by
/// their bearing alone, and from two to four of all that are fixed where they are, or placed by
/// priors with noise. States of the others say nothing.
template <class Pose, class Point>
class RandomDrive {
 public:
  explicit RandomDrive(unsigned seed) : rng_(seed) {
    drive();
    for (Id k = 0; k < 4; ++k) see(1000 + k);
    fix();
  }
  Graph graph;
  std::vector<int> known;  ///< variables
  Graph truth() const {
    Graph right = graph.clone();
    for (int v = 0; v < graph.variable_count(); ++v) {
      if (std::ranges::find(known, v) == known.end()) right.set_state(v, truth_[v]);
    }
    return right;
  }
  /// Moves one of those known, by more than all noise can.
  int displace() {
    const int v = known[rng_() % known.size()];
    std::vector<double> x(graph.state(v).begin(), graph.state(v).end());
    for (int k = 0; k < kDimension; ++k) x[k] += (rng_() % 2 ? 1.0 : -1.0) * uniform(100.0, 200.0);
    graph.set_state(v, x);
    for (int f = 0; f < graph.factor_count(); ++f) {
      if (graph.factor_type(f).arity() == 1 && graph.factor_variables(f)[0] == v)
        graph.set_measurement(f, x);
    }
    return v;
  }

 private:
  static constexpr int kTangent = Pose::kTangent, kDimension = kTangent == 3 ? 2 : 3;

  double uniform(double a, double b) { return std::uniform_real_distribution<double>(a, b)(rng_); }
  double normal(double sigma) { return std::normal_distribution<double>(0.0, sigma)(rng_); }
  typename Pose::Tangent noise(double metres, double radians) {
    typename Pose::Tangent delta;
    for (int k = 0; k < kTangent; ++k) delta[k] = normal(k < kDimension ? metres : radians);
    return delta;
  }
  Information of(double metres, double radians) const {
    std::vector<double> sigmas(kTangent, radians);
    std::fill_n(sigmas.begin(), kDimension, metres);
    return Information::sigmas(sigmas);
  }
  void remember(std::span<const double> x) { truth_.emplace_back(x.begin(), x.end()); }
  void between(Id a, Id b) {
    const Pose z = poses_[a].between(poses_[b]).retract(noise(metres_, radians_));
    graph.add(Between(a, b, z), of(metres_, radians_));
  }

  void drive() {
    metres_ = uniform(0.02, 0.2);
    radians_ = uniform(0.005, 0.08);
    const Id n = 6 + static_cast<Id>(rng_() % 20), gap = 1 + static_cast<Id>(rng_() % (2 * n));
    Pose at;
    for (Id k = 0; k < n; ++k) {
      typename Pose::Tangent step = noise(0.2, 0.3);
      step[0] += 1.0;
      at = at.retract(step);
      poses_.push_back(at);
      remember(at);
      graph.add(k, Pose());
    }
    for (Id k = 1; k < n; ++k) {
      if (k != gap) between(k - 1, k);
    }
    for (int loops = static_cast<int>(rng_() % 4); loops > 0; --loops) {
      const Id a = static_cast<Id>(rng_() % n), b = static_cast<Id>(rng_() % n);
      if (a != b) between(a, b);
    }
  }
  void see(Id landmark) {
    const Pose from = poses_[rng_() % poses_.size()];
    Point offset;
    for (int k = 0; k < kDimension; ++k) offset[k] = uniform(-6.0, 6.0);
    const Point point = from * offset;
    remember(point);
    graph.add(landmark, Point(Point::Zero()));
    const int kind = static_cast<int>(rng_() % 3);
    std::set<Id> seen;
    for (int k = 0; k < (kind == 0 ? 3 : 5); ++k)
      seen.insert(static_cast<Id>(rng_() % poses_.size()));
    for (const Id pose : seen) {
      Point z = poses_[pose].transform_to(point);
      if constexpr (kDimension == 2) {
        if (kind > 0) {
          const double range = kind == 1 ? 0.1 : std::numeric_limits<double>::infinity();
          graph.add(BearingRange(pose, landmark, std::atan2(z.y(), z.x()) + normal(0.02),
                                 std::abs(z.norm() + normal(0.1))),
                    Information::sigmas(0.02, range));
          continue;
        }
      }
      for (double& number : z) number += normal(0.1);
      graph.add(Observation(pose, landmark, z),
                Information::sigmas(std::vector<double>(kDimension, 0.1)));
    }
  }
  void fix() {
    std::set<int> chosen{static_cast<int>(rng_() % poses_.size())};
    for (int k = 1 + static_cast<int>(rng_() % 3); k > 0; --k)
      chosen.insert(static_cast<int>(rng_() % truth_.size()));
    while (chosen.size() < 2) chosen.insert(static_cast<int>(rng_() % truth_.size()));
    if (chosen.size() > 2 && rng_() % 2 == 0) chosen.erase(chosen.begin());
    for (const int v : chosen) {
      known.push_back(v);
      if (rng_() % 3 != 0) {
        graph.set_state(v, truth_[v]);
        graph.set_fixed(v);
      } else if (has_orientation(graph.type(v))) {
        graph.add(Prior(graph.id(v), Pose::from_state(truth_[v]).retract(noise(0.2, 0.05))),
                  of(0.2, 0.05));
      } else {
        Point at(Eigen::Map<const Vector<double, kDimension>>(truth_[v].data()));
        for (double& number : at) number += normal(0.2);
        graph.add(Prior(graph.id(v), at),
                  Information::sigmas(std::vector<double>(kDimension, 0.2)));
      }
    }
  }

  std::mt19937 rng_;
  double metres_ = 0.0, radians_ = 0.0;
  std::vector<Pose> poses_;
  std::vector<std::vector<double>> truth_;  ///< by variable
};

/// How many displaced variables were to be found, and were found.
struct Found {
  int displaced = 0, named = 0;
};
template <class Pose, class Point>
Found try_random_drives() {
  Found found;
  Registry registry;
  const auto optimizer =
      registry.make<Optimizer>(test::with_some_linear_solver("levenberg_marquardt"));
  for (unsigned seed = 0; seed < graphs(); ++seed) {
    RandomDrive<Pose, Point> drive(seed);
    EXPECT_EQ(contradicting_fixed_variables(drive.graph), "") << seed;
    EXPECT_EQ(contradicting_fixed_variables(drive.truth()), "") << seed;
    const int v = drive.displace();
    Graph right = drive.truth();
    const double chi2 = optimizer->optimize(right).final_chi2;
    if (is_plausible(chi2, degrees_of_freedom(right, resolve_gauge(right)))) continue;
    ++found.displaced;
    const std::string named = contradicting_fixed_variables(drive.graph);
    found.named += (named + ' ').find(drive.graph.describe_variable(v) + ' ') != std::string::npos;
  }
  return found;
}

TEST(FixedVariables, OfRandomDrivesAreNamedWhereOneIsElsewhereAndElseNever) {
  CAIRN_NEEDS("types", "slam2d");
  CAIRN_NEEDS("types", "slam3d");
  CAIRN_NEEDS("optimizer", "levenberg_marquardt");
  const Found plane = try_random_drives<Pose2, Point2>();
  EXPECT_GE(plane.named, plane.displaced * 99 / 100) << " of " << plane.displaced;
  const Found space = try_random_drives<Pose3, Point3>();
  EXPECT_GE(space.named, space.displaced * 99 / 100) << " of " << space.displaced;
}

}  // namespace
}  // namespace cairn
