// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "cairn/geometry/motion.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/estimator.hpp"

namespace cairn::test {

/// A type of poses and the relative factor between them.
struct PoseTypes {
  std::shared_ptr<const VariableType> pose;
  std::shared_ptr<const FactorType> edge;
};

PoseTypes planar_types(Registry& registry);
/// `metric`: logarithm, g2o, rotation_vector. Once for a registry.
PoseTypes spatial_types(Registry& registry, const std::string& metric = "logarithm");
PoseTypes types_of(int dimension, Registry& registry);

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
  Eigen::VectorXd normals(Eigen::Index n);
  Eigen::VectorXd uniforms(Eigen::Index n, double low, double high);
  /// Positive definite and full; standard deviations of about `sigma`.
  Eigen::MatrixXd covariance(Eigen::Index n, double sigma);
  /// ξ ~ N(0, Σ)
  Eigen::VectorXd error(const Eigen::MatrixXd& Sigma);

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
  Pose compose(std::span<const double> a, std::span<const double> b) const;
  Pose inverse(std::span<const double> a) const;
  /// a⁻¹ b
  Pose between(std::span<const double> a, std::span<const double> b) const;
  Pose exp(const Eigen::VectorXd& delta) const;
  Eigen::VectorXd log(std::span<const double> a) const;
  Pose moved(std::span<const double> a, const Eigen::VectorXd& delta) const;
  /// Translations and rotations up to these along every axis.
  Pose random(Draw& draw, double translation, double rotation) const;
  /// Its rotation; in the plane about z. And its translation.
  std::pair<Eigen::Matrix3d, Eigen::Vector3d> split(std::span<const double> x) const;

  Motion motion(const Pose& mean, const Eigen::MatrixXd& covariance) const;
  Factor edge(Id from, Id to, const Pose& mean, const Eigen::MatrixXd& covariance) const;
  Variable variable(Id id, Pose state = {}, bool fixed = false) const;

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
double difference(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);

}  // namespace cairn::test
