// SPDX-License-Identifier: BSD-3-Clause
#include "budget.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::edges {
namespace {

using testing::ElementsAre;
using testing::SizeIs;

std::vector<double> random_numbers(int size, std::uint64_t seed) {
  Uniform uniform(seed);
  std::vector<double> all(static_cast<std::size_t>(size));
  for (double& x : all) x = uniform();
  return all;
}

/// The nearest point of {0 ≤ w ≤ 1, Σ w = budget}: clip(a − τ) with τ by bisection.
std::vector<double> projection(const std::vector<double>& a, double budget) {
  double low = -10.0, high = 10.0;
  std::vector<double> w(a.size());
  for (int k = 0; k < 200; ++k) {
    const double tau = 0.5 * (low + high);
    std::ranges::transform(a, w.begin(), [&](double x) { return std::clamp(x - tau, 0.0, 1.0); });
    (std::accumulate(w.begin(), w.end(), 0.0) > budget ? low : high) = tau;
  }
  return w;
}

TEST(Budget, TheLargestWeightsAreThoseOfALinearFunction) {
  const std::vector<double> g = random_numbers(30, 4);
  const auto linear = [&](std::span<const double> w, std::span<double> gradient) {
    if (!gradient.empty()) std::ranges::copy(g, gradient.begin());
    return std::inner_product(w.begin(), w.end(), g.begin(), 0.0);
  };
  const auto relaxed = maximize_within_budget(linear, 30, 7, 50, 0.0, {});
  std::vector<double> sorted = g;
  std::ranges::sort(sorted, std::greater{});
  const double best = std::accumulate(sorted.begin(), sorted.begin() + 7, 0.0);
  EXPECT_NEAR(relaxed->value, best, 1e-12);
  EXPECT_NEAR(relaxed->bound, best, 1e-12);
  EXPECT_LE(relaxed->iterations, 3);
}

TEST(Budget, ASmoothMaximumIsBracketedAndApproached) {
  std::vector<double> a = random_numbers(40, 9);
  for (double& x : a) x = 3.0 * x - 1.0;
  const auto distance = [&](std::span<const double> w, std::span<double> gradient) {
    double sum = 0.0;
    for (std::size_t k = 0; k < w.size(); ++k) {
      sum -= 0.5 * (w[k] - a[k]) * (w[k] - a[k]);
      if (!gradient.empty()) gradient[k] = a[k] - w[k];
    }
    return sum;
  };
  const double best = distance(projection(a, 12.0), {});
  const auto relaxed = maximize_within_budget(distance, 40, 12, 4000, 1e-4, {});
  EXPECT_LE(relaxed->value, best + 1e-9);
  EXPECT_GE(relaxed->bound, best - 1e-9);
  EXPECT_LE(relaxed->bound - relaxed->value, 1e-4 * std::abs(relaxed->value));
  EXPECT_NEAR(std::accumulate(relaxed->weights.begin(), relaxed->weights.end(), 0.0), 12.0, 1e-9);
  for (const double w : relaxed->weights)
    EXPECT_THAT(w, testing::AllOf(testing::Ge(0.0), testing::Le(1.0)));
}

/// The least of all weights is largest where all are the same. There every coordinate has a tangent
/// of its own, and none of them is a bound that is better than 1: their mean is.
TEST(Budget, AMaximumInAKinkIsBracketedToo) {
  const auto least = [](std::span<const double> w, std::span<double> gradient) {
    const auto at = std::ranges::min_element(w);
    std::ranges::fill(gradient, 0.0);
    if (!gradient.empty()) gradient[static_cast<std::size_t>(at - w.begin())] = 1.0;
    return *at;
  };
  const auto relaxed = maximize_within_budget(least, 12, 5, 2000, 0.0, {});
  EXPECT_LE(relaxed->value, 5.0 / 12.0 + 1e-12);
  EXPECT_GE(relaxed->value, 0.95 * 5.0 / 12.0);
  EXPECT_GE(relaxed->bound, 5.0 / 12.0 - 1e-12);
  EXPECT_LE(relaxed->bound, 1.1 * 5.0 / 12.0);
}

TEST(Budget, EndsWhenItIsInterrupted) {
  int calls = 0;
  const auto parabola = [](std::span<const double> w, std::span<double> gradient) {
    std::ranges::fill(gradient, 0.0);
    gradient[0] = 0.7 - w[0];
    return -0.5 * gradient[0] * gradient[0];
  };
  EXPECT_FALSE(
      maximize_within_budget(parabola, 4, 2, 100, 0.0, [&](int, int) { return ++calls < 5; }));
  EXPECT_EQ(calls, 5);
  EXPECT_FALSE(best_rounding(
      std::vector{0.5, 0.5, 0.5, 0.5}, 2, {}, [](const std::vector<int>&) { return 0.0; },
      [](int, int) { return false; }));
}

/// For evenly spaced u each element is drawn exactly as often as its weight says.
TEST(Budget, SystematicSamplesHaveTheProbabilitiesOfTheWeights) {
  std::vector<double> w = projection(random_numbers(25, 3), 8.0);
  constexpr int kDraws = 20000;
  std::vector<int> drawn(w.size());
  for (int k = 0; k < kDraws; ++k) {
    const std::vector<int> sample = systematic_sample(w, (k + 0.5) / kDraws);
    ASSERT_THAT(sample, SizeIs(8));
    ASSERT_EQ(std::set<int>(sample.begin(), sample.end()).size(), 8U);
    for (const int element : sample) ++drawn[static_cast<std::size_t>(element)];
  }
  for (std::size_t k = 0; k < w.size(); ++k)
    EXPECT_NEAR(drawn[k], w[k] * kDraws, 2.0) << "element " << k;
  EXPECT_THAT(systematic_sample(std::vector{1.0, 0.0, 1.0, 0.0}, 0.999), ElementsAre(0, 2));
}

TEST(Budget, TheBestRoundingIsNoWorseThanTheNearest) {
  const std::vector<double> w(20, 0.25), value = random_numbers(20, 8);
  const auto of = [&](const std::vector<int>& numbers) {
    double sum = 0.0;
    for (const int k : numbers) sum += value[static_cast<std::size_t>(k)];
    return sum;
  };
  const double nearest = of(*best_rounding(w, 5, {.samples = 0}, of, {}));
  const double few = of(*best_rounding(w, 5, {.samples = 4}, of, {}));
  EXPECT_EQ(nearest, of({0, 1, 2, 3, 4}));
  EXPECT_GT(few, nearest);
  EXPECT_EQ(few, of(*best_rounding(w, 5, {.samples = 4}, of, {})));  // the seed decides
}

TEST(Budget, UniformNumbersAreUniformAndTheSameEverywhere) {
  Uniform uniform(1);
  EXPECT_EQ(uniform(), 0.5665615751722809);  // of the published splitmix64
  std::map<int, int> counts;
  for (int k = 0; k < 100000; ++k) {
    const double x = uniform();
    ASSERT_TRUE(x >= 0.0 && x < 1.0);
    ++counts[static_cast<int>(10.0 * x)];
  }
  for (const auto& [tenth, count] : counts) EXPECT_NEAR(count, 10000, 500) << tenth;
}

}  // namespace
}  // namespace cairn::edges
