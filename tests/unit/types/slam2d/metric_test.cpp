// SPDX-License-Identifier: BSD-3-Clause
// The error of a planar relative pose against the type's own group.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include <Eigen/Core>

#include "cairn/plugin/registry.hpp"
#include "support/sampling.hpp"

namespace cairn::test {
namespace {

TEST(PlanarMetric, IsTranslationAndWrappedAngleOfTheErrorPose) {
  Registry registry;
  const auto type = registry.factor_type("EDGE_SE2");
  const auto pose = registry.variable_type("VERTEX_SE2");
  const LieGroup& group = *pose->lie_group();
  Sampler sampler(4);
  for (int k = 0; k < 50; ++k) {
    const auto a = sampler.state(*pose, {"any", -1.0}), b = sampler.state(*pose, {"any", -1.0}),
               z = sampler.state(*pose, {"any", -1.0});
    Eigen::Vector3d a_inverse, z_inverse, ab, expected, r;
    group.inverse(a.data(), a_inverse.data());
    group.inverse(z.data(), z_inverse.data());
    group.compose(a_inverse.data(), b.data(), ab.data());
    group.compose(z_inverse.data(), ab.data(), expected.data());
    const double unit[] = {1, 0, 0, 1, 0, 1};
    const double* x[] = {a.data(), b.data()};
    type->evaluate(x, z.data(), unit, r.data(), nullptr);
    EXPECT_LT((r - expected).norm(), 1e-13);
    EXPECT_LE(std::abs(r[2]), std::numbers::pi);
  }
}

}  // namespace
}  // namespace cairn::test
