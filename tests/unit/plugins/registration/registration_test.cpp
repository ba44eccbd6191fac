// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/registration.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <random>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/geometry/motion.hpp"
#include "cairn/geometry/pose_chain.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::ElementsAreArray;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using Pair = std::pair<Id, Id>;

struct Extent {
  double length, angle;
};

/// Of a motion: its translation's length and its rotation's angle, by the chord 2√2 sin(θ/2) that
/// the Frobenius norm of R − 1 is.
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

std::vector<double> between(const Graph& graph, int a, int b) {
  const VariableType& type = graph.type(a);
  std::vector<double> back(type.ambient_size()), motion(type.ambient_size());
  type.lie_group()->inverse(graph.state(a).data(), back.data());
  type.lie_group()->compose(back.data(), graph.state(b).data(), motion.data());
  return motion;
}

/// All pairs of poses, the lower id first.
std::vector<Pair> all_pairs(const Graph& graph) {
  std::vector<Pair> pairs;
  for (int a = 0; a < graph.variable_count(); ++a) {
    for (int b = a + 1; b < graph.variable_count(); ++b)
      pairs.push_back(std::minmax(graph.id(a), graph.id(b)));
  }
  return pairs;
}

/// Σ ‖r‖² of factors on poses at their true states.
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

/// Whether so many of so many trials are within five standard deviations of what is expected.
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

class Registrations : public testing::Test {
 protected:
  void simulate(const std::string& spec) {
    world = registry.make<Generator>(spec)->generate(registry, 5);
  }
  std::unique_ptr<Registration> make(const std::string& spec) {
    auto registration = registry.make<Registration>(spec);
    registration->begin({.recording = &world.graph, .truth = &world.truth});
    return registration;
  }
  /// The answers to all pairs of poses.
  std::map<Pair, std::vector<Factor>> match_all(Registration& registration) {
    std::map<Pair, std::vector<Factor>> answers;
    for (const Pair& pair : all_pairs(world.truth)) {
      std::vector<Factor> answer = registration.match(pair.first, pair.second);
      if (!answer.empty()) answers[pair] = std::move(answer);
    }
    return answers;
  }
  Extent truly_apart(const Pair& pair) const {
    const Graph& truth = world.truth;
    const int a = *truth.find(pair.first), b = *truth.find(pair.second);
    return extent(truth.type(a), between(truth, a, b));
  }

  Registry registry;
  Simulation world;
};

// recorded ----------------------------------------------------------------------------------------

class Recorded : public Registrations {};

TEST_F(Recorded, AnswersEitherWayRoundWithWhatIsThereAndWithNothingElse) {
  simulate("sphere:turns=6,poses_per_turn=12");
  const auto recorded = make("recorded");
  std::map<Pair, int> factors;
  for (int f = 0; f < world.graph.factor_count(); ++f) {
    const auto v = world.graph.factor_variables(f);
    factors[std::minmax(world.graph.id(v[0]), world.graph.id(v[1]))] = f;
  }
  for (const Pair& pair : all_pairs(world.graph)) {
    const auto answer = recorded->match(pair.first, pair.second);
    const auto reverse = recorded->match(pair.second, pair.first);
    const auto wanted = factors.find(pair);
    ASSERT_THAT(answer, SizeIs(wanted == factors.end() ? 0 : 1));
    ASSERT_THAT(reverse, SizeIs(answer.size()));
    if (answer.empty()) continue;
    expect_same(answer.front(), world.graph.factor(wanted->second));
    expect_same(reverse.front(), answer.front());
    EXPECT_FALSE(was_false(*recorded, pair));
  }
  EXPECT_THAT(recorded->match(3, 3), IsEmpty());
  EXPECT_THAT(recorded->match(3, 1'000'000), IsEmpty());
}

TEST_F(Recorded, AnswersWithEachOfSeveralFactorsAsItStands) {
  simulate("ring:poses=40");
  Graph& graph = world.graph;
  const auto type = registry.factor_type("EDGE_SE2");
  const std::array<double, 6> information{1, 0, 0, 1, 0, 1};
  const int first =
      graph.add_factor(type, std::array{10, 30}, std::array{1.0, 2.0, 0.5}, information);
  const int second =
      graph.add_factor(type, std::array{30, 10}, std::array{-1.5, 0.0, -0.4}, information);
  for (const Pair& pair : {Pair{10, 30}, Pair{30, 10}}) {
    const auto answer = make("recorded")->match(pair.first, pair.second);
    ASSERT_THAT(answer, SizeIs(2));
    expect_same(answer[0], graph.factor(first));
    expect_same(answer[1], graph.factor(second));
    const auto made_up = make("recorded:false_rate=1")->match(pair.first, pair.second);
    ASSERT_THAT(made_up, SizeIs(1));
    EXPECT_THAT(made_up[0].variables, ElementsAre(10, 30));
  }
}

TEST_F(Recorded, TakesOnlyMotionsForMatches) {
  simulate("landmarks2d:poses=60");
  const auto recorded = make("recorded");
  int motions = 0, sights = 0;
  for (int f = 0; f < world.graph.factor_count(); ++f) {
    const auto v = world.graph.factor_variables(f);
    if (v.size() != 2) continue;
    const bool motion = world.graph.factor_type(f).is_relative();
    ++(motion ? motions : sights);
    EXPECT_EQ(!recorded->match(world.graph.id(v[0]), world.graph.id(v[1])).empty(), motion);
  }
  EXPECT_GT(motions, 0);
  EXPECT_GT(sights, 0);
}

TEST_F(Recorded, MatchesAPartOfThePairsFalsely) {
  for (const std::string spec : {"manhattan:poses=1500", "sphere:turns=30,poses_per_turn=30"}) {
    simulate(spec);
    const auto right = make("recorded"), mixed = make("recorded:false_rate=0.3,seed=8");
    Extent longest{0.0, 0.0};
    const std::vector<bool> closes_loop = loop_closures(world.graph);
    for (int f = 0; f < world.graph.factor_count(); ++f) {
      if (!closes_loop[f]) continue;
      const Extent loop = extent(world.graph.type(0), world.graph.measurement(f));
      longest = {std::max(longest.length, loop.length), std::max(longest.angle, loop.angle)};
    }
    std::int64_t matched = 0, wrong = 0;
    for (int f = 0; f < world.graph.factor_count(); ++f) {
      const auto v = world.graph.factor_variables(f);
      const Pair pair{world.graph.id(v[0]), world.graph.id(v[1])};
      const Factor wanted = right->match(pair.first, pair.second).front();
      const auto answer = mixed->match(pair.first, pair.second);
      ASSERT_THAT(answer, SizeIs(1));
      ++matched;
      EXPECT_EQ(answer.front().information, wanted.information);
      EXPECT_EQ(answer.front().variables, wanted.variables);
      EXPECT_EQ(answer.front().measurement != wanted.measurement, was_false(*mixed, pair));
      expect_same(mixed->match(pair.second, pair.first).front(), answer.front());
      if (!was_false(*mixed, pair)) continue;
      ++wrong;
      const Extent drawn = extent(world.graph.type(0), answer.front().measurement);
      EXPECT_LE(drawn.length, longest.length * (1.0 + 1e-12));
      EXPECT_LE(drawn.angle, longest.angle * (1.0 + 1e-12));
    }
    expect_share(wrong, matched, 0.3);
    EXPECT_FALSE(was_false(*mixed, {0, 1'000'000}));
  }
}

// simulated ---------------------------------------------------------------------------------------

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

/// Planar poses one metre apart on the x axis, joined by odometry with unit information.
class PlanarRegistrations : public Registrations {
 protected:
  PlanarRegistrations() {
    const auto pose = registry.variable_type("VERTEX_SE2");
    for (int k = 0; k < 6; ++k)
      world.graph.add_variable(pose, 10 * k, std::array{1.0 * k, 0.0, 0.0});
    for (int k = 0; k < 5; ++k) link(k, k + 1, 1.0);
    world.truth = world.graph.clone();
  }
  void link(int a, int b, double weight) {
    world.graph.add_factor(registry.factor_type("EDGE_SE2"), std::array{a, b},
                           std::array{1.0 * (b - a), 0.0, 0.0},
                           std::array{weight, 0.0, 0.0, weight, 0.0, weight});
  }
  double variance_measured() {
    const MotionGroup group(registry.variable_type("VERTEX_SE2"));
    return group.of_factor(make("simulated")->match(0, 10).front(), 0).covariance[0];
  }
};

TEST_F(PlanarRegistrations, SimulatedTakesTheMedianOfTheRecordedCovariances) {
  EXPECT_NEAR(variance_measured(), 1.0, 1e-12);  // there is but odometry
  link(0, 2, 4.0);
  link(5, 2, 1e6);
  EXPECT_NEAR(variance_measured(), 1e-6, 1e-12);  // the better of the two
  link(1, 4, 100.0);
  EXPECT_NEAR(variance_measured(), 0.01, 1e-12);
}

TEST_F(PlanarRegistrations, SimulatedErrsWithTheCorrelationsOfTheRecording) {
  const int loop = world.graph.add_factor(registry.factor_type("EDGE_SE2"), std::array{4, 1},
                                          std::array{-3.0, 0.5, 0.8},
                                          std::array{400.0, 300.0, -700.0, 900.0, -900.0, 2500.0});
  const MotionGroup group(registry.variable_type("VERTEX_SE2"));
  const std::vector<double> covariance = group.of_factor(world.graph.factor(loop), 10).covariance;
  std::vector<Factor> measured;
  for (int seed = 0; seed < 500; ++seed) {
    const auto simulated = make("simulated:range=10,seed=" + std::to_string(seed));
    for (const auto& [pair, answer] : match_all(*simulated)) measured.push_back(answer.front());
  }
  ASSERT_THAT(measured, SizeIs(500 * 15));
  EXPECT_THAT(group.of_factor(measured.front(), measured.front().variables[0]).covariance,
              testing::Pointwise(testing::DoubleNear(1e-12), covariance));
  const Factor another = make("simulated:sigma_translation=0.5")->match(0, 10).front();
  EXPECT_THAT(group.of_factor(another, 0).covariance,
              testing::Pointwise(testing::DoubleNear(1e-12),
                                 {0.25, 0.0, 0.0, 0.0, 0.25, 0.0, 0.0, 0.0, covariance[8]}));
  double sum = 0.0;
  for (const double e : squared_errors(world.truth, measured)) sum += e;
  const auto count = static_cast<double>(measured.size());
  EXPECT_NEAR(sum / count, 3.0, 5.0 * std::sqrt(6.0 / count));
}

TEST_F(PlanarRegistrations, SimulatedSaysWhatItNeeds) {
  const auto simulated = registry.make<Registration>("simulated");
  EXPECT_THAT(message_of([&] { simulated->begin({.recording = &world.graph, .truth = nullptr}); },
                         ErrorCode::usage),
              AllOf(HasSubstr("needs the truth"), HasSubstr("give a graph with the true states"),
                    HasSubstr("'recorded'")));
  EXPECT_THAT(message_of([&] { simulated->begin({.recording = nullptr, .truth = &world.truth}); },
                         ErrorCode::usage),
              HasSubstr("needs the recording"));
  const Graph empty;
  EXPECT_THAT(message_of([&] { simulated->begin({.recording = &empty, .truth = &world.truth}); },
                         ErrorCode::input),
              HasSubstr("no relative factor"));
  EXPECT_THROW(simulated->match(0, 10), std::logic_error);
}

TEST_F(PlanarRegistrations, SimulatedNamesThePoseWhoseTruthIsMissing) {
  const auto simulated = make("simulated");
  EXPECT_THAT(message_of([&] { simulated->match(0, 11); }, ErrorCode::input),
              HasSubstr("the truth has no pose 11"));

  world.truth = Graph();
  for (const Id id : {0, 10})
    world.truth.add_variable(registry.variable_type("VERTEX_XY"), id, std::array{0.0, 0.0});
  EXPECT_THAT(message_of([&] { simulated->match(0, 10); }, ErrorCode::input),
              AllOf(HasSubstr("VERTEX_XY 0"), HasSubstr("VERTEX_SE2")));
}

TEST_F(PlanarRegistrations, RecordedNeedsNoTruthButARecording) {
  const auto recorded = registry.make<Registration>("recorded");
  EXPECT_THAT(message_of([&] { recorded->begin({}); }, ErrorCode::usage),
              HasSubstr("needs the recording"));
  EXPECT_THROW(recorded->match(0, 10), std::logic_error);
  recorded->begin({.recording = &world.graph, .truth = nullptr});
  EXPECT_THAT(recorded->match(0, 10), SizeIs(1));
  recorded->begin({.recording = &world.truth, .truth = nullptr});
  EXPECT_THAT(recorded->match(0, 10), SizeIs(1));
}

TEST_F(PlanarRegistrations, PosesOfTwoTypesAreRefused) {
  Graph& graph = world.graph;
  const auto pose = registry.variable_type("VERTEX_SE3:QUAT");
  for (const Id id : {100, 101})
    graph.add_variable(pose, id, std::array{0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0});
  std::vector<double> information(21, 0.0);
  for (int row = 0, place = 0; row < 6; place += 6 - row, ++row) information[place] = 1.0;
  graph.add_factor(registry.factor_type("EDGE_SE3:QUAT"), std::array{6, 7},
                   std::array{0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0}, information);
  EXPECT_THAT(message_of([&] { make("recorded"); }, ErrorCode::input),
              AllOf(HasSubstr("VERTEX_SE2 and VERTEX_SE3:QUAT"), HasSubstr("EDGE_SE3:QUAT 100")));
}

TEST_F(PlanarRegistrations, OptionsOutOfRangeAreRefused) {
  for (const std::string rate : {"recorded:false_rate", "simulated:false_rate",
                                 "simulated:failure_rate", "simulated:far_rate"}) {
    for (const std::string value : {"-0.1", "1.1", "often"}) {
      EXPECT_THAT(message_of([&] { make(rate + "=" + value); }, ErrorCode::usage),
                  AllOf(HasSubstr("_rate"), HasSubstr("0 to 1")));
    }
    make(rate + "=0");
    make(rate + "=1");
  }
  for (const std::string spec : {"range=0", "angle=0", "angle=4", "sigma_translation=-1",
                                 "sigma_rotation=-1", "seed=-1", "seed=1.5"}) {
    const std::string name = spec.substr(0, spec.find('='));
    EXPECT_THAT(message_of([&] { make("simulated:" + spec); }, ErrorCode::usage),
                HasSubstr("'" + name + "'"));
  }
}

TEST(FunctionRegistrationTest, AnswersWithItsFunction) {
  FunctionRegistration registration([](Id earlier, Id later) {
    Factor factor;
    factor.variables = {earlier, later};
    return std::vector<Factor>{factor};
  });
  registration.begin({});
  EXPECT_THAT(registration.match(3, 8).front().variables, ElementsAreArray({3, 8}));
  EXPECT_EQ(query<FalseMatches>(registration), nullptr);
}

}  // namespace
}  // namespace cairn
