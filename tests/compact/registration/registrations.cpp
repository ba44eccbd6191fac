// SPDX-License-Identifier: BSD-3-Clause
#include "compact/registration/registrations.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace cairn::test {
namespace {

std::vector<double> between(const Graph& graph, int a, int b) {
  const VariableType& type = graph.type(a);
  std::vector<double> back(type.ambient_size()), motion(type.ambient_size());
  type.lie_group()->inverse(graph.state(a).data(), back.data());
  type.lie_group()->compose(back.data(), graph.state(b).data(), motion.data());
  return motion;
}

}  // namespace

Extent extent(const VariableType& type, std::span<const double> motion) {
  const Placement& placement = *type.placement();
  const int dimension = placement.dimension();
  std::array<double, 9> R{};
  std::array<double, 3> t{};
  placement.split(motion.data(), R.data(), t.data());
  double chord = 0.0;
  for (int k = 0; k < dimension * dimension; ++k)
    chord += std::pow(R[k] - (k % (dimension + 1) == 0 ? 1.0 : 0.0), 2);
  return {std::hypot(t[0], t[1], t[2]), 2.0 * std::asin(std::min(1.0, std::sqrt(chord / 8.0)))};
}

std::vector<Pair> all_pairs(const Graph& graph) {
  std::vector<Pair> pairs;
  for (int a = 0; a < graph.variable_count(); ++a) {
    for (int b = a + 1; b < graph.variable_count(); ++b)
      pairs.push_back(std::minmax(graph.id(a), graph.id(b)));
  }
  return pairs;
}

std::vector<double> squared_errors(const Graph& truth, const std::vector<Factor>& factors) {
  Graph graph;
  for (int v = 0; v < truth.variable_count(); ++v) {
    const Variable variable = truth.variable(v);
    graph.add_variable(variable.type, variable.id, truth.state(v));
  }
  for (const Factor& factor : factors) {
    const std::array<int, 2> variables{*graph.find(factor.variables[0]),
                                       *graph.find(factor.variables[1])};
    graph.add_factor(factor.type, variables, factor.measurement, factor.information);
  }
  return squared_norms(graph);
}

void expect_share(std::int64_t count, std::int64_t trials, double probability) {
  const auto n = static_cast<double>(trials);
  EXPECT_NEAR(static_cast<double>(count), n * probability,
              5.0 * std::sqrt(n * probability * (1.0 - probability)))
      << "of " << trials;
}

void expect_same(const Factor& a, const Factor& b) {
  EXPECT_EQ(a.type, b.type);
  EXPECT_EQ(a.variables, b.variables);
  EXPECT_EQ(a.measurement, b.measurement);
  EXPECT_EQ(a.information, b.information);
}

bool was_false(Registration& registration, const Pair& pair) {
  auto* matches = query<FalseMatches>(registration);
  return matches && matches->was_false(pair.first, pair.second);
}

std::string message_of(const std::function<void()>& call, ErrorCode code) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    return error.what();
  }
  ADD_FAILURE() << "no error";
  return {};
}

void Registrations::simulate(const std::string& spec) {
  world = registry.make<Generator>(spec)->generate(registry, 5);
}

std::unique_ptr<Registration> Registrations::make(const std::string& spec) {
  auto registration = registry.make<Registration>(spec);
  registration->begin({.recording = &world.graph, .truth = &world.truth});
  return registration;
}

std::map<Pair, std::vector<Factor>> Registrations::match_all(Registration& registration) {
  std::map<Pair, std::vector<Factor>> answers;
  for (const Pair& pair : all_pairs(world.truth)) {
    std::vector<Factor> answer = registration.match(pair.first, pair.second);
    if (!answer.empty()) answers[pair] = std::move(answer);
  }
  return answers;
}

Extent Registrations::truly_apart(const Pair& pair) const {
  const Graph& truth = world.truth;
  const int a = *truth.find(pair.first), b = *truth.find(pair.second);
  return extent(truth.type(a), between(truth, a, b));
}

}  // namespace cairn::test
