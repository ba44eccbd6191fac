// SPDX-License-Identifier: BSD-3-Clause
#include "dense_poses.hpp"

#include <cmath>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

namespace cairn::test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd rotation_vector(const MatrixXd& R) {
  if (R.rows() == 2) return VectorXd::Constant(1, std::atan2(R(1, 0), R(0, 0)));
  const Eigen::AngleAxisd turn{Eigen::Matrix3d(R)};
  return turn.angle() * turn.axis();
}

MatrixXd rotation(const VectorXd& omega) {
  if (omega.size() == 1) return Eigen::Rotation2Dd(omega[0]).toRotationMatrix();
  const double angle = omega.norm();
  if (angle == 0.0) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, Eigen::Vector3d(omega / angle)).toRotationMatrix();
}

void DensePoses::add(std::vector<int> on, Error error, const MatrixXd& information) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(information);
  const MatrixXd root =
      eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() * eigen.eigenvectors().transpose();
  measurements_.push_back({std::move(on), std::move(error), root});
}

double DensePoses::chi2() const {
  double sum = 0.0;
  for (const Measurement& one : measurements_) sum += residual(one).squaredNorm();
  return sum;
}

Eigen::Index DensePoses::turns(const DensePose& pose) {
  return pose.R.rows() * (pose.R.rows() - 1) / 2;
}

Eigen::Index DensePoses::before(int pose) const {
  Eigen::Index sum = 0;
  for (int k = 0; k < pose; ++k) sum += size(k);
  return sum;
}

DensePose DensePoses::moved(const DensePose& pose, const VectorXd& step) {
  const Eigen::Index d = pose.t.size();
  if (turns(pose) == 0) return {pose.R, pose.t + step};
  return {pose.R * rotation(step.tail(step.size() - d)), pose.t + pose.R * step.head(d)};
}

MatrixXd DensePoses::jacobian(const Measurement& one, int pose) const {
  constexpr double kStep = 1e-3;
  std::vector<DensePose> there = poses;
  const Eigen::Index n = size(pose);
  MatrixXd J(one.root.rows(), n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto at = [&](double steps) {
      there[pose] = moved(poses[pose], VectorXd::Unit(n, k) * (steps * kStep));
      return one.error(there);
    };
    const VectorXd difference = 8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0));
    J.col(k) = one.root * difference / (12.0 * kStep);
  }
  return J;
}

DensePoses::Normal DensePoses::normal_equations() const {
  const Eigen::Index all = before(static_cast<int>(poses.size()));
  Normal normal{MatrixXd::Zero(all, all), VectorXd::Zero(all)};
  for (const Measurement& one : measurements_) {
    const VectorXd r = residual(one);
    std::vector<MatrixXd> J;
    for (const int pose : one.on) J.push_back(jacobian(one, pose));
    for (std::size_t a = 0; a < J.size(); ++a) {
      const Eigen::Index row = before(one.on[a]);
      normal.g.segment(row, J[a].cols()) -= J[a].transpose() * r;
      for (std::size_t b = 0; b < J.size(); ++b) {
        normal.H.block(row, before(one.on[b]), J[a].cols(), J[b].cols()) += J[a].transpose() * J[b];
      }
    }
  }
  return normal;
}

void DensePoses::solve() {
  for (int k = 0; k < 100; ++k) {
    const Normal normal = normal_equations();
    const VectorXd step = normal.H.ldlt().solve(normal.g);
    for (int p = 0; p < std::ssize(poses); ++p)
      poses[p] = moved(poses[p], step.segment(before(p), size(p)));
    if (step.norm() < 1e-11) return;
  }
}

}  // namespace cairn::test
