// SPDX-License-Identifier: BSD-3-Clause
// Laws that every factor type on offer obeys where rotations are of no, tiny and half a turn, in
// every metric; `cairn plugins --check` has the others.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <memory>
#include <set>

#include "cairn/evaluation/check_factor.hpp"
#include "cairn/plugin/registry.hpp"
#include "support/sampling.hpp"

namespace cairn::test {
namespace {

/// A factor type with its variables' types and a sample of states and measurement.
struct Sample {
  std::shared_ptr<const FactorType> type;
  std::vector<std::shared_ptr<const VariableType>> owners;
  std::vector<const VariableType*> variables;
  std::vector<std::vector<double>> x;
  std::vector<double> z, U;

  std::vector<const double*> states() const {
    std::vector<const double*> pointers;
    for (const auto& state : x) pointers.push_back(state.data());
    return pointers;
  }
  Eigen::VectorXd residual(const std::vector<double>& whitening) const {
    Eigen::VectorXd r(type->residual_size());
    type->evaluate(states().data(), z.data(), whitening.data(), r.data(), nullptr);
    return r;
  }
  std::vector<double> unit_whitening() const {
    std::vector<double> packed;
    for (int row = 0; row < type->residual_size(); ++row) {
      packed.push_back(1.0);
      packed.insert(packed.end(), type->residual_size() - row - 1, 0.0);
    }
    return packed;
  }
};

/// Calls check(sample, regime) for each factor type on offer; variables are in that regime.
template <class Check>
void for_every_factor(Check check, const std::string& metric = "") {
  Registry registry;
  if (!metric.empty()) registry.set_type_options(parse_component("slam3d:metric=" + metric));
  const auto tags = registry.names("factor");
  ASSERT_FALSE(tags.empty());
  for (const std::string& tag : tags) {
    Sample sample;
    sample.type = registry.factor_type(tag);
    for (const std::string_view variable : sample.type->variable_tags()) {
      sample.owners.push_back(registry.variable_type(variable));
      sample.variables.push_back(sample.owners.back().get());
    }
    Sampler sampler(11);
    for (const Regime& regime :
         {Regime{"identity", 0.0}, Regime{"tiny", 1e-9}, Regime{"random", -1.0},
          Regime{"almost pi", std::numbers::pi - 1e-6}, Regime{"half a turn", std::numbers::pi}}) {
      SCOPED_TRACE(tag + " " + metric + ", " + regime.name);
      for (int k = 0; k < 20; ++k) {
        sample.x.clear();
        for (const VariableType* type : sample.variables) {
          sample.x.push_back(sampler.state(*type, regime));
        }
        sample.z = sampler.measurement(*sample.type);
        sample.U = sampler.sqrt_information(sample.type->residual_size());
        check(sample, regime);
      }
    }
  }
}

TEST(EveryFactor, HasTheJacobiansThatDifferencesShow) {
  for (const std::string metric : {"logarithm", "g2o", "rotation_vector"}) {
    for_every_factor(
        [](const Sample& s, const Regime&) {
          // Some samples have a residual near its cut at π, where differences say nothing.
          const Eigen::VectorXd e = s.residual(s.unit_whitening());
          const FactorCheck check = check_factor(*s.type, s.variables, s.states(), s.z, s.U, 1e-5);
          const FactorCheck closer = check_factor(*s.type, s.variables, s.states(), s.z, s.U, 1e-6);
          EXPECT_LT(std::min(check.largest_deviation, closer.largest_deviation), 1e-7)
              << "variable " << check.variable << ", entry (" << check.row << ", " << check.column
              << "): " << check.claimed << " against " << check.numeric << "; residual "
              << e.transpose();
        },
        metric);
  }
}

TEST(EveryFactor, RefusesAMeasurementThatIsNotFinite) {
  for_every_factor([](const Sample& s, const Regime&) {
    for (std::size_t k = 0; k < s.z.size(); ++k) {
      std::vector<double> broken = s.z;
      broken[k] = std::nan("");
      EXPECT_NE(s.type->normalize(broken.data()), "");
    }
  });
}

TEST(EveryFactor, PropagatesToWhereItsErrorIsZero) {
  std::set<std::string> propagating;
  for_every_factor([&](const Sample& s, const Regime&) {
    for (int target = 0; target < s.type->arity(); ++target) {
      Sample moved = s;
      auto pointers = s.states();
      pointers[target] = nullptr;  // it must not look at what it computes
      if (!s.type->propagate(target, pointers.data(), s.z.data(), moved.x[target].data())) continue;
      propagating.insert(std::string(s.type->tag()) + " " + std::to_string(target));
      EXPECT_LT(moved.residual(moved.unit_whitening()).norm(), 1e-13);
    }
    if (s.type->is_relative()) {
      ASSERT_EQ(s.type->arity(), 2);
      ASSERT_NE(s.variables[0]->lie_group(), nullptr);
      Sample composed = s;
      s.variables[0]->lie_group()->compose(s.x[0].data(), s.z.data(), composed.x[1].data());
      EXPECT_LT(composed.residual(composed.unit_whitening()).norm(), 1e-13);
    }
  });
  for (const char* must :
       {"EDGE_SE2 0", "EDGE_SE2 1", "EDGE_SE2_XY 1", "EDGE_BEARING_RANGE_SE2_XY 1",
        "EDGE_PRIOR_SE2 0", "EDGE_PRIOR_XY 0", "EDGE_SE3:QUAT 0", "EDGE_SE3:QUAT 1",
        "EDGE_SE3_TRACKXYZ 1", "EDGE_PRIOR_SE3:QUAT 0", "EDGE_PRIOR_TRACKXYZ 0", "EDGE_POINTXY 0",
        "EDGE_POINTXY 1", "EDGE_POINTXYZ 0", "EDGE_POINTXYZ 1"}) {
    const std::string tag = std::string(must).substr(0, std::string(must).find(' '));
    EXPECT_TRUE(propagating.contains(must) || !Registry().has("factor", tag)) << must;
  }
  EXPECT_FALSE(propagating.contains("EDGE_SE2_XY 0"));
  // What measures a part of a pose does not determine it.
  for (const char* part : {"EDGE_PRIOR_SE2_XY 0", "EDGE_SE3_PRIORXYZ 0", "EDGE_SE3_PRIORQUAT 0",
                           "EDGE_SE3_PRIORVEC 0"})
    EXPECT_FALSE(propagating.contains(part)) << part;
  EXPECT_FALSE(propagating.contains("EDGE_PROJECT_BAL 1"));
}

TEST(BearingRange, RefusesANegativeRangeAndStandsOnItsLandmark) {
  Registry registry;
  const auto type = registry.factor_type("EDGE_BEARING_RANGE_SE2_XY");
  double z[] = {0.5, -1.0};
  EXPECT_NE(type->normalize(z), "");
  const double pose[] = {1, 2, 0.3}, landmark[] = {1, 2}, U[] = {1, 0, 1}, measured[] = {0.5, 1.0};
  const double* x[] = {pose, landmark};
  double r[2], J_pose[6], J_landmark[4];
  double* J[] = {J_pose, J_landmark};
  type->evaluate(x, measured, U, r, J);
  EXPECT_DOUBLE_EQ(r[1], -1.0);
  for (const double entry : J_pose) EXPECT_TRUE(std::isfinite(entry));
  for (const double entry : J_landmark) EXPECT_TRUE(std::isfinite(entry));
}

}  // namespace
}  // namespace cairn::test
