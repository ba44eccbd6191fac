// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/normalized_error.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/QR>

#include "cairn/error.hpp"

namespace cairn {
namespace {

/// x_0 t_0⁻¹ t_v of each variable: the truth as seen from the estimate's first pose.
std::vector<std::vector<double>> moved_truth(const Graph& estimate, const Graph& truth) {
  std::vector<std::vector<double>> moved;
  std::vector<double> motion, back;
  for (int v = 0; v < estimate.variable_count(); ++v) {
    const VariableType& type = estimate.type(v);
    const LieGroup* group = type.lie_group();
    const bool is_pose = group && type.placement() && type.placement()->has_orientation();
    if (!is_pose || type.tag() != estimate.type(0).tag()) {
      throw Error(ErrorCode::usage, "no normalised error: " + estimate.describe_variable(v) +
                                        " is no pose of a Lie group, or of another than the first");
    }
    const auto other = truth.find(estimate.id(v));
    if (!other || truth.type(*other).tag() != type.tag()) {
      throw Error(ErrorCode::input,
                  "no normalised error: the truth has no " + estimate.describe_variable(v));
    }
    const auto true_state = truth.state(*other);
    std::vector<double> state(true_state.size());
    if (v == 0) {
      back.resize(state.size());
      motion.resize(state.size());
      group->inverse(true_state.data(), back.data());
      group->compose(estimate.state(0).data(), back.data(), motion.data());
    }
    group->compose(motion.data(), true_state.data(), state.data());
    moved.push_back(std::move(state));
  }
  return moved;
}

}  // namespace

NormalizedError normalized_error(const Graph& estimate, const Graph& truth) {
  const std::vector<std::vector<double>> moved = moved_truth(estimate, truth);
  std::vector<Eigen::VectorXd> error;
  NormalizedError result;
  for (int v = 0; v < estimate.variable_count(); ++v) {
    Eigen::VectorXd e(estimate.type(v).tangent_size());
    estimate.type(v).local(1, estimate.state(v).data(), moved[v].data(), e.data());
    if (v > 0 && estimate.fixed(v)) {
      e.setZero();
    } else if (v > 0) {
      result.dof += static_cast<int>(e.size());
    }
    error.push_back(std::move(e));
  }
  for (int f = 0; f < estimate.factor_count(); ++f) {
    const FactorRef ref = estimate.factor(f);
    const FactorPool& pool = estimate.factor_pools()[ref.pool];
    const auto on = estimate.factor_variables(f);
    const int rows = pool.type->residual_size();
    std::vector<const double*> states;
    std::vector<Eigen::MatrixXd> J;
    std::vector<double*> jacobians;
    for (const std::int32_t v : on) {
      states.push_back(estimate.state(v).data());
      J.emplace_back(rows, estimate.type(v).tangent_size());
    }
    for (Eigen::MatrixXd& block : J) jacobians.push_back(block.data());
    Eigen::VectorXd residual(rows), whitened = Eigen::VectorXd::Zero(rows);
    const std::int64_t triangle = std::int64_t{rows} * (rows + 1) / 2;
    pool.type->evaluate(states.data(), estimate.measurement(f).data(),
                        pool.sqrt_information.data() + triangle * ref.entry, residual.data(),
                        jacobians.data());
    for (std::size_t k = 0; k < J.size(); ++k) whitened += J[k] * error[on[k]];
    result.squared += whitened.squaredNorm();
  }
  return result;
}

namespace {

/// The derivative of a variable's position by δ, dimension × tangent; the position itself.
struct Position {
  Eigen::VectorXd t;
  Eigen::MatrixXd G;
};

Position position(const VariableType& type, std::span<const double> x) {
  const Placement* place = type.placement();
  if (!place) {
    throw Error(ErrorCode::usage,
                "no expected error: " + std::string(type.tag()) + " is nowhere in space");
  }
  constexpr double kStep = 1e-5;  // positions are smooth in δ: ten digits
  const int d = place->dimension(), n = type.tangent_size();
  std::vector<double> moved(x.begin(), x.end()), R(static_cast<std::size_t>(d * d));
  const auto at = [&](const std::vector<double>& state) {
    Eigen::VectorXd t(d);
    place->split(state.data(), R.data(), t.data());
    return t;
  };
  Position result{at(moved), Eigen::MatrixXd(d, n)};
  Eigen::VectorXd delta = Eigen::VectorXd::Zero(n);
  const std::int64_t offset = 0;
  for (int k = 0; k < n; ++k) {
    delta[k] = kStep;
    type.retract(1, x.data(), &offset, delta.data(), moved.data());
    const Eigen::VectorXd ahead = at(moved);
    delta[k] = -kStep;
    type.retract(1, x.data(), &offset, delta.data(), moved.data());
    delta[k] = 0.0;
    result.G.col(k) = (ahead - at(moved)) / (2.0 * kStep);
  }
  return result;
}

/// What the generators of rigid motions do to positions: columns, orthonormal.
Eigen::MatrixXd rigid_directions(const std::vector<Position>& positions) {
  const Eigen::Index d = positions.front().t.size(), n = std::ssize(positions);
  Eigen::VectorXd centre = Eigen::VectorXd::Zero(d);
  for (const Position& p : positions) centre += p.t / static_cast<double>(n);
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(d * n, d * (d + 1) / 2);
  for (Eigen::Index k = 0; k < n; ++k) {
    const Eigen::VectorXd r = positions[static_cast<std::size_t>(k)].t - centre;
    M.block(d * k, 0, d, d).setIdentity();
    Eigen::Index column = d;
    for (Eigen::Index a = 0; a < d; ++a) {
      for (Eigen::Index b = a + 1; b < d; ++b, ++column) {
        M(d * k + a, column) = -r[b];
        M(d * k + b, column) = r[a];
      }
    }
  }
  // Poses on a line leave a rotation without effect: the decomposition tells the rank.
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(M);
  return qr.householderQ() * Eigen::MatrixXd::Identity(d * n, qr.rank());
}

}  // namespace

double expected_ate(Estimator& estimator, const Graph& graph, std::span<const Id> poses) {
  std::vector<Position> positions;
  for (const Id id : poses) {
    const int v = *graph.find(id);
    positions.push_back(position(graph.type(v), graph.state(v)));
  }
  if (positions.empty()) return 0.0;
  const Eigen::Index d = positions.front().t.size(), n = std::ssize(positions);
  const Eigen::Index tangent = positions.front().G.cols();
  Eigen::MatrixXd Sigma(d * n, d * n), column(tangent * n, tangent);
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto& to = positions[static_cast<std::size_t>(k)];
    estimator.covariance_column(poses[static_cast<std::size_t>(k)], poses,
                                {column.data(), static_cast<std::size_t>(column.size())});
    for (Eigen::Index i = 0; i < n; ++i) {
      Sigma.block(d * i, d * k, d, d) = positions[static_cast<std::size_t>(i)].G *
                                        column.middleRows(tangent * i, tangent) * to.G.transpose();
    }
  }
  const Eigen::MatrixXd Q = rigid_directions(positions);
  const double aligned = Sigma.trace() - (Q.transpose() * Sigma * Q).trace();
  return std::sqrt(std::max(0.0, aligned) / static_cast<double>(n));
}

}  // namespace cairn
