// SPDX-License-Identifier: BSD-3-Clause
// The shapes of our losses; `cairn plugins --check` has the laws of all.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/types/loss.hpp"
#include "cairn/types/loss_by_size.hpp"

namespace cairn::test {
namespace {

double rho(const Loss& loss, double s) {
  double value = NAN;
  loss.evaluate({&s, 1}, {&value, 1}, {});
  return value;
}
double weight(const Loss& loss, double s) {
  double value = NAN;
  loss.evaluate({&s, 1}, {}, {&value, 1});
  return value;
}

template <class Check>
void for_every_loss(Check check) {
  Registry registry;
  const auto names = registry.names("loss");
  ASSERT_FALSE(names.empty());
  for (const std::string& name : names) {
    SCOPED_TRACE(name);
    check(*registry.make<Loss>(name));
  }
}

TEST(Losses, AreOnOfferByName) {
  Registry registry;
  for (const char* name :
       {"huber", "pseudo_huber", "cauchy", "geman_mcclure", "welsch", "tukey", "dcs"}) {
    EXPECT_TRUE(registry.has("loss", name)) << name;
  }
}

TEST(EveryLoss, NeverPullsHarderThanTheSquareAndNeverPushes) {
  for_every_loss([](const Loss& loss) {
    double last_rho = 0.0, last_weight = 1.0;
    for (double s = 1e-3; s < 1e8; s *= 1.3) {
      EXPECT_LE(rho(loss, s), s * (1.0 + 1e-15));
      EXPECT_GE(rho(loss, s), last_rho * (1.0 - 1e-15));
      EXPECT_LE(weight(loss, s), last_weight);
      EXPECT_GE(weight(loss, s), 0.0);
      EXPECT_LE(loss.second_derivative(s), 0.0);
      last_rho = rho(loss, s);
      last_weight = weight(loss, s);
    }
  });
}

TEST(EveryLoss, IsContinuousAtItsCorner) {
  Registry registry;
  for (const std::string& name : registry.names("loss")) {
    SCOPED_TRACE(name);
    const auto loss = registry.make<Loss>(name + ":scale=2");
    const double below = 4.0 * (1 - 1e-12), above = 4.0 * (1 + 1e-12);
    EXPECT_NEAR(rho(*loss, below), rho(*loss, above), 1e-10);
    EXPECT_NEAR(weight(*loss, below), weight(*loss, above), 1e-10);
  }
}

TEST(EveryLoss, ScalesWithItsOption) {
  Registry registry;
  for (const std::string& name : registry.names("loss")) {
    SCOPED_TRACE(name);
    const auto one = registry.make<Loss>(name + ":scale=1"),
               three = registry.make<Loss>(name + ":scale=3");
    for (const double s : {0.1, 1.5, 40.0}) {
      EXPECT_NEAR(rho(*three, 9.0 * s), 9.0 * rho(*one, s), 1e-13 * 9.0 * s);
      EXPECT_NEAR(weight(*three, 9.0 * s), weight(*one, s), 1e-14);
    }
    EXPECT_THROW(registry.make<Loss>(name + ":scale=0"), Error);
    EXPECT_THROW(registry.make<Loss>(name + ":scale=-1"), Error);
  }
}

TEST(Losses, HaveTheValuesOfTheirFormulasAtFourTimesTheScale) {
  // scale 2, so q = 4, and s = 16
  const std::map<std::string, double> expected = {
      {"huber", 2 * 2 * 4 - 4.0},           {"pseudo_huber", 2 * 4 * (std::sqrt(5.0) - 1)},
      {"cauchy", 4 * std::log(5.0)},        {"geman_mcclure", 4 * 16 / 20.0},
      {"welsch", 4 * (1 - std::exp(-4.0))}, {"tukey", 4.0 / 3},
      {"dcs", 3 * 4 - 4 * 4 * 4 / 20.0},  // Φ + ∫ (2Φ / (Φ + u))² du from Φ to s
  };
  Registry registry;
  for (const auto& [name, value] : expected) {
    EXPECT_NEAR(rho(*registry.make<Loss>(name + ":scale=2"), 16.0), value, 1e-14) << name;
  }
  // The scaling factor of [Agarwal13], squared.
  EXPECT_NEAR(weight(*registry.make<Loss>("dcs:scale=2"), 16.0), std::pow(2 * 4 / 20.0, 2), 1e-15);
}

/// √ of the 95 % quantile of χ² with 1 to 6 degrees of freedom, from tables.
constexpr std::array<double, 6> kQuantiles = {1.95996, 2.44775, 2.79548, 3.08021, 3.32724, 3.54849};

TEST(Losses, ThatEndBeyondTheirScaleGrowItWithTheSizeOfTheResidual) {
  Registry registry;
  for (const auto& [name, scale] : std::map<std::string, double>{
           {"dcs", 1.95996}, {"geman_mcclure", 1.95996}, {"tukey", 4.6851}, {"welsch", 2.9846}}) {
    SCOPED_TRACE(name);
    const std::shared_ptr<const Loss> loss = registry.make<Loss>(name);
    for (int n = 1; n <= 6; ++n) {
      const double of_size = scale * kQuantiles[static_cast<std::size_t>(n - 1)] / kQuantiles[0];
      const auto expected =
          registry.make<Loss>(ComponentSpec{name, {{"scale", option_text(of_size)}}});
      const auto sized = for_size(loss, n);
      for (const double s : {0.5, 5.0, 15.0, 60.0}) {
        EXPECT_NEAR(rho(*sized, s), rho(*expected, s), 1e-3 * s) << n;
        EXPECT_NEAR(weight(*sized, s), weight(*expected, s), 1e-3) << n;
      }
      EXPECT_EQ(for_size(loss, n), sized);  // one object, so that graphs have one loss
      EXPECT_EQ(for_size(sized, 2), sized);
    }
    EXPECT_EQ(rho(*loss, 7.0), rho(*for_size(loss, 1), 7.0));
    const std::shared_ptr<const Loss> stated =
        registry.make<Loss>(ComponentSpec{name, {{"scale", option_text(scale)}}});
    EXPECT_EQ(for_size(stated, 6), stated);
  }
  for (const char* name : {"huber", "pseudo_huber", "cauchy"}) {
    const std::shared_ptr<const Loss> loss = registry.make<Loss>(name);
    EXPECT_EQ(for_size(loss, 6), loss) << name;
  }
  EXPECT_EQ(for_size(nullptr, 3), nullptr);
}

TEST(Losses, GetTheSizeOfWhatAFactorOfAGraphMeasures) {
  Registry registry;
  if (!registry.has("types", "slam3d")) GTEST_SKIP() << "there are no types slam3d";
  const std::shared_ptr<const Loss> loss = registry.make<Loss>("dcs");
  Graph graph;
  const auto pose = registry.variable_type("VERTEX_SE3:QUAT");
  const std::vector<double> origin = {0, 0, 0, 0, 0, 0, 1};
  for (const Id id : {0, 1}) graph.add_variable(pose, id, origin);
  std::vector<double> all(21, 0.0), positions(21, 0.0);
  for (int row = 0, at = 0; row < 6; at += 6 - row++) {
    all[static_cast<std::size_t>(at)] = 1.0;
    if (row < 3) positions[static_cast<std::size_t>(at)] = 1.0;
  }
  const auto edge = registry.factor_type("EDGE_SE3:QUAT");
  const std::array<int, 2> ends = {0, 1};
  graph.add_factor(edge, ends, origin, all, loss);
  graph.add_factor(edge, ends, origin, positions);
  EXPECT_EQ(graph.loss(0), for_size(loss, 6).get());
  graph.set_loss(1, loss);
  EXPECT_EQ(graph.loss(1), for_size(loss, 3).get());
  graph.set_loss(loss);
  EXPECT_EQ(graph.loss(0), for_size(loss, 6).get());
  EXPECT_EQ(graph.losses().size(), 3U);
  // A factor taken out of a graph keeps the loss that it had there.
  Graph other;
  for (const Id id : {0, 1}) other.add_variable(pose, id, origin);
  other.add(graph.factor(1));
  EXPECT_EQ(other.loss(0), for_size(loss, 3).get());
}

}  // namespace
}  // namespace cairn::test
