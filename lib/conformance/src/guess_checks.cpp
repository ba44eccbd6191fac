// SPDX-License-Identifier: BSD-3-Clause
// What initial guesses do on a small pose graph: Gauss-Newton with dense algebra finds the minimum
// from them.
#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "cairn/conformance/checker.hpp"
#include "cairn/conformance/repetition.hpp"
#include "cairn/conformance/sample_graph.hpp"
#include "cairn/conformance/samples.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/solve/initial_guess.hpp"
#include "own_checks.hpp"

namespace cairn::conformance {
namespace {

constexpr int kPoses = 40;
constexpr double kMinimum = 1e-4;  // share of chi2 by which the minimum may differ

void check_guess(const Subject& subject, Checker& check) {
  Graph graph = two_laps(kPoses, check.options().seed);
  graph.set_fixed(0);
  check.sample(described(graph) + ", pose 0 fixed", [&] {
    const std::vector<double> fixed(graph.state(0).begin(), graph.state(0).end());
    const int variables = graph.variable_count(), factors = graph.factor_count();
    Graph reference = graph.clone();
    const double least = minimize_densely(reference);
    const auto guess = made<InitialGuess>(subject, check);
    check.call("compute", [&] { return guess->compute(graph); });
    check.expect(all_finite(graph), "the states are finite",
                 [] { return std::string("one is not"); });
    check.expect(std::ranges::equal(fixed, graph.state(0)), "a fixed variable stays",
                 [&] { return "it moved to " + text_of(graph.state(0)); });
    check.expect(graph.variable_count() == variables && graph.factor_count() == factors,
                 "the graph keeps its variables and factors",
                 [] { return std::string("it does not"); });
    const double found = minimize_densely(graph);
    check.expect(found <= least * (1.0 + kMinimum), "Gauss-Newton finds the minimum from it",
                 [&] { return fmt::format("chi2 {} instead of {}", found, least); });
  });
}

Repetition guess_uses(const Subject& subject, Checker& check) {
  return {"compute", 5, [&subject, &check](std::uint64_t input) {
            const std::shared_ptr<InitialGuess> guess = made<InitialGuess>(subject, check);
            return [guess, seed = check.options().seed + input] {
              Graph graph = two_laps(kPoses, seed);
              guess->compute(graph);
              return states_of(graph);
            };
          }};
}

}  // namespace

std::span<const Group> initial_guess_groups() {
  static constexpr std::array<Group, 3> groups{{{"estimate", check_guess},
                                                {"memory", memory_group<guess_uses>, true},
                                                {"threads", threads_group<guess_uses>, true}}};
  return groups;
}

}  // namespace cairn::conformance
