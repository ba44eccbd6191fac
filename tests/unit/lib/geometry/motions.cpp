// SPDX-License-Identifier: BSD-3-Clause
#include "unit/lib/geometry/motions.hpp"

#include <cmath>
#include <utility>

#include "cairn/lie/se2.hpp"
#include "cairn/lie/se3.hpp"
#include "cairn/types/define_variable.hpp"

namespace cairn::test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd covariance(const Motion& motion) {
  const auto n =
      static_cast<Eigen::Index>(std::lround(std::sqrt(double(motion.covariance.size()))));
  return Eigen::Map<const MatrixXd>(motion.covariance.data(), n, n);
}

std::vector<double> numbers(const MatrixXd& M) { return {M.data(), M.data() + M.size()}; }

double distance(const MotionGroup& group, const std::vector<double>& a,
                const std::vector<double>& b) {
  VectorXd delta(group.tangent_size());
  group.type().local(1, a.data(), b.data(), delta.data());
  return delta.norm();
}

void expect_same(const MotionGroup& group, const Motion& a, const Motion& b, double tolerance) {
  EXPECT_LT(distance(group, a.mean, b.mean), tolerance);
  EXPECT_LT((covariance(a) - covariance(b)).norm(), tolerance * covariance(b).norm());
}

VectorXd MotionSampler::vector(int n) {
  VectorXd v(n);
  for (double& x : v) x = uniform();
  return v;
}

MatrixXd MotionSampler::matrix(int rows, int columns) {
  MatrixXd M(rows, columns);
  for (double& x : M.reshaped()) x = uniform();
  return M;
}

MatrixXd MotionSampler::positive(int n, double sigma) {
  const MatrixXd A = matrix(n, n);
  return sigma * sigma * (A * A.transpose() + 0.1 * MatrixXd::Identity(n, n));
}

std::vector<double> MotionSampler::state(const VariableType& type, double size) {
  std::vector<double> x(static_cast<std::size_t>(type.ambient_size()));
  type.lie_group()->exp((size * vector(type.tangent_size())).eval().data(), x.data());
  return x;
}

Motion MotionSampler::motion(const VariableType& type, double sigma) {
  std::vector<double> mean = state(type);
  return {std::move(mean), numbers(positive(type.tangent_size(), sigma))};
}

std::shared_ptr<const VariableType> MotionGroupTest::pose() {
  return GetParam() ? define_variable<Se3>() : define_variable<Se2>();
}

MatrixXd MotionGroupTest::ad(const VectorXd& xi) {
  if (!GetParam()) {
    return Eigen::Matrix3d{{0, -xi[2], xi[1]}, {xi[2], 0, -xi[0]}, {0, 0, 0}};
  }
  const Eigen::Matrix3d W = so3::hat<double>(xi.tail<3>());
  MatrixXd ad(6, 6);
  ad << W, so3::hat<double>(xi.head<3>()), Eigen::Matrix3d::Zero(), W;
  return ad;
}

Motion MotionGroupTest::at_rest(const MatrixXd& L) const {
  return {group_.identity().mean, numbers(L * L.transpose())};
}

}  // namespace cairn::test
