// SPDX-License-Identifier: BSD-3-Clause
// Laws that every variable type on offer obeys.
#include <gtest/gtest.h>

#include <Eigen/Core>
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
State compose(const VariableType& type, const State& a, const State& b) {
  State ab(a.size());
  type.lie_group()->compose(a.data(), b.data(), ab.data());
  return ab;
}
State inverse(const VariableType& type, const State& a) {
  State out(a.size());
  type.lie_group()->inverse(a.data(), out.data());
  return out;
}
State exponential(const VariableType& type, const State& delta) {
  State out(type.ambient_size());
  type.lie_group()->exp(delta.data(), out.data());
  return out;
}
State logarithm(const VariableType& type, const State& a) {
  State out(type.tangent_size());
  type.lie_group()->log(a.data(), out.data());
  return out;
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

TEST(EveryVariable, MovesManyAtOnceAndHoldsThoseWithoutOffset) {
  Registry registry;
  for (const std::string& tag : registry.names("variable")) {
    SCOPED_TRACE(tag);
    const auto type = registry.variable_type(tag);
    const int ambient = type->ambient_size(), tangent = type->tangent_size();
    Sampler sampler(5);
    State x;
    for (int s = 0; s < 3; ++s) {
      const State one = sampler.state(*type, {"any", -1.0});
      x.insert(x.end(), one.begin(), one.end());
    }
    const State delta = sampler.vector(2 * tangent, 0.3);
    const std::int64_t offsets[] = {tangent, -1, 0};
    State moved = x;
    type->retract(3, moved.data(), offsets, delta.data(), moved.data());  // in place
    State deltas(3 * tangent);
    type->local(3, x.data(), moved.data(), deltas.data());
    for (int k = 0; k < tangent; ++k) {
      EXPECT_NEAR(deltas[k], delta[tangent + k], 1e-13);
      EXPECT_NEAR(deltas[2 * tangent + k], delta[k], 1e-13);
    }
    for (int k = ambient; k < 2 * ambient; ++k) EXPECT_EQ(moved[k], x[k]);
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

TEST(EveryVariable, SitsWhereItsPlacementSays) {
  for_every_variable([](const VariableType& type, const Regime& regime, Sampler& sampler) {
    const Placement* placement = type.placement();
    if (!placement) return;
    const State x = sampler.state(type, regime);
    State R(placement->dimension() * placement->dimension()), t(placement->dimension());
    placement->split(x.data(), R.data(), t.data());
    State y(x.size());
    placement->join(R.data(), t.data(), y.data());
    // Of what is more than its place, the rest is that of the identity.
    State R_again(R), t_again(t);
    placement->split(y.data(), R_again.data(), t_again.data());
    EXPECT_LT(norm(difference(R_again, R)), 1e-13);
    EXPECT_LT(norm(difference(t_again, t)), 1e-13 * (1.0 + regime.distance));
    if (!type.lie_group()) return;
    EXPECT_LT(apart(type, x, y), 1e-13 * (1.0 + regime.distance));
  });
}

TEST(EveryGroup, ObeysTheLawsOfAGroup) {
  for_every_variable([](const VariableType& type, const Regime& regime, Sampler& sampler) {
    if (!type.lie_group()) return;
    const State a = sampler.state(type, regime), b = sampler.state(type, {"any", -1.0}),
                c = sampler.state(type, regime);
    const double tolerance = 1e-13 * (10.0 + 4.0 * regime.distance);
    EXPECT_LT(
        apart(type, compose(type, compose(type, a, b), c), compose(type, a, compose(type, b, c))),
        tolerance);
    EXPECT_LT(apart(type, compose(type, a, inverse(type, a)), identity(type)), tolerance);
    EXPECT_LT(apart(type, compose(type, inverse(type, a), a), identity(type)), tolerance);
    EXPECT_LT(apart(type, compose(type, a, identity(type)), a), tolerance);
    EXPECT_LT(apart(type, compose(type, identity(type), a), a), tolerance);
  });
}

TEST(EveryGroup, HasLogarithmAndExponentialInverseToEachOther) {
  for_every_variable([](const VariableType& type, const Regime& regime, Sampler& sampler) {
    if (!type.lie_group()) return;
    const double tolerance = 1e-13 * (10.0 + regime.distance);
    const State delta = sampler.tangent(type, regime);
    EXPECT_LT(norm(difference(logarithm(type, exponential(type, delta)), delta)), tolerance);
    const State a = sampler.state(type, regime);
    EXPECT_LT(apart(type, exponential(type, logarithm(type, a)), a), tolerance);
  });
}

TEST(EveryGroup, RetractsBySteppingAlongTheExponential) {
  for_every_variable([](const VariableType& type, const Regime& regime, Sampler& sampler) {
    if (!type.lie_group()) return;
    const State x = sampler.state(type, {"any", -1.0}), delta = sampler.tangent(type, regime);
    EXPECT_LT(
        apart(type, Sampler::retracted(type, x, delta), compose(type, x, exponential(type, delta))),
        1e-13 * (10.0 + regime.distance));
  });
}

TEST(EveryGroup, CarriesTangentVectorsWithItsAdjoint) {
  for_every_variable([](const VariableType& type, const Regime& regime, Sampler& sampler) {
    if (!type.lie_group()) return;
    const int size = type.tangent_size();
    const State a = sampler.state(type, regime), delta = sampler.vector(size, 0.1);
    Eigen::MatrixXd Ad(size, size);
    type.lie_group()->adjoint(a.data(), Ad.data());
    State carried(size);
    Eigen::Map<Eigen::VectorXd>(carried.data(), size) =
        Ad * Eigen::Map<const Eigen::VectorXd>(delta.data(), size);
    const State left = compose(type, compose(type, a, exponential(type, delta)), inverse(type, a));
    EXPECT_LT(apart(type, left, exponential(type, carried)),
              1e-13 * (10.0 + 4.0 * regime.distance));
  });
}

TEST(EveryGroup, TakesTheAdjointBetweenTwoElements) {
  for_every_variable([](const VariableType& type, const Regime& regime, Sampler& sampler) {
    if (!type.lie_group()) return;
    const int size = type.tangent_size();
    const State a = sampler.state(type, regime);
    const State step = exponential(type, sampler.vector(size, 0.1)), b = compose(type, a, step);
    Eigen::MatrixXd between(size, size), of_step(size, size);
    type.lie_group()->adjoint_between(a.data(), b.data(), between.data());
    type.lie_group()->adjoint(step.data(), of_step.data());
    EXPECT_LT((between - of_step).cwiseAbs().maxCoeff(), 1e-15 * (10.0 + 2.0 * regime.distance));
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
