// SPDX-License-Identifier: BSD-3-Clause
// Laws that every variable type on offer obeys to the last digits, also where the closed forms of
// ours break down; `cairn plugins --check` has the others.
#include <gtest/gtest.h>

#include <limits>

#include "cairn/plugin/registry.hpp"
#include "support/sampling.hpp"

namespace cairn::test {
namespace {

using State = std::vector<double>;

State local(const VariableType& type, const State& x, const State& y) {
  State delta(type.tangent_size());
  type.local(1, x.data(), y.data(), delta.data());
  return delta;
}
State identity(const VariableType& type) {
  State x(type.ambient_size());
  type.identity(x.data());
  return x;
}
double apart(const VariableType& type, const State& x, const State& y) {
  return norm(local(type, x, y));
}
State difference(State a, const State& b) {
  for (std::size_t k = 0; k < a.size(); ++k) a[k] -= b[k];
  return a;
}

/// Calls check(type, regime, sampler) ten times for each type on offer in each regime.
template <class Check>
void for_every_variable(Check check) {
  Registry registry;
  const auto tags = registry.names("variable");
  ASSERT_FALSE(tags.empty());
  for (const std::string& tag : tags) {
    const auto type = registry.variable_type(tag);
    Sampler sampler(7);
    for (const Regime& regime : regimes()) {
      SCOPED_TRACE(tag + ", " + regime.name);
      for (int k = 0; k < 10; ++k) check(*type, regime, sampler);
    }
  }
}

TEST(EveryVariable, RetractsAndComesBack) {
  for_every_variable([](const VariableType& type, const Regime& regime, Sampler& sampler) {
    const State x = sampler.state(type, {"any", -1.0});
    const State delta = sampler.tangent(type, regime);
    const State y = Sampler::retracted(type, x, delta);
    const double tolerance = 1e-13 * (10.0 + regime.distance);
    EXPECT_LT(norm(difference(local(type, x, y), delta)), tolerance);
    EXPECT_LT(apart(type, Sampler::retracted(type, x, local(type, x, y)), y), tolerance);
    EXPECT_LT(apart(type, Sampler::retracted(type, x, State(delta.size(), 0.0)), x), 1e-14);
  });
}

TEST(EveryVariable, KnowsHowAStepLooksFromWhereItLeads) {
  for_every_variable([](const VariableType& type, const Regime& regime, Sampler& sampler) {
    const int n = type.tangent_size();
    const State x = sampler.state(type, {"any", -1.0});
    const State delta = sampler.tangent(type, regime);
    State D(static_cast<std::size_t>(n * n));
    type.retract_jacobian(x.data(), delta.data(), D.data());
    const State there = Sampler::retracted(type, x, delta);
    const double h = 1e-5;
    for (int c = 0; c < n; ++c) {  // central differences of local(x ⊕ δ, x ⊕ (δ + ε))
      State forward = delta, backward = delta;
      forward[c] += h;
      backward[c] -= h;
      const State up = local(type, there, Sampler::retracted(type, x, forward)),
                  down = local(type, there, Sampler::retracted(type, x, backward));
      for (int r = 0; r < n; ++r)
        EXPECT_NEAR(D[c * n + r], (up[r] - down[r]) / (2.0 * h), 1e-7 * (1.0 + norm(delta)));
    }
  });
}

TEST(EveryGroup, KeepsDigitsOfTinySteps) {
  Registry registry;
  for (const std::string& tag : registry.names("variable")) {
    SCOPED_TRACE(tag);
    const auto type = registry.variable_type(tag);
    if (!type->lie_group()) continue;  // a number that is not small swallows a tiny step
    Sampler sampler(3);
    for (const double size : {1e-150, 1e-20, 1e-9, 1e-6, 1e-3}) {
      const State delta = sampler.vector(type->tangent_size(), size);
      const State back =
          local(*type, identity(*type), Sampler::retracted(*type, identity(*type), delta));
      EXPECT_LE(norm(difference(back, delta)), 4e-15 * norm(delta)) << size;
    }
  }
}

TEST(EveryVariable, NormalizesItsStatesOnceAndRefusesWhatIsNotFinite) {
  for_every_variable([](const VariableType& type, const Regime& regime, Sampler& sampler) {
    State x = sampler.state(type, regime);
    const State before = x;
    EXPECT_EQ(type.normalize(x.data()), "");
    EXPECT_LT(apart(type, before, x), 1e-13 * (1.0 + regime.distance));
    const State once = x;
    EXPECT_EQ(type.normalize(x.data()), "");
    EXPECT_EQ(x, once);
    for (int k = 0; k < type.ambient_size(); ++k) {
      for (const double bad :
           {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
        State broken = once;
        broken[k] = bad;
        EXPECT_NE(type.normalize(broken.data()), "");
      }
    }
  });
}

TEST(Se3Variable, RefusesAQuaternionThatIsZeroAndMakesOthersUnit) {
  Registry registry;
  const auto type = registry.variable_type("VERTEX_SE3:QUAT");
  State zero = {1, 2, 3, 0, 0, 0, 0};
  EXPECT_NE(type->normalize(zero.data()), "");
  State doubled = {1, 2, 3, 0, 0, 0, -2};
  EXPECT_EQ(type->normalize(doubled.data()), "");
  EXPECT_EQ(doubled, (State{1, 2, 3, 0, 0, 0, 1}));
}

TEST(Se3Variable, StaysAUnitQuaternionOverManySteps) {
  Registry registry;
  const auto type = registry.variable_type("VERTEX_SE3:QUAT");
  Sampler sampler(1);
  State x = identity(*type);
  for (int step = 0; step < 20000; ++step) {
    x = Sampler::retracted(*type, x, sampler.tangent(*type, {"any", -1.0}));
  }
  EXPECT_NEAR(norm({x[3], x[4], x[5], x[6]}), 1.0, 4e-16);
}

TEST(Se2Variable, WrapsAnglesOfManyTurns) {
  Registry registry;
  const auto type = registry.variable_type("VERTEX_SE2");
  State x = {0, 0, 7.0};
  EXPECT_EQ(type->normalize(x.data()), "");
  EXPECT_NEAR(x[2], 7.0 - 2.0 * std::numbers::pi, 1e-15);
}

}  // namespace
}  // namespace cairn::test
