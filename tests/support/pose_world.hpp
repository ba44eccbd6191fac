// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Dense>

#include "cairn/geometry/motion.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/estimator.hpp"

namespace cairn::test {

/// A type of poses and the relative factor between them.
struct PoseTypes {
  std::shared_ptr<const VariableType> pose;
  std::shared_ptr<const FactorType> edge;
};

inline PoseTypes planar_types(Registry& registry) {
  return {registry.variable_type("VERTEX_SE2"), registry.factor_type("EDGE_SE2")};
}
/// `metric`: logarithm, g2o, rotation_vector. Once for a registry.
inline PoseTypes spatial_types(Registry& registry, const std::string& metric = "logarithm") {
  registry.set_type_options({"slam3d", {{"metric", metric}}});
  return {registry.variable_type("VERTEX_SE3:QUAT"), registry.factor_type("EDGE_SE3:QUAT")};
}
inline PoseTypes types_of(int dimension, Registry& registry) {
  return dimension == 2 ? planar_types(registry) : spatial_types(registry);
}

/// Random numbers, vectors, covariances.
class Draw {
 public:
  explicit Draw(unsigned seed) : engine_(seed) {}
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  int integer(int below) { return static_cast<int>(engine_() % static_cast<unsigned>(below)); }
  bool chance(double probability) { return uniform(0.0, 1.0) < probability; }
  double normal() { return normal_(engine_); }
  Eigen::VectorXd normals(Eigen::Index n) {
    Eigen::VectorXd x(n);
    for (double& number : x) number = normal();
    return x;
  }
  Eigen::VectorXd uniforms(Eigen::Index n, double low, double high) {
    Eigen::VectorXd x(n);
    for (double& number : x) number = uniform(low, high);
    return x;
  }
  /// Positive definite and full; standard deviations of about `sigma`.
  Eigen::MatrixXd covariance(Eigen::Index n, double sigma) {
    Eigen::MatrixXd A(n, n);
    for (double& number : A.reshaped()) number = uniform(-1.0, 1.0);
    return sigma * sigma * (A * A.transpose() + 0.2 * Eigen::MatrixXd::Identity(n, n));
  }
  /// ξ ~ N(0, Σ)
  Eigen::VectorXd error(const Eigen::MatrixXd& Sigma) {
    return Eigen::MatrixXd(Sigma.llt().matrixL()) * normals(Sigma.rows());
  }

 private:
  std::mt19937 engine_;
  std::normal_distribution<double> normal_;
};

/// Arithmetic of poses by the type's abilities alone, and factors between them.
class PoseWorld {
 public:
  using Pose = std::vector<double>;
  explicit PoseWorld(PoseTypes types)
      : types_(std::move(types)), motions_(types_.pose), group_(*types_.pose->lie_group()) {}

  const PoseTypes& types() const { return types_; }
  const MotionGroup& motions() const { return motions_; }
  int tangent() const { return motions_.tangent_size(); }

  Pose identity() const { return motions_.identity().mean; }
  Pose compose(std::span<const double> a, std::span<const double> b) const {
    Pose ab = pose();
    group_.compose(a.data(), b.data(), ab.data());
    types_.pose->normalize(ab.data());
    return ab;
  }
  Pose inverse(std::span<const double> a) const {
    Pose back = pose();
    group_.inverse(a.data(), back.data());
    return back;
  }
  /// a⁻¹ b
  Pose between(std::span<const double> a, std::span<const double> b) const {
    return compose(inverse(a), b);
  }
  Pose exp(const Eigen::VectorXd& delta) const {
    Pose a = pose();
    group_.exp(delta.data(), a.data());
    return a;
  }
  Eigen::VectorXd log(std::span<const double> a) const {
    Eigen::VectorXd delta(tangent());
    group_.log(a.data(), delta.data());
    return delta;
  }
  Pose moved(std::span<const double> a, const Eigen::VectorXd& delta) const {
    return compose(a, exp(delta));
  }
  /// Translations and rotations up to these along every axis.
  Pose random(Draw& draw, double translation, double rotation) const {
    Eigen::VectorXd delta(tangent());
    const int d = types_.pose->placement()->dimension();
    for (int k = 0; k < tangent(); ++k)
      delta[k] = draw.uniform(-1.0, 1.0) * (k < d ? translation : rotation);
    return exp(delta);
  }
  /// Its rotation; in the plane about z. And its translation.
  std::pair<Eigen::Matrix3d, Eigen::Vector3d> split(std::span<const double> x) const {
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

  Motion motion(const Pose& mean, const Eigen::MatrixXd& covariance) const {
    return {mean, {covariance.data(), covariance.data() + covariance.size()}};
  }
  Factor edge(Id from, Id to, const Pose& mean, const Eigen::MatrixXd& covariance) const {
    return motions_.to_factor(types_.edge, from, to, motion(mean, covariance));
  }
  Variable variable(Id id, Pose state = {}, bool fixed = false) const {
    return {types_.pose, id, std::move(state), fixed};
  }

 private:
  Pose pose() const { return Pose(static_cast<std::size_t>(motions_.ambient_size())); }

  PoseTypes types_;
  MotionGroup motions_;
  const LieGroup& group_;
};

/// ∂f/∂x at 0 of a function of n numbers, by central differences.
template <class F>
Eigen::MatrixXd numerical_jacobian(int n, const F& f) {
  constexpr double kStep = 1e-5;
  Eigen::MatrixXd J;
  for (int k = 0; k < n; ++k) {
    Eigen::VectorXd step = Eigen::VectorXd::Zero(n);
    step[k] = kStep;
    const Eigen::VectorXd ahead = f(step), back = f(-step);
    if (k == 0) J.resize(ahead.size(), n);
    J.col(k) = (ahead - back) / (2.0 * kStep);
  }
  return J;
}

/// ‖A − B‖ as a part of the larger norm.
inline double difference(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B) {
  const double size = std::max(A.norm(), B.norm());
  return size > 0.0 ? (A - B).norm() / size : 0.0;
}

}  // namespace cairn::test
