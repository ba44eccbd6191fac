// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/typed/batched_factor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "cairn/evaluation/check_factor.hpp"
#include "cairn/linear/normal_equations.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/typed/build.hpp"
#include "cairn/typed/run.hpp"

namespace cairn {
namespace {

using symbols::L;
using symbols::X;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::ThrowsMessage;

/// The position of a landmark as seen from a pose, which EDGE_SE2_XY measures too.
class Seen final : public BatchedFactorType {
 public:
  Seen()
      : BatchedFactorType({"EDGE_SEEN",
                           {default_registry().variable_type("VERTEX_SE2"),
                            default_registry().variable_type("VERTEX_XY")},
                           2,
                           2}) {}

  void residuals(std::size_t count, std::span<const double* const> states,
                 const double* measurements, double* out) const override {
    calls.push_back(count);
    if (fails && fails(calls.size())) throw std::runtime_error("lost");
    for (std::size_t f = 0; f < count; ++f) {
      const double* pose = states[0] + 3 * f;
      const double dx = states[1][2 * f] - pose[0], dy = states[1][2 * f + 1] - pose[1];
      const double c = std::cos(pose[2]), s = std::sin(pose[2]);
      out[2 * f] = c * dx + s * dy - measurements[2 * f];
      out[2 * f + 1] = c * dy - s * dx - measurements[2 * f + 1];
    }
    if (is_nan && is_nan(calls.size())) out[count / 2] = std::nan("");
  }

  mutable std::vector<std::size_t> calls;
  /// Of the number of a call: whether it throws, or has a residual that is not a number.
  std::function<bool(std::size_t)> fails, is_nan;
};

/// A walk past landmarks; observations of the given type, with correlated information.
Graph walk(const std::shared_ptr<const FactorType>& type, int poses = 40) {
  Graph graph;
  for (int k = 0; k < poses; ++k) {
    graph.add(X(k), Pose2(0.9 * k, 0.3 * std::sin(k), 0.1 * std::cos(k)));
    graph.add(L(k), Point2(k + 0.5, k % 3 - 1.0));
    if (k > 0)
      graph.add(Between(X(k - 1), X(k), Pose2(1.0, 0.0, 0.0)), Information::sigmas(0.1, 0.1, 0.05));
    for (int landmark = std::max(0, k - 3); landmark <= k; ++landmark) {
      const std::array<double, 2> z{landmark + 0.5 - k + 0.05 * std::sin(3.0 * k + landmark),
                                    landmark % 3 - 1.0 + 0.05 * std::cos(2.0 * k + landmark)};
      const std::array<double, 3> information{30.0, 5.0, 20.0};
      const std::array<int, 2> variables{*graph.find(X(k)), *graph.find(L(landmark))};
      graph.add_factor(type, variables, z, information);
    }
  }
  graph.set_fixed(0);
  return graph;
}

/// Of chi2 and of the normal equations.
bool is_finite_everywhere(const Graph& graph) {
  const auto solver = default_registry().make<LinearSolver>("block_cholesky");
  NormalEquations equations(graph, *solver);
  const double chi2 = equations.linearize(graph.values());
  return std::isfinite(chi2) && equations.factorize().ok;
}

TEST(BatchedFactor, IsTheFactorOfFixedSize) {
  const auto batched = std::make_shared<Seen>();
  Graph ours = walk(batched), native = walk(default_registry().factor_type("EDGE_SE2_XY"));
  const std::vector<double> norms = squared_norms(ours), expected = squared_norms(native);
  for (std::size_t k = 0; k < norms.size(); ++k)
    EXPECT_NEAR(norms[k], expected[k], 1e-12 * (1.0 + expected[k])) << k;
  const Summary a = optimize_from_states(ours, "gauss_newton"),
                b = optimize_from_states(native, "gauss_newton");
  EXPECT_EQ(a.status, Status::converged);
  EXPECT_THAT(a.notes, IsEmpty());
  EXPECT_NEAR(a.final_chi2, b.final_chi2, 1e-9 * b.final_chi2);
  for (int k = 0; k < 40; ++k)
    EXPECT_TRUE(ours.at<Pose2>(X(k)).equals(native.at<Pose2>(X(k)), 1e-6)) << k;
}

TEST(BatchedFactor, EvaluatesAPoolInOneCallWhateverTheThreadsAndOnceForTheSameNumbers) {
  const auto batched = std::make_shared<Seen>();
  Graph graph = walk(batched, 1000);  // several ranges
  const std::size_t count = 4 * 1000 - 6;
  const double before = chi2(graph);
  EXPECT_THAT(batched->calls, ElementsAre(count));
  EXPECT_EQ(chi2(graph), before);
  EXPECT_THAT(batched->calls, ElementsAre(count));
  // One number of one state, of a factor in the last range.
  const int last = *graph.find(L(999));
  std::vector<double> state(graph.state(last).begin(), graph.state(last).end());
  state[0] += 1.0;
  graph.set_state(last, state);
  EXPECT_NE(chi2(graph), before);
  EXPECT_THAT(batched->calls, ElementsAre(count, count));
  graph.set_measurement(graph.factor_count() - 1, std::vector<double>{0.0, 0.0});
  const double changed = chi2(graph);
  Graph fresh = walk(std::make_shared<Seen>(), 1000);
  fresh.set_state(last, state);
  fresh.set_measurement(fresh.factor_count() - 1, std::vector<double>{0.0, 0.0});
  EXPECT_EQ(changed, chi2(fresh));
}

TEST(BatchedFactor, ServesSeveralGraphsInTurn) {
  const auto batched = std::make_shared<Seen>();
  const Graph one = walk(batched, 40), two = walk(batched, 20);
  const double first = chi2(one), second = chi2(two);
  EXPECT_NE(first, second);
  EXPECT_EQ(chi2(one), first);
  EXPECT_EQ(chi2(two), second);
}

// What is not finite once must not be so for good, nor in other graphs of the same states.
TEST(BatchedFactor, KeepsNothingThatIsNotFinite) {
  for (const std::size_t first : {1U, 2U}) {  // the residuals, or differences alone
    SCOPED_TRACE(first);
    const auto batched = std::make_shared<Seen>();
    bool bad = true;
    batched->is_nan = [&](std::size_t call) { return bad && call >= first; };
    const Graph graph = walk(batched, 1000), fresh = walk(batched, 1000);
    const Graph right = walk(std::make_shared<Seen>(), 1000);
    EXPECT_FALSE(is_finite_everywhere(graph));
    bad = false;
    EXPECT_EQ(chi2(graph), chi2(right));
    EXPECT_TRUE(is_finite_everywhere(graph));
    EXPECT_EQ(chi2(fresh), chi2(right));
    EXPECT_TRUE(is_finite_everywhere(fresh));
  }
}

TEST(BatchedFactor, IsEvaluatedOnceMoreAtMostWhereItIsNotFinite) {
  const auto batched = std::make_shared<Seen>();
  batched->is_nan = [](std::size_t) { return true; };
  const Graph graph = walk(batched, 1000);
  const std::size_t count = 4 * 1000 - 6;
  EXPECT_FALSE(std::isfinite(chi2(graph)));
  EXPECT_LE(std::accumulate(batched->calls.begin(), batched->calls.end(), std::size_t{0}),
            2 * count);
}

TEST(BatchedFactor, KeepsNothingOfACallThatFails) {
  for (const std::size_t bad : {1U, 2U, 5U}) {
    SCOPED_TRACE(bad);
    const auto batched = std::make_shared<Seen>();
    batched->fails = [bad](std::size_t call) { return call == bad; };
    Graph graph = walk(batched, 1000);
    const Graph right = walk(std::make_shared<Seen>(), 1000);
    EXPECT_THROW(is_finite_everywhere(graph), Error);
    EXPECT_EQ(chi2(graph), chi2(right));
    EXPECT_TRUE(is_finite_everywhere(graph));
  }
}

TEST(BatchedFactor, HasRightJacobiansByDifferences) {
  const Seen seen;
  const std::array<double, 3> pose{100.0, -20.0, 2.0};
  const std::array<double, 2> landmark{103.0, -24.0}, z{1.0, 2.0};
  const double* x[] = {pose.data(), landmark.data()};
  const VariableType* types[] = {seen.variables()[0].get(), seen.variables()[1].get()};
  const std::array<double, 3> root{2.0, 0.7, 3.0};
  EXPECT_LT(check_factor(seen, types, x, z, root).largest_deviation, 1e-7);
}

TEST(BatchedFactor, RefusesADescriptionThatMakesNoSense) {
  class Empty final : public BatchedFactorType {
   public:
    using BatchedFactorType::BatchedFactorType;
    void residuals(std::size_t, std::span<const double* const>, const double*,
                   double*) const override {}
  };
  const auto pose = default_registry().variable_type("VERTEX_SE2");
  EXPECT_THAT(([&] { Empty({"", {pose}, 1, 1}); }), ThrowsMessage<Error>(HasSubstr("tag")));
  EXPECT_THAT(([&] { Empty({"E", {}, 1, 1}); }), ThrowsMessage<Error>(HasSubstr("variables")));
  EXPECT_THAT(([&] { Empty({"E", {nullptr}, 1, 1}); }), ThrowsMessage<Error>(HasSubstr("null")));
  EXPECT_THAT(([&] { Empty({"E", {pose}, 0, 1}); }), ThrowsMessage<Error>(HasSubstr("residual")));
  EXPECT_THAT(([&] { Empty({"E", {pose}, 1, -1}); }), ThrowsMessage<Error>(HasSubstr("negative")));
}

}  // namespace
}  // namespace cairn
