// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <numbers>
#include <ostream>
#include <random>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/geometry/motion.hpp"
#include "compact/registration/registrations.hpp"

namespace cairn::test {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

struct Example {
  std::string name, world, range;  // `range` has some thousand pairs within
};
void PrintTo(const Example& example, std::ostream* out) { *out << example.name; }

class Simulated : public Registrations, public testing::WithParamInterface<Example> {
 protected:
  void SetUp() override { simulate(GetParam().world); }
  std::unique_ptr<Registration> make_simulated(const std::string& options) {
    return make("simulated:" + GetParam().range + "," + options);
  }
  const VariableType& type() const { return world.truth.type(0); }
  double range() const { return real("range"); }
  double angle() const { return real("angle"); }
  /// Many poses of the plane are just as far apart as the range: those are out of it.
  bool within(const Pair& pair) const {
    const Extent apart = truly_apart(pair);
    return apart.length < range() - 1e-6 && apart.angle < angle();
  }

 private:
  double real(const std::string& name) const {
    return std::stod(parse_component("simulated:" + GetParam().range).values.at(name));
  }
};
INSTANTIATE_TEST_SUITE_P(Worlds, Simulated,
                         testing::Values(Example{"plane", "manhattan:poses=400", "range=5,angle=2"},
                                         Example{"space",
                                                 "sphere:turns=12,poses_per_turn=30,radius=10",
                                                 "range=5,angle=0.6"}),
                         [](const auto& example) { return example.param.name; });

TEST_P(Simulated, MatchesWhatIsWithinRangeAndNothingElse) {
  const auto answers = match_all(*make_simulated("seed=1"));
  int in = 0, turned_too_far = 0;
  for (const Pair& pair : all_pairs(world.truth)) {
    in += within(pair);
    turned_too_far += !within(pair) && truly_apart(pair).length < range();
    EXPECT_EQ(answers.contains(pair), within(pair)) << pair.first << " " << pair.second;
  }
  EXPECT_GT(in, 2000);
  EXPECT_GT(turned_too_far, 100);
}

TEST_P(Simulated, MeasuresWithTheTypeOfTheOdometryFromEarlierToLater) {
  const auto simulated = make_simulated("seed=1");
  for (const auto& [pair, answer] : match_all(*simulated)) {
    ASSERT_THAT(answer, SizeIs(1));
    EXPECT_EQ(answer.front().type, world.graph.factor_pools()[0].type);
    EXPECT_THAT(answer.front().variables, ElementsAre(pair.first, pair.second));
    EXPECT_FALSE(was_false(*simulated, pair));
  }
  EXPECT_THAT(simulated->match(7, 7), IsEmpty());
}

TEST_P(Simulated, ErrsAsItsInformationSays) {
  for (const std::string noise : {"seed=3", "sigma_translation=0.05,sigma_rotation=0.01"}) {
    std::vector<Factor> measured;
    for (const auto& [pair, answer] : match_all(*make_simulated(noise)))
      measured.push_back(answer.front());
    const std::vector<double> errors = squared_errors(world.truth, measured);
    const double n = type().tangent_size(), count = static_cast<double>(errors.size());
    double mean = 0.0, square = 0.0;  // of χ² with n degrees of freedom: n and n² + 2n
    for (const double e : errors) mean += e / count, square += e * e / count;
    EXPECT_NEAR(mean, n, 5.0 * std::sqrt(2.0 * n / count)) << noise;
    EXPECT_NEAR(square, n * n + 2.0 * n, 0.15 * n * n) << noise;
  }
}

TEST_P(Simulated, FailsErrsAndSeesTooMuchAsOftenAsItIsTold) {
  const auto simulated = make_simulated("failure_rate=0.25,false_rate=0.1,far_rate=0.02,seed=11");
  const auto answers = match_all(*simulated);
  std::int64_t in = 0, matched = 0, wrong = 0, out = 0, far = 0;
  for (const Pair& pair : all_pairs(world.truth)) {
    const bool answered = answers.contains(pair), made_up = was_false(*simulated, pair);
    if (within(pair)) {
      ++in, matched += answered, wrong += made_up;
      EXPECT_TRUE(answered || !made_up);
    } else {
      ++out, far += answered;
      EXPECT_EQ(answered, made_up);
    }
  }
  expect_share(in - matched, in, 0.25);
  expect_share(wrong, matched, 0.1);
  expect_share(far, out, 0.02);
}

TEST_P(Simulated, WeighsWhatIsFalseLikeWhatIsRight) {
  const auto simulated = make_simulated("false_rate=0.5");
  const auto answers = match_all(*simulated);
  MotionGroup group(registry.variable_type(type().tag()));
  std::vector<Factor> right, wrong;
  for (const auto& [pair, answer] : answers)
    (was_false(*simulated, pair) ? wrong : right).push_back(answer.front());
  const auto covariance = [&](const Factor& factor) {
    return group.of_factor(factor, factor.variables[0]).covariance;
  };
  const std::vector<double> expected = covariance(right.front());
  for (const Factor& factor : wrong) {
    EXPECT_THAT(covariance(factor), testing::Pointwise(testing::DoubleNear(1e-12), expected));
  }
  EXPECT_GT(std::ranges::min(squared_errors(world.truth, wrong)), 0.0);
  const auto n = static_cast<double>(type().tangent_size());
  const auto far_off = std::ranges::count_if(squared_errors(world.truth, wrong),
                                             [&](double e) { return e > 20.0 * n; });
  EXPECT_GT(static_cast<double>(far_off), 0.9 * static_cast<double>(wrong.size()));
}

// Half the radius holds 2^-d of a disc or ball. Of all rotations, those by at most π/2 are half in
// the plane, and (π/2 − sin π/2) / (π − sin π) in space.
TEST_P(Simulated, DrawsFalseMotionsUniformlyWithinRange) {
  const auto simulated = make("simulated:range=5,false_rate=1,far_rate=0.1");
  std::int64_t count = 0, near = 0, straight = 0, forward = 0;
  for (const auto& [pair, answer] : match_all(*simulated)) {
    const Extent drawn = extent(type(), answer.front().measurement);
    EXPECT_LE(drawn.length, 5.0 * (1.0 + 1e-12));
    ++count;
    near += drawn.length < 2.5;
    straight += drawn.angle < 0.5 * std::numbers::pi;
    forward += answer.front().measurement[0] > 0.0;
  }
  EXPECT_GT(count, 5000);
  const int dimension = type().placement()->dimension();
  expect_share(near, count, std::pow(0.5, dimension));
  expect_share(straight, count, dimension == 2 ? 0.5 : 0.5 - 1.0 / std::numbers::pi);
  expect_share(forward, count, 0.5);
}

TEST_P(Simulated, DrawsFalseMotionsThatTurnNoFurtherThanItCanSee) {
  for (const auto& [pair, answer] : match_all(*make_simulated("false_rate=1,far_rate=0.1"))) {
    const Extent drawn = extent(type(), answer.front().measurement);
    EXPECT_LE(drawn.length, range() * (1.0 + 1e-12));
    EXPECT_LE(drawn.angle, angle() * (1.0 + 1e-12));
  }
}

TEST_P(Simulated, DecidesForEachPairByItselfWhateverTheOrder) {
  const std::string options = "failure_rate=0.3,false_rate=0.3,far_rate=0.05,seed=4";
  const auto answers = match_all(*make_simulated(options));
  std::vector<Pair> pairs = all_pairs(world.truth);
  std::ranges::shuffle(pairs, std::mt19937(1));
  pairs.resize(20'000);
  const auto simulated = make_simulated(options);
  for (const Pair& pair : pairs) {
    const auto wanted = answers.find(pair);
    const auto answer = simulated->match(pair.second, pair.first);
    ASSERT_EQ(answer.empty(), wanted == answers.end());
    if (!answer.empty()) expect_same(answer.front(), wanted->second.front());
  }
}

TEST_P(Simulated, GivesOtherNoiseForAnotherSeedAndForAnotherPair) {
  const auto first = match_all(*make_simulated("seed=1")),
             second = match_all(*make_simulated("seed=2"));
  std::set<std::vector<double>> measurements;
  for (const auto& [pair, answer] : first) {
    measurements.insert(answer.front().measurement);
    measurements.insert(second.at(pair).front().measurement);
  }
  EXPECT_EQ(measurements.size(), 2 * first.size());
}

TEST_P(Simulated, LeavesTheOtherMatchesAloneWhereMoreFail) {
  const auto all = match_all(*make_simulated("seed=6")),
             half = match_all(*make_simulated("failure_rate=0.5,seed=6"));
  EXPECT_LT(half.size(), all.size());
  for (const auto& [pair, answer] : half) expect_same(answer.front(), all.at(pair).front());
}

TEST_P(Simulated, TakesItsCovarianceFromTheLoopsOfTheRecordingOrFromTheOptions) {
  const MotionGroup group(registry.variable_type(type().tag()));
  const int n = group.tangent_size(), d = type().placement()->dimension();
  const auto covariance = [&](const std::string& options) {
    const Factor measured = make_simulated(options)->match(0, 1).front();
    return group.of_factor(measured, 0).covariance;
  };
  const auto diagonal = [&](double translation, double rotation) {
    std::vector<double> Sigma(static_cast<std::size_t>(n) * n);
    for (int k = 0; k < n; ++k) Sigma[k * n + k] = std::pow(k < d ? translation : rotation, 2);
    return testing::Pointwise(testing::DoubleNear(1e-12), Sigma);
  };
  // What the generator says of all its measurements.
  const OptionTable& table = registry.options("generator", parse_component(GetParam().world).name);
  const double t = std::stod(table.find("translation_sigma")->default_value),
               r = std::stod(table.find("rotation_sigma")->default_value);
  EXPECT_THAT(covariance("seed=1"), diagonal(t, r));
  EXPECT_THAT(covariance("sigma_translation=0.7"), diagonal(0.7, r));
  EXPECT_THAT(covariance("sigma_rotation=0.3"), diagonal(t, 0.3));
  EXPECT_THAT(covariance("sigma_translation=0.7,sigma_rotation=0.3"), diagonal(0.7, 0.3));
}

class EveryMetric : public Registrations, public testing::WithParamInterface<const char*> {};
INSTANTIATE_TEST_SUITE_P(Slam3d, EveryMetric,
                         testing::Values("logarithm", "g2o", "rotation_vector"),
                         [](const auto& metric) { return std::string(metric.param); });

TEST_P(EveryMetric, ErrsAsItsInformationSays) {
  registry.set_type_options({"slam3d", {{"metric", GetParam()}}});
  simulate("sphere:turns=12,poses_per_turn=30,radius=10");
  const MotionGroup group(registry.variable_type("VERTEX_SE3:QUAT"));
  const auto simulated = make("simulated:range=5,sigma_translation=0.05,sigma_rotation=0.01");
  std::vector<Factor> measured;
  for (const auto& [pair, answer] : match_all(*simulated)) measured.push_back(answer.front());
  EXPECT_EQ(measured.front().type->metric(), GetParam());

  const std::vector<double> covariance =
      group.of_factor(measured.front(), measured.front().variables[0]).covariance;
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column) {
      const double sigma = row != column ? 0.0 : row < 3 ? 0.05 : 0.01;
      EXPECT_NEAR(covariance[column * 6 + row], sigma * sigma, 1e-12);
    }
  }
  double sum = 0.0;
  for (const double e : squared_errors(world.truth, measured)) sum += e;
  const auto count = static_cast<double>(measured.size());
  EXPECT_NEAR(sum / count, 6.0, 5.0 * std::sqrt(12.0 / count));
}

}  // namespace
}  // namespace cairn::test
