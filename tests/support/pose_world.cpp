// SPDX-License-Identifier: BSD-3-Clause
#include "support/pose_world.hpp"

#include <algorithm>

#include <Eigen/Cholesky>

namespace cairn::test {

PoseTypes planar_types(Registry& registry) {
  return {registry.variable_type("VERTEX_SE2"), registry.factor_type("EDGE_SE2")};
}

PoseTypes spatial_types(Registry& registry, const std::string& metric) {
  registry.set_type_options({"slam3d", {{"metric", metric}}});
  return {registry.variable_type("VERTEX_SE3:QUAT"), registry.factor_type("EDGE_SE3:QUAT")};
}

PoseTypes types_of(int dimension, Registry& registry) {
  return dimension == 2 ? planar_types(registry) : spatial_types(registry);
}

Eigen::VectorXd Draw::normals(Eigen::Index n) {
  Eigen::VectorXd x(n);
  for (double& number : x) number = normal();
  return x;
}

Eigen::VectorXd Draw::uniforms(Eigen::Index n, double low, double high) {
  Eigen::VectorXd x(n);
  for (double& number : x) number = uniform(low, high);
  return x;
}

Eigen::MatrixXd Draw::covariance(Eigen::Index n, double sigma) {
  Eigen::MatrixXd A(n, n);
  for (double& number : A.reshaped()) number = uniform(-1.0, 1.0);
  return sigma * sigma * (A * A.transpose() + 0.2 * Eigen::MatrixXd::Identity(n, n));
}

Eigen::VectorXd Draw::error(const Eigen::MatrixXd& Sigma) {
  return Eigen::MatrixXd(Sigma.llt().matrixL()) * normals(Sigma.rows());
}

PoseWorld::Pose PoseWorld::compose(std::span<const double> a, std::span<const double> b) const {
  Pose ab = pose();
  group_.compose(a.data(), b.data(), ab.data());
  types_.pose->normalize(ab.data());
  return ab;
}

PoseWorld::Pose PoseWorld::inverse(std::span<const double> a) const {
  Pose back = pose();
  group_.inverse(a.data(), back.data());
  return back;
}

PoseWorld::Pose PoseWorld::between(std::span<const double> a, std::span<const double> b) const {
  return compose(inverse(a), b);
}

PoseWorld::Pose PoseWorld::exp(const Eigen::VectorXd& delta) const {
  Pose a = pose();
  group_.exp(delta.data(), a.data());
  return a;
}

Eigen::VectorXd PoseWorld::log(std::span<const double> a) const {
  Eigen::VectorXd delta(tangent());
  group_.log(a.data(), delta.data());
  return delta;
}

PoseWorld::Pose PoseWorld::moved(std::span<const double> a, const Eigen::VectorXd& delta) const {
  return compose(a, exp(delta));
}

PoseWorld::Pose PoseWorld::random(Draw& draw, double translation, double rotation) const {
  Eigen::VectorXd delta(tangent());
  const int d = types_.pose->placement()->dimension();
  for (int k = 0; k < tangent(); ++k)
    delta[k] = draw.uniform(-1.0, 1.0) * (k < d ? translation : rotation);
  return exp(delta);
}

std::pair<Eigen::Matrix3d, Eigen::Vector3d> PoseWorld::split(std::span<const double> x) const {
  const int d = types_.pose->placement()->dimension();
  Eigen::MatrixXd R(d, d);
  Eigen::VectorXd t(d);
  types_.pose->placement()->split(x.data(), R.data(), t.data());
  std::pair<Eigen::Matrix3d, Eigen::Vector3d> result(Eigen::Matrix3d::Identity(),
                                                     Eigen::Vector3d::Zero());
  result.first.topLeftCorner(d, d) = R;
  result.second.head(d) = t;
  return result;
}

Motion PoseWorld::motion(const Pose& mean, const Eigen::MatrixXd& covariance) const {
  return {mean, {covariance.data(), covariance.data() + covariance.size()}};
}

Factor PoseWorld::edge(Id from, Id to, const Pose& mean, const Eigen::MatrixXd& covariance) const {
  return motions_.to_factor(types_.edge, from, to, motion(mean, covariance));
}

Variable PoseWorld::variable(Id id, Pose state, bool fixed) const {
  return {types_.pose, id, std::move(state), fixed};
}

double difference(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B) {
  const double size = std::max(A.norm(), B.norm());
  return size > 0.0 ? (A - B).norm() / size : 0.0;
}

}  // namespace cairn::test
