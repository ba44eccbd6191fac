// SPDX-License-Identifier: BSD-3-Clause
#include "absolute.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"
#include "dense/cholesky.hpp"
#include "dense/lu.hpp"

namespace cairn::compact {
namespace {

constexpr double kAnywhere = 1e6;   // [m]
constexpr double kSomewhere = 1e4;  // where the heading, below, is known, the position is
constexpr double kHeading = 0.2;    // [rad]

[[noreturn]] void refuse(const std::string& message) { throw Error(ErrorCode::input, message); }

}  // namespace

namespace {

Measured checked(const Factor& factor, Id pose, const VariableType& type) {
  if (!factor.type) refuse("an absolute measurement without a type");
  const std::string name = fmt::format("{} of pose {}", factor.type->tag(), pose);
  if (factor.variables != std::vector<Id>{pose})
    refuse(fmt::format("{} is not a measurement of this {} alone", name, type.tag()));
  const VariableType* const types[] = {&type};
  return {factor, types, name};
}

}  // namespace

AbsoluteMeasurement::AbsoluteMeasurement(const Factor& factor, Id pose, const VariableType& type)
    : measured_(checked(factor, pose, type)) {}

AbsoluteMeasurement::Linear AbsoluteMeasurement::at(const State& x) const {
  const double* const states[] = {x.data()};
  Measured::Linear linear = measured_.at(states);
  return {std::move(linear.residual), std::move(linear.J.front())};
}

MeasuredFit fit(const AbsoluteMeasurement::Linear& measurement, const Matrix& covariance) {
  const Eigen::MatrixXd& J = measurement.J;
  return compare(measurement.residual, J * covariance * J.transpose(), J);
}

FrameEstimate::FrameEstimate(const RigidGroup& group, std::vector<PlacedMeasurement> measurements,
                             const State& x, Eigen::MatrixXd covariance)
    : group_(group), measurements_(std::move(measurements)), x_(x), Sigma_(std::move(covariance)) {
  const int n = group_.tangent_size();
  const AbsoluteMeasurement::Linear now = rows(group_.identity());
  e_ = now.residual;
  G_ = now.J;
  H_ = Eigen::MatrixXd::Zero(e_.size(), n * std::ssize(measurements_));
  Eigen::Index row = 0, column = 0;
  for (const PlacedMeasurement& placed : measurements_) {
    const Eigen::MatrixXd J = placed.measurement->at(placed.x).J;
    H_.block(row, column, J.rows(), n) = J;
    row += J.rows();
    column += n;
  }
  R_ = Eigen::MatrixXd::Identity(row, row) +
       H_ * Sigma_.topLeftCorner(column, column) * H_.transpose();
  const Eigen::MatrixXd before =
      Eigen::MatrixXd(group_.isotropic(kAnywhere, std::numbers::pi)).inverse();
  const Eigen::MatrixXd M = G_.transpose() * Eigen::LLT<Eigen::MatrixXd>(R_).solve(G_) + before;
  P_ = Eigen::LLT<Eigen::MatrixXd>(M).solve(Eigen::MatrixXd::Identity(n, n));
}

AbsoluteMeasurement::Linear FrameEstimate::rows(const State& move) const {
  const int n = group_.tangent_size();
  const State x = group_.compose(move, x_);
  AbsoluteMeasurement::Linear all{Eigen::VectorXd(0), Eigen::MatrixXd(0, n)};
  for (const PlacedMeasurement& placed : measurements_) {
    const State x_k = group_.compose(move, placed.x);
    const AbsoluteMeasurement::Linear one = placed.measurement->at(x_k);
    const Eigen::Index old = all.residual.size();
    all.residual.conservativeResize(old + one.residual.size());
    all.residual.tail(one.residual.size()) = one.residual;
    all.J.conservativeResize(old + one.residual.size(), n);
    all.J.bottomRows(one.residual.size()) = one.J * group_.adjoint(group_.between(x_k, x));
  }
  return all;
}

MeasuredFit FrameEstimate::fit(const AbsoluteMeasurement::Linear& measurement) const {
  const int n = group_.tangent_size();
  const Eigen::Index others = H_.cols();
  const Eigen::MatrixXd& J = measurement.J;
  const Eigen::LLT<Eigen::MatrixXd> R(R_);
  const Eigen::MatrixXd C = J * Sigma_.bottomLeftCorner(n, others) * H_.transpose();
  const Eigen::MatrixXd Q = J - C * R.solve(G_);
  const Eigen::MatrixXd S = J * Sigma_.bottomRightCorner(n, n) * J.transpose() -
                            C * R.solve(Eigen::MatrixXd(C.transpose())) + Q * P_ * Q.transpose();
  // The likeliest motion and errors, given the other residuals, have these already.
  const Eigen::VectorXd delta = -P_ * (G_.transpose() * R.solve(e_));
  const Eigen::VectorXd e = measurement.residual + J * delta - C * R.solve(e_ + G_ * delta);
  return compare(e, S, J);
}

bool FrameEstimate::determined() const {
  const Eigen::Matrix<double, 6, 6> S = group_.twist_covariance(P_);
  return S.diagonal().tail<3>().maxCoeff() < kHeading * kHeading &&
         S.diagonal().head<3>().maxCoeff() < kSomewhere * kSomewhere;
}

State FrameEstimate::best_move() const {
  constexpr int kMostSteps = 200;
  constexpr double kDone = 1e-12, kMostDamping = 1e12;
  State move = group_.identity();
  AbsoluteMeasurement::Linear at = rows(move);
  double lambda = 1e-4;
  for (int step = 0; step < kMostSteps && lambda < kMostDamping; ++step) {
    Eigen::MatrixXd M = at.J.transpose() * at.J;
    M.diagonal() *= 1.0 + lambda;
    const Vector delta =
        Eigen::LLT<Eigen::MatrixXd>(M).solve(Eigen::VectorXd(-at.J.transpose() * at.residual));
    // x exp(δ) x⁻¹ with the pose at x moved already.
    const State moved = group_.compose(move, x_);
    const State next = group_.normalized(
        group_.compose(group_.compose(moved, group_.exp(delta)), group_.inverse(x_)));
    AbsoluteMeasurement::Linear there = rows(next);
    const double before = at.residual.squaredNorm(), after = there.residual.squaredNorm();
    if (!(after < before)) {
      lambda *= 10.0;
      continue;
    }
    move = next;
    at = std::move(there);
    lambda = std::max(lambda / 10.0, 1e-9);
    if (before - after < kDone * before) break;
  }
  return move;
}

}  // namespace cairn::compact
