// SPDX-License-Identifier: BSD-3-Clause
// Laws that every factor type on offer obeys.
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
  Eigen::MatrixXd whitening() const {
    const int size = type->residual_size();
    Eigen::MatrixXd full = Eigen::MatrixXd::Zero(size, size);
    const double* entry = U.data();
    for (int row = 0; row < size; ++row) {
      for (int column = row; column < size; ++column) full(row, column) = *entry++;
    }
    return full;
  }
  std::vector<double> unit_whitening() const {
    std::vector<double> packed;
    for (int row = 0; row < type->residual_size(); ++row) {
      packed.push_back(1.0);
      packed.insert(packed.end(), type->residual_size() - row - 1, 0.0);
    }
    return packed;
  }
  /// The Jacobian of one variable, whitened.
  std::vector<Eigen::MatrixXd> jacobians() const {
    std::vector<Eigen::MatrixXd> all;
    std::vector<double*> pointers;
    for (int v = 0; v < type->arity(); ++v) {
      all.emplace_back(type->residual_size(), type->tangent_size(v));
    }
    for (auto& J : all) pointers.push_back(J.data());
    Eigen::VectorXd r(type->residual_size());
    type->evaluate(states().data(), z.data(), U.data(), r.data(), pointers.data());
    return all;
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

TEST(EveryFactor, DeclaresSizesThatFitItsVariables) {
  for_every_factor([](const Sample& s, const Regime&) {
    ASSERT_EQ(s.type->arity(), static_cast<int>(s.variables.size()));
    for (int v = 0; v < s.type->arity(); ++v) {
      EXPECT_EQ(s.type->tangent_size(v), s.variables[v]->tangent_size());
      EXPECT_EQ(s.type->ambient_size(v), s.variables[v]->ambient_size());
    }
  });
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

TEST(EveryFactor, WhitensItsResidualAndJacobians) {
  for_every_factor([](const Sample& s, const Regime&) {
    const Eigen::VectorXd expected = s.whitening() * s.residual(s.unit_whitening());
    EXPECT_LT((s.residual(s.U) - expected).norm(), 1e-13 * (10.0 + expected.norm()));
    Sample plain = s;
    plain.U = s.unit_whitening();
    const auto whitened = s.jacobians(), raw = plain.jacobians();
    for (int v = 0; v < s.type->arity(); ++v) {
      const Eigen::MatrixXd expected_J = s.whitening() * raw[v];
      EXPECT_LT((whitened[v] - expected_J).norm(), 1e-13 * (10.0 + expected_J.norm()));
    }
  });
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

/// A pool of one factor seen through the interface of a pool, against `evaluate`.
void expect_linearized_as_evaluated(const Sample& s, double weight, bool transpose) {
  const int arity = s.type->arity();
  const std::vector<std::int32_t> slots(arity, 0);
  const auto states = s.states();
  const FactorView pool{1, slots.data(), s.z.data(), s.U.data(), nullptr, states.data()};

  std::vector<double> H, g;
  std::vector<LinearizeTarget> blocks, gradients;
  for (int a = 0; a < arity; ++a) {
    for (int b = a; b < arity; ++b) {
      blocks.emplace_back(LinearizeTarget::Array::H, H.size(), LinearizeTarget::How::write,
                          transpose && a != b);
      H.resize(H.size() + s.type->tangent_size(a) * s.type->tangent_size(b), NAN);
    }
    gradients.emplace_back(LinearizeTarget::Array::gradient, g.size(), LinearizeTarget::How::add);
    g.resize(g.size() + s.type->tangent_size(a), 0.0);
  }
  const LinearizeSink sink{{H.data(), g.data()}, blocks.data(), gradients.data()};
  double squared = 0.0, squared_alone = 0.0;
  s.type->linearize(pool, 0, 1, &weight, sink, &squared);
  s.type->squared_norms(pool, 0, 1, &squared_alone);

  const Eigen::VectorXd r = s.residual(s.U);
  EXPECT_NEAR(squared, r.squaredNorm(), 1e-12 * (1.0 + r.squaredNorm()));
  EXPECT_NEAR(squared_alone, r.squaredNorm(), 1e-12 * (1.0 + r.squaredNorm()));
  const auto J = s.jacobians();
  int pair = 0;
  for (int a = 0; a < arity; ++a) {
    const Eigen::VectorXd expected = -weight * J[a].transpose() * r;
    EXPECT_LT(
        (Eigen::Map<Eigen::VectorXd>(g.data() + gradients[a].offset(), J[a].cols()) - expected)
            .norm(),
        1e-12 * (1.0 + expected.norm()));
    for (int b = a; b < arity; ++b) {
      Eigen::MatrixXd block = weight * J[a].transpose() * J[b];
      if (transpose && a != b) block.transposeInPlace();
      const Eigen::Map<Eigen::MatrixXd> written(H.data() + blocks[pair++].offset(), block.rows(),
                                                block.cols());
      EXPECT_LT((written - block).norm(), 1e-12 * (1.0 + block.norm()));
    }
  }
}

TEST(EveryFactor, LinearizesAPoolAsItEvaluatesOneFactor) {
  for (const std::string metric : {"logarithm", "g2o", "rotation_vector"}) {
    for_every_factor(
        [](const Sample& s, const Regime&) {
          expect_linearized_as_evaluated(s, 1.0, false);
          expect_linearized_as_evaluated(s, 0.3, true);
        },
        metric);
  }
}

TEST(EveryFactor, WritesNothingForVariablesThatAreHeld) {
  for_every_factor([](const Sample& s, const Regime&) {
    const int arity = s.type->arity();
    const std::vector<std::int32_t> slots(arity, 0);
    const std::vector<LinearizeTarget> nowhere(arity * (arity + 1) / 2);
    const auto states = s.states();
    const FactorView pool{1, slots.data(), s.z.data(), s.U.data(), nullptr, states.data()};
    // A write would go to a null pointer.
    const LinearizeSink sink{.blocks = nowhere.data(), .gradients = nowhere.data()};
    double squared = -1.0;
    s.type->linearize(pool, 0, 1, nullptr, sink, &squared);
    EXPECT_NEAR(squared, s.residual(s.U).squaredNorm(), 1e-12 * (1.0 + squared));
  });
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
