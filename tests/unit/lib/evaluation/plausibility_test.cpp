// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/plausibility.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <new>
#include <span>
#include <stdexcept>
#include <string>
#include <tuple>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/lie/point.hpp"
#include "cairn/lie/se2.hpp"
#include "cairn/lie/so2.hpp"
#include "cairn/types/define_factor.hpp"
#include "cairn/types/define_variable.hpp"
#include "cairn/types/loss.hpp"
#include "support/sample_graphs.hpp"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// A prior on a pose whose Jacobian lacks a term: the row of y does not depend on the heading.
struct MissingTerm {
  static constexpr std::string_view kTag = "MISSING_TERM";
  static constexpr int kResidual = 3, kMeasurement = 3;
  using Variables = std::tuple<Se2>;
  template <class S>
  static Vector<S, 3> residual(const Vector<S, 3>& x, const Vector<double, 3>& z) {
    return {x[0] - z[0], x[1] - z[1] + 2.0 * x[2], x[2] - z[2]};
  }
  static Vector<double, 3> evaluate(const Vector<double, 3>& x, const Vector<double, 3>& z,
                                    Eigen::Matrix3d& J) {
    // Steps are in the frame of the pose.
    const double c = std::cos(x[2]), s = std::sin(x[2]);
    J << c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0;
    return residual<double>(x, z);
  }
};

/// A prior that is not defined for x at or beyond 1.
struct Partial {
  static constexpr std::string_view kTag = "PARTIAL";
  static constexpr int kResidual = 1, kMeasurement = 1;
  using Variables = std::tuple<Se2>;
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 3>& x, const Vector<double, 1>& z) {
    if (x[0] >= S(1.0)) throw std::domain_error("beyond");
    using std::log;
    return Vector<S, 1>(log(x[0]) - z[0]);
  }
};

/// Far from what it measures, and without memory where the pose has turned.
struct Exhausted {
  static constexpr std::string_view kTag = "EXHAUSTED";
  static constexpr int kResidual = 1, kMeasurement = 1;
  using Variables = std::tuple<Se2>;
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 3>& x, const Vector<double, 1>& z) {
    if (x[2] > S(0.1 + 1e-5)) throw std::bad_alloc();
    return Vector<S, 1>(x[0] - 1e4 - z[0]);
  }
};

/// The direction in which a landmark is seen, wrapped or not.
template <bool wrapped>
struct Direction {
  static constexpr std::string_view kTag = wrapped ? "DIRECTION" : "UNWRAPPED";
  static constexpr int kResidual = 1, kMeasurement = 1;
  using Variables = std::tuple<Se2, PointXY>;
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 3>& x, const Vector<S, 2>& l,
                               const Vector<double, 1>& z) {
    using std::atan2;
    const S error = atan2(l[1] - x[1], l[0] - x[0]) - x[2] - z[0];
    return Vector<S, 1>(wrapped ? wrap_angle<S>(error) : error);
  }
};

/// A prior on x alone, in metres, which grows as an angle would.
struct East {
  static constexpr std::string_view kTag = "EAST";
  static constexpr int kResidual = 1, kMeasurement = 1;
  using Variables = std::tuple<Se2>;
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 3>& x, const Vector<double, 1>& z) {
    return Vector<S, 1>(x[0] - z[0]);
  }
};

template <class F>
void add_one_pose(Graph& graph, Id id, double x) {
  static const auto pose_type = define_variable<Se2>();
  const double state[] = {x, -0.2, 0.1}, z[] = {0.25, 2.0, 0.5}, unit[] = {1, 0, 0, 1, 0, 1};
  const int pose[] = {graph.add_variable(pose_type, id, state)};
  static const auto type = define_factor<F>();
  graph.add_factor(type, pose, {z, F::kMeasurement}, {unit, F::kResidual == 3 ? 6U : 1U});
}

TEST(WrongJacobians, AreNamedWithTheEntry) {
  Graph graph;
  add_one_pose<MissingTerm>(graph, 7, 0.3);
  EXPECT_THAT(
      wrong_jacobians(graph),
      ElementsAre(HasSubstr("MISSING_TERM 7: the Jacobian by its variable 1 has 0 in row 1, "
                            "column 2, where differences of the residual give 2")));
}

TEST(WrongJacobians, AreNotFoundWhereThereAreNone) {
  EXPECT_THAT(wrong_jacobians(test::ring_of_poses(30, 0.05)), IsEmpty());
  EXPECT_THAT(wrong_jacobians(Graph()), IsEmpty());
}

TEST(WrongJacobians, LeaveOutFactorsThatThrowBesideTheStates) {
  Graph graph;
  add_one_pose<Partial>(graph, 1, 1.0 - 1e-5);
  EXPECT_THAT(wrong_jacobians(graph), IsEmpty());
}

// What makes others leave a factor out must not hide that there is no memory.
TEST(ReasonsForDoubt, DoNotHideThatThereIsNoMemory) {
  Graph graph;
  for (const Id id : {1, 2, 3, 4}) add_one_pose<Exhausted>(graph, id, 0.3);
  EXPECT_THROW(wrong_jacobians(graph), std::bad_alloc);
  for (int more = 0; more < 9; ++more) {
    const double z[] = {0.25}, unit[] = {1.0};
    const int pose[] = {0};
    graph.add_factor(graph.factor(0).type, pose, z, unit);
  }
  for (int v = 1; v < 4; ++v) graph.set_fixed(v, true);
  EXPECT_THROW(implausible_estimate(graph, chi2(graph)), std::bad_alloc);
}

/// Of weight 1 within one standard deviation, and none beyond.
class OneSigma final : public Loss {
 public:
  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weights) const override {
    for (std::size_t k = 0; k < s.size(); ++k) {
      if (!rho.empty()) rho[k] = std::min(s[k], 1.0);
      if (!weights.empty()) weights[k] = s[k] < 1.0 ? 1.0 : 0.0;
    }
  }
  double second_derivative(double) const override { return 0.0; }
};

/// A pose that looks west at a landmark a little south of west, measured five times, with the
/// error of its x in metres.
template <class Bearing>
std::string doubt_of_bearings(double heading, double measured, double x) {
  static const auto pose_type = define_variable<Se2>();
  static const auto point_type = define_variable<PointXY>();
  static const auto bearing = define_factor<Bearing>();
  static const auto east = define_factor<East>();
  const double state[] = {0.0, 0.0, heading}, landmark[] = {-5.0, -0.5}, z[] = {measured},
               place[] = {x}, information[] = {1e6}, little[] = {1.0};
  Graph graph;
  const int both[] = {graph.add_variable(pose_type, 0, state),
                      graph.add_variable(point_type, 1, landmark)};
  for (int k = 0; k < 5; ++k) graph.add_factor(bearing, both, z, information);
  graph.add_factor(east, std::span(both, 1), place, little);
  return implausible_estimate(graph, chi2(graph));
}

TEST(ImplausibleEstimate, NamesAnAngleThatIsNotWrapped) {
  // The landmark is seen at -3.04 rad in the world, the pose heads at 3: 0.24 rad to its left.
  EXPECT_THAT(doubt_of_bearings<Direction<false>>(3.0, 0.24, 0.0),
              HasSubstr("UNWRAPPED 0 1: its error in row 0 is an angle of -6.2"));
  EXPECT_THAT(doubt_of_bearings<Direction<true>>(3.0, 0.24, 0.0), IsEmpty());
  // Wrong, and no more than that: an angle within ±π, and a distance beyond.
  for (const std::string& doubt : {doubt_of_bearings<Direction<true>>(3.0, 1.24, 0.0),
                                   doubt_of_bearings<Direction<false>>(1.0, -2.0, 0.0),
                                   doubt_of_bearings<Direction<true>>(3.0, 0.24, 1000.0)})
    EXPECT_THAT(doubt, HasSubstr("hardly the right one. Either measurements are wrong"));
}

TEST(LossesWeighNothing, OnlyWhereNoFactorHasAnyWeight) {
  Graph graph = test::ring_of_poses(30, 0.05);
  EXPECT_THAT(losses_weigh_nothing(graph), IsEmpty());
  graph.set_loss(std::make_shared<OneSigma>());
  const std::vector<double> norms = squared_norms(graph);
  ASSERT_LT(std::ranges::min(norms), 1.0);
  EXPECT_THAT(losses_weigh_nothing(graph), IsEmpty());
  Graph apart;
  add_one_pose<MissingTerm>(apart, 1, 50.0);
  apart.set_loss(std::make_shared<OneSigma>());
  ASSERT_GT(squared_norms(apart).front(), 1.0);
  EXPECT_THAT(losses_weigh_nothing(apart), HasSubstr("no factor any weight"));
}

/// No weight for the factors of a graph whose position is given, as if they were wrong.
Graph ring_that_rejects(int poses, const std::function<bool(const Graph&, int)>& which) {
  Graph graph = test::ring_of_poses(poses, 0.05);
  struct Nothing final : Loss {
    void evaluate(std::span<const double> s, std::span<double> rho,
                  std::span<double> weight) const override {
      for (std::size_t k = 0; k < s.size(); ++k) {
        if (!rho.empty()) rho[k] = 0.0;
        if (!weight.empty()) weight[k] = 0.009;
      }
    }
    double second_derivative(double) const override { return 0.0; }
  };
  struct Everything final : Loss {
    void evaluate(std::span<const double> s, std::span<double> rho,
                  std::span<double> weight) const override {
      for (std::size_t k = 0; k < s.size(); ++k) {
        if (!rho.empty()) rho[k] = s[k];
        if (!weight.empty()) weight[k] = 0.011;
      }
    }
    double second_derivative(double) const override { return 0.0; }
  };
  graph.set_loss(std::make_shared<Everything>(), FactorSelector::loops());
  const auto nothing = std::make_shared<Nothing>();
  for (int f = 0; f < graph.factor_count(); ++f) {
    if (which(graph, f)) graph.set_loss(f, nothing);
  }
  return graph;
}

bool closes_loop(const Graph& graph, int f) { return loop_closures(graph)[f]; }

TEST(RejectedFactors, AreCountedWhereALossLeavesThemLessThanOnePerCent) {
  const Graph none = ring_that_rejects(30, [](const Graph&, int) { return false; });
  const auto loops = rejected_factors(none).loops;
  ASSERT_GE(loops, 5);
  EXPECT_EQ(rejected_factors(none).rejected_loops, 0);
  EXPECT_THAT(notes_on_estimate(none, 1.0).notes, IsEmpty());
  EXPECT_EQ(rejected_factors(test::ring_of_poses(30, 0.05)).loops, 0);

  int left = 2;
  const Graph two = ring_that_rejects(
      30, [&](const Graph& graph, int f) { return closes_loop(graph, f) && left-- > 0; });
  EXPECT_EQ(rejected_factors(two).rejected_loops, 2);
  EXPECT_THAT(notes_on_estimate(two, 1.0).notes,
              ElementsAre("the loss leaves 2 of " + std::to_string(loops) +
                          " loop closures less than 1 % of their weight"));
  EXPECT_THAT(reasons_for_doubt(two, 1.0), IsEmpty());

  const Graph all =
      ring_that_rejects(30, [](const Graph& graph, int f) { return closes_loop(graph, f); });
  const auto said =
      HasSubstr(std::to_string(loops) + " of " + std::to_string(loops) + " loop closures");
  EXPECT_THAT(notes_on_estimate(all, 1.0).notes, ElementsAre(said));
  EXPECT_THAT(reasons_for_doubt(all, 1.0), ElementsAre(HasSubstr("hardly the right one")));

  const Graph odometry =
      ring_that_rejects(30, [](const Graph& graph, int f) { return !closes_loop(graph, f); });
  EXPECT_THAT(notes_on_estimate(odometry, 1.0).notes,
              ElementsAre(HasSubstr("other factors less than")));
}

TEST(ResidualNotFinite, IsNamedWithItsMeasurement) {
  Graph graph;
  add_one_pose<Partial>(graph, 1, 0.5);
  EXPECT_THAT(residual_not_finite(graph), IsEmpty());
  add_one_pose<Partial>(graph, 2, 0.0);  // log(0)
  EXPECT_THAT(residual_not_finite(graph),
              HasSubstr("the residual of PARTIAL 2 is not finite; it measures 0.25"));
}

}  // namespace
}  // namespace cairn
