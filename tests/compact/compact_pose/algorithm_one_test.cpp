// SPDX-License-Identifier: BSD-3-Clause
// The lazy choice of links is that of Algorithm 1, which computes all gains anew after every link.
#include "compact/compact_pose/algorithm_one.hpp"

#include <ostream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "compact/support/policy_runs.hpp"

namespace cairn::compact {
namespace {

using test::Draw;
using test::planar_types;
using test::PolicyRun;
using test::PoseTypes;
using test::PoseWorld;
using test::run;
using test::simulate;

struct Example {
  std::string name;
  int dimension;
  std::string generator, registration;
  Thresholds thresholds;
  std::string sensor;  ///< nothing: as the odometry
};
std::ostream& operator<<(std::ostream& out, const Example& example) { return out << example.name; }

std::vector<Example> examples() {
  const std::string city = "manhattan:poses=160,streets=4,translation_sigma=0.03";
  const std::string sphere = "sphere:turns=5,poses_per_turn=14,radius=6,rotation_sigma=0.01";
  return {
      {"plane", 2, city, "simulated:range=3.5", {{3, 3, 3}, 1.8, 0.1, 2.0, 2.2}, ""},
      {"plane_likely", 2, city, "simulated:range=3.5", {{6, 3, 3}, 3.0, 0.6, 3, 4}, "0.02 0.01"},
      {"plane_failures",
       2,
       city,
       "simulated:range=5,failure_rate=0.6",
       {{4, 4, 4}, 1.8, 0.05, 1.3, 3.5},
       "0.02 0.02"},
      {"space", 3, sphere, "simulated:range=4", {{6, 6, 6}, 0.9, 0.1, 3.5, 4.2}, ""},
      {"space_sensor",
       3,
       sphere,
       "simulated:range=6,failure_rate=0.3",
       {{6, 6, 4}, 1.2, 0.3, 3.0, 4.0},
       "0.1 0.03"}};
}

/// Odometry of all kinds, or on a grid two links would often tell just the same.
void vary_odometry(const PoseWorld& poses, Graph& graph) {
  Draw draw(1);
  for (int f = 0; f < graph.factor_count(); ++f) {
    Factor factor = graph.factor(f);
    Motion motion = poses.motions().of_factor(factor, factor.variables[0]);
    for (double& number : motion.covariance) number *= 0.6;
    const double more = draw.uniform(0.0, 1.0);
    for (int k = 0; k < poses.tangent(); ++k)
      motion.covariance[k * (poses.tangent() + 1)] *= 1.0 + more * draw.uniform(0.5, 1.0);
    factor =
        poses.motions().to_factor(factor.type, factor.variables[0], factor.variables[1], motion);
    graph.set_measurement(f, factor.measurement, factor.information);
  }
}

class AlgorithmOneOf : public testing::TestWithParam<Example> {};
INSTANTIATE_TEST_SUITE_P(Examples, AlgorithmOneOf, testing::ValuesIn(examples()),
                         [](const auto& example) { return example.param.name; });

TEST_P(AlgorithmOneOf, IsWhatThePolicyDoes) {
  const Example& example = GetParam();
  const Thresholds& t = example.thresholds;
  Registry registry;
  Simulation world = simulate(registry, example.generator);
  const PoseWorld poses(example.dimension == 2
                            ? planar_types(registry)
                            : PoseTypes{registry.variable_type("VERTEX_SE3:QUAT"),
                                        registry.factor_type("EDGE_SE3:QUAT")});
  vary_odometry(poses, world.graph);
  std::optional<Eigen::MatrixXd> expected;
  if (!example.sensor.empty()) {
    std::istringstream sigmas(example.sensor);
    double translation = 0.0, rotation = 0.0;
    sigmas >> translation >> rotation;
    Eigen::VectorXd variances(poses.tangent());
    for (int k = 0; k < poses.tangent(); ++k)
      variances[k] = std::pow(k < example.dimension ? translation : rotation, 2);
    expected = variances.asDiagonal();
  }
  const auto registration = registry.make<Registration>(example.registration);
  registration->begin({.recording = &world.graph, .truth = &world.truth});
  AlgorithmOne reference(poses, registry.make<Estimator>("batch"), t, expected);
  reference.run(world.graph, *registration);

  const ComponentSpec spec{"compact_pose",
                           {{"estimator", "batch"},
                            {"reuse", "false"},
                            {"range", std::to_string(t.v[0])},
                            {"range_y", std::to_string(t.v[1])},
                            {"range_z", std::to_string(t.v[2])},
                            {"angle", std::to_string(t.angle)},
                            {"probability", std::to_string(t.s)},
                            {"loop_gain", std::to_string(t.g_loop)},
                            {"pose_gain", std::to_string(t.g_pose)},
                            {"sensor", example.sensor}}};
  const PolicyRun policy = run(registry.make<PosePolicy>(spec), *registration, world.graph);
  EXPECT_EQ(policy.links(), reference.links);
  std::vector<Id> kept = policy.kept();
  if (!policy.reports.back().kept) kept.push_back(policy.reports.back().id);  // the way ends there
  EXPECT_EQ(kept, reference.kept);
  std::size_t k = 0;
  for (const PoseReport& report : policy.reports) {
    for (const LinkReport& link : report.links) {
      if (link.verdict != LinkVerdict::linked || k == reference.gains.size()) continue;
      EXPECT_NEAR(link.gain, reference.gains[k], 1e-4 * (1.0 + reference.gains[k]));
      ++k;
    }
  }
  // Neither everything nor nothing.
  EXPECT_GT(reference.links.size(), 5U);
  EXPECT_GT(reference.kept.size(), 10U);
  EXPECT_LT(reference.kept.size(), policy.reports.size() - 10U);
}

}  // namespace
}  // namespace cairn::compact
