// SPDX-License-Identifier: BSD-3-Clause
// Variables whose information spans up to 16 orders of magnitude in one unit: what is measured
// weakly is measured, and the estimate is that of a solution in 113 bits.
#include <cmath>
#include <map>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/graph/free_directions.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/solve/optimizer.hpp"
#include "support/components.hpp"

namespace cairn::test {
namespace {

__extension__ using Quad = __float128;

/// Points of `axes` coordinates that relative positions and priors measure, each coordinate by
/// itself and each with information of a size of its own.
class PointChain {
 public:
  PointChain(Registry& registry, int axes, unsigned seed) : axes_(axes), random_(seed) {
    const bool planar = axes == 2;
    const auto point = registry.variable_type(planar ? "VERTEX_XY" : "VERTEX_TRACKXYZ");
    const auto relative = registry.factor_type(planar ? "EDGE_POINTXY" : "EDGE_POINTXYZ");
    const auto prior = registry.factor_type(planar ? "EDGE_PRIOR_XY" : "EDGE_PRIOR_TRACKXYZ");
    const int points = 2 + pick(12);
    for (int k = 0; k < points; ++k) {
      truth_.push_back(numbers(10.0));
      std::vector<double> start = numbers(1.0);
      for (int axis = 0; axis < axes; ++axis) start[axis] += truth_.back()[axis];
      graph.add_variable(point, k, start);
    }
    for (int axis = 0; axis < axes; ++axis)
      level_.push_back(std::pow(10.0, 16.0 * uniform() - 3.0));
    level_.front() = 1e-3;
    level_.back() = 1e13;
    for (int k = 1; k < points; ++k) measure(relative, {k - 1, k});
    for (int k = 0; k < points / 3; ++k) {
      const int a = pick(points - 1);
      measure(relative, {a, a + 1 + pick(points - a - 1)});
    }
    measure(prior, {pick(points)});
    measure(prior, {pick(points)});
  }

  /// By the normal equations.
  std::vector<double> solution() const {
    const int points = graph.variable_count();
    std::vector<double> x(static_cast<std::size_t>(points * axes_));
    for (int axis = 0; axis < axes_; ++axis) {
      std::vector<std::vector<Quad>> H(points, std::vector<Quad>(points + 1, 0));
      for (int f = 0; f < graph.factor_count(); ++f) {
        const Quad w = graph.information(f)[diagonal(axis)], z = graph.measurement(f)[axis];
        const auto on = graph.factor_variables(f);
        const auto add = [&](int row, int sign_row, int column, int sign) {
          H[row][column] += w * sign_row * sign;
        };
        const int last = on.back();
        add(last, 1, last, 1);
        H[last][points] += w * z;
        if (on.size() == 1) continue;
        add(on[0], 1, on[0], 1);
        add(on[0], 1, last, -1);
        add(last, 1, on[0], -1);
        H[on[0]][points] -= w * z;
      }
      for (int k = 0; k < points; ++k) {
        for (int row = 0; row < points; ++row) {
          if (row == k) continue;
          const Quad factor = H[row][k] / H[k][k];
          for (int column = k; column <= points; ++column) H[row][column] -= factor * H[k][column];
        }
      }
      for (int k = 0; k < points; ++k)
        x[static_cast<std::size_t>(k * axes_ + axis)] = static_cast<double>(H[k][points] / H[k][k]);
    }
    return x;
  }

  void expect_solved(const Graph& solved) const {
    const std::vector<double> x = solution();
    for (int v = 0; v < graph.variable_count(); ++v) {
      for (int axis = 0; axis < axes_; ++axis) {
        EXPECT_NEAR(solved.state(v)[axis], x[static_cast<std::size_t>(v * axes_ + axis)],
                    1e-9 + 1e-5 / std::sqrt(level_[axis]))
            << "axis " << axis << " of " << v << ", information " << level_[axis];
      }
    }
  }

  Graph graph;

 private:
  int pick(int count) { return static_cast<int>(random_() % static_cast<unsigned>(count)); }
  double uniform() { return std::uniform_real_distribution<double>(0.0, 1.0)(random_); }
  std::vector<double> numbers(double scale) {
    std::vector<double> x;
    for (int axis = 0; axis < axes_; ++axis) x.push_back(scale * (2.0 * uniform() - 1.0));
    return x;
  }
  std::size_t diagonal(int axis) const {
    return static_cast<std::size_t>(axis * axes_ - axis * (axis - 1) / 2);
  }
  void measure(const std::shared_ptr<const FactorType>& type, const std::vector<int>& on) {
    std::vector<double> information(static_cast<std::size_t>(axes_ * (axes_ + 1) / 2), 0.0);
    std::vector<double> z = numbers(1.0);  // noise, one by one of the size that its weight claims
    for (int axis = 0; axis < axes_; ++axis) {
      const double weight = level_[axis] * std::pow(10.0, 2.0 * uniform() - 1.0);
      information[diagonal(axis)] = weight;
      z[axis] = z[axis] / std::sqrt(weight) + truth_[on.back()][axis];
      if (on.size() == 2) z[axis] -= truth_[on.front()][axis];
    }
    graph.add_factor(type, on, z, information);
  }

  int axes_;
  std::mt19937 random_;
  std::vector<double> level_;  // of the information, by axis
  std::vector<std::vector<double>> truth_;
};

class WeakDirections : public testing::TestWithParam<int> {
 protected:
  void SetUp() override {
    if (!has_factor_type("EDGE_POINTXY") || !has_factor_type("EDGE_POINTXYZ"))
      GTEST_SKIP() << "there are no points";
  }
  bool has_factor_type(const char* tag) {
    try {
      registry_.factor_type(tag);
      return true;
    } catch (const std::exception&) {
      return false;
    }
  }
  static void expect_no_doubt(const std::vector<std::string>& notes) {
    for (const char* words : {"free", "can ", "singular", "not positive"})
      EXPECT_THAT(notes, testing::Not(testing::Contains(testing::HasSubstr(words))));
  }
  Registry registry_;
};
INSTANTIATE_TEST_SUITE_P(Dimensions, WeakDirections, testing::Values(2, 3));

constexpr unsigned kGraphs = 50;

TEST_P(WeakDirections, AreFollowedByEveryOptimizer) {
  for (const char* name : {"levenberg_marquardt", "dogleg", "gauss_newton", "ceres"}) {
    if (!registry_.has("optimizer", name)) continue;
    const auto optimizer = registry_.make<Optimizer>(with_some_linear_solver(name));
    for (unsigned seed = 0; seed < kGraphs; ++seed) {
      SCOPED_TRACE(testing::Message() << name << ", seed " << seed);
      const PointChain chain(registry_, GetParam(), seed);
      EXPECT_TRUE(find_free_directions(chain.graph).empty());
      Graph graph = chain.graph.clone();
      const Summary summary =
          optimizer->optimize(graph, {.max_iterations = 100, .tolerance = 1e-12});
      EXPECT_EQ(summary.status, Status::converged) << testing::PrintToString(summary.notes);
      expect_no_doubt(summary.notes);
      chain.expect_solved(graph);
    }
  }
}

TEST_P(WeakDirections, AreFollowedByEveryEstimator) {
  for (const char* name :
       {"batch", "periodic_batch", "incremental_cholesky", "incremental_qr", "ekf", "eif"}) {
    if (!registry_.has("estimator", name)) continue;
    for (unsigned seed = 0; seed < kGraphs / 5; ++seed) {
      SCOPED_TRACE(testing::Message() << name << ", seed " << seed);
      const PointChain chain(registry_, GetParam(), seed);
      const auto estimator = registry_.make<Estimator>(name);
      GraphUpdate update;
      for (int v = 0; v < chain.graph.variable_count(); ++v)
        update.variables.push_back(chain.graph.variable(v));
      for (int f = 0; f < chain.graph.factor_count(); ++f)
        update.factors.push_back(chain.graph.factor(f));
      const UpdateReport report = estimator->update(update);
      EXPECT_TRUE(report.ok) << testing::PrintToString(report.notes);
      expect_no_doubt(report.notes);
      chain.expect_solved(estimator->graph());
    }
  }
}

}  // namespace
}  // namespace cairn::test
