// SPDX-License-Identifier: BSD-3-Clause
#include "gauge_watch.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>

#include "cairn/graph/gauge.hpp"
#include "cairn/lie/point.hpp"
#include "cairn/lie/se2.hpp"
#include "cairn/types/define_factor.hpp"
#include "support/planar_graph.hpp"
#include "support/scaled_pose.hpp"

namespace cairn::incremental {
namespace {

using Camera = test::ScaledPose;

struct CameraAtPose {
  static constexpr std::string_view kTag = "EDGE_CAMERA_SE2";
  static constexpr int kResidual = 3, kMeasurement = 3;
  using Variables = std::tuple<Camera, Se2>;
  template <class S>
  static Vector<S, 3> residual(const Vector<S, 4>& camera, const Vector<S, 3>& pose,
                               const Vector<double, 3>& z) {
    return camera.template head<3>() - pose - z.template cast<S>();
  }
};

struct CameraSeesPoint {
  static constexpr std::string_view kTag = "EDGE_CAMERA_XY";
  static constexpr int kResidual = 2, kMeasurement = 2;
  using Variables = std::tuple<Camera, PointXY>;
  template <class S>
  static Vector<S, 2> residual(const Vector<S, 4>& camera, const Vector<S, 2>& point,
                               const Vector<double, 2>& z) {
    return camera.template head<2>() - point - z.template cast<S>();
  }
};

/// A graph and the watch on it; `held` is what the watch has said.
class Watched {
 public:
  explicit Watched(unsigned seed) : rng_(seed) {}

  void grow() {
    const double what = std::uniform_real_distribution<double>(0.0, 1.0)(rng_);
    const bool fixed = rng_() % 25 == 0;
    if (graph.variable_count() == 0 || what < 0.2) {
      add_variable(types_.pose, fixed);
    } else if (what < 0.3) {
      add_variable(types_.point, fixed);
    } else if (what < 0.36) {
      add_variable(camera_, fixed);
    } else if (what < 0.55) {
      add_factor(types_.relative_pose, {any(types_.pose), any(types_.pose)});
    } else if (what < 0.7) {
      add_factor(types_.point_seen, {any(types_.pose), any(types_.point)});
    } else if (what < 0.78) {
      add_factor(camera_at_pose_, {any(camera_), any(types_.pose)});
    } else if (what < 0.86) {
      add_factor(camera_sees_point_, {any(camera_), any(types_.point)});
    } else if (what < 0.9) {
      add_factor(types_.prior, {any(types_.pose)});
    } else if (what < 0.95) {
      add_factor(types_.point_prior, {any(types_.point)});
    } else if (rng_() % 3 == 0) {
      const int v = static_cast<int>(rng_() % static_cast<unsigned>(graph.variable_count()));
      graph.set_fixed(v);
      watch.set_fixed(v);
    }
  }
  void settle() {
    watch.settle([&](std::int32_t v, bool hold) { held[static_cast<std::size_t>(v)] = hold; });
  }

  void add_variable(const std::shared_ptr<const VariableType>& type, bool fixed) {
    const std::vector<double> x(static_cast<std::size_t>(type->ambient_size()), 0.0);
    const int v = graph.add_variable(type, graph.variable_count(), x);
    if (fixed) graph.set_fixed(v);
    watch.add_variable(type->tangent_size(), type->lie_group() != nullptr, fixed);
    held.push_back(true);
  }
  void add_factor(const std::shared_ptr<const FactorType>& type,
                  const std::vector<int>& variables) {
    if (std::ranges::count(variables, -1) > 0) return;
    if (variables.size() == 2 && variables[0] == variables[1]) return;
    const int n = type->residual_size();
    std::vector<double> information;
    for (int row = 0; row < n; ++row) {
      for (int column = row; column < n; ++column) information.push_back(row == column);
    }
    graph.add_factor(type, variables,
                     std::vector<double>(static_cast<std::size_t>(type->measurement_size()), 0.0),
                     information);
    const std::vector<std::int32_t> numbers(variables.begin(), variables.end());
    watch.add_factor(numbers.data(), static_cast<int>(numbers.size()), type->absolute_size());
  }

  Graph graph;
  GaugeWatch watch;
  std::vector<bool> held;
  test::PlanarTypes types_;

 private:
  int any(const std::shared_ptr<const VariableType>& type) {
    std::vector<int> of_type;
    for (int v = 0; v < graph.variable_count(); ++v) {
      if (&graph.type(v) == type.get()) of_type.push_back(v);
    }
    return of_type.empty() ? -1 : of_type[rng_() % of_type.size()];
  }

  std::mt19937 rng_;
  std::shared_ptr<const VariableType> camera_ = define_variable<Camera>();
  std::shared_ptr<const FactorType> camera_at_pose_ = define_factor<CameraAtPose>();
  std::shared_ptr<const FactorType> camera_sees_point_ = define_factor<CameraSeesPoint>();
};

TEST(GaugeWatch, HoldsWhatResolveGaugeHolds) {
  int anchored = 0, left_free = 0;
  for (unsigned seed = 1; seed <= 60; ++seed) {
    Watched watched(seed);
    for (int change = 0; change < 120; ++change) {
      watched.grow();
      if (seed % 3 == 0 && change % 4 != 0) continue;  // several changes at once as well
      watched.settle();
      const Gauge gauge = resolve_gauge(watched.graph);
      ASSERT_EQ(watched.held, gauge.held) << "seed " << seed << ", change " << change;
      std::vector<int> anchors, free_components;
      for (int v = 0; v < watched.graph.variable_count(); ++v) {
        if (watched.watch.anchored(v)) anchors.push_back(v);
      }
      std::vector<int> expected = gauge.anchored;
      std::ranges::sort(expected);
      ASSERT_EQ(anchors, expected) << "seed " << seed << ", change " << change;
      for (int v = 0; v < watched.graph.variable_count(); ++v) {
        const bool is_free = std::ranges::any_of(gauge.left_free, [&](int other) {
          return gauge.component[static_cast<std::size_t>(other)] ==
                 gauge.component[static_cast<std::size_t>(v)];
        });
        ASSERT_EQ(watched.watch.left_free(v), is_free) << "seed " << seed << ", change " << change;
      }
      anchored += !gauge.anchored.empty();
      left_free += !gauge.left_free.empty();
    }
  }
  EXPECT_GT(anchored, 1000);
  EXPECT_GT(left_free, 1000);
}

TEST(GaugeWatch, HoldsWhatHasNoFactor) {
  Watched watched(1);
  watched.add_variable(watched.types_.pose, false);
  watched.held[0] = false;
  watched.settle();
  EXPECT_TRUE(watched.held[0]);
  EXPECT_FALSE(watched.watch.anchored(0));
}

TEST(GaugeWatch, TellsOnlyOfWhatMayHaveChanged) {
  Watched watched(1);
  for (int k = 0; k < 100; ++k) {
    watched.add_variable(watched.types_.pose, false);
    if (k > 0) watched.add_factor(watched.types_.relative_pose, {k - 1, k});
    watched.settle();
  }
  watched.add_factor(watched.types_.relative_pose, {20, 80});
  int told = 0;
  watched.watch.settle([&](std::int32_t, bool) { ++told; });
  EXPECT_LE(told, 2);
}

TEST(GaugeWatch, LetsGoOfTheAnchorOfAComponentThatIsJoinedToAnother) {
  Watched watched(1);
  for (int k = 0; k < 4; ++k) watched.add_variable(watched.types_.pose, false);
  watched.add_factor(watched.types_.relative_pose, {2, 3});
  watched.add_factor(watched.types_.relative_pose, {0, 1});
  watched.settle();
  EXPECT_EQ(watched.held, (std::vector<bool>{true, false, true, false}));
  watched.add_factor(watched.types_.relative_pose, {3, 1});
  watched.settle();
  EXPECT_EQ(watched.held, (std::vector<bool>{true, false, false, false}));
  watched.add_factor(watched.types_.prior, {3});
  watched.settle();
  EXPECT_EQ(watched.held, (std::vector<bool>{false, false, false, false}));
}

}  // namespace
}  // namespace cairn::incremental
