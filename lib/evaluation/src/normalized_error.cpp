// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/normalized_error.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/QR>

#include "cairn/geometry/pose.hpp"
#include "cairn/geometry/state_group.hpp"
#include "cairn/linear/linearizer.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/result_fields.hpp"
#include "dense/products.hpp"

namespace cairn {
namespace {

/// x_0 t_0⁻¹ t_v of each variable: the truth as seen from the estimate's first variable, a pose.
std::vector<std::vector<double>> moved_truth(const Graph& estimate, const Graph& truth) {
  std::vector<std::vector<double>> moved;
  std::vector<double> motion;
  for (int v = 0; v < estimate.variable_count(); ++v) {
    const VariableType& type = estimate.type(v);
    const bool landmark = v > 0 && is_point(type);
    if (!landmark && !(is_pose(type) && type.tag() == estimate.type(0).tag())) {
      throw Error(ErrorCode::usage,
                  "no normalised error: " + estimate.describe_variable(v) +
                      " is neither a pose of the first one's Lie group nor a landmark");
    }
    const auto other = truth.find(estimate.id(v));
    if (!other || truth.type(*other).tag() != type.tag()) {
      throw Error(ErrorCode::input,
                  "no normalised error: the truth has no " + estimate.describe_variable(v));
    }
    const auto true_state = truth.state(*other);
    if (landmark) {
      moved.push_back(moved_point(type, true_state, pose_of(estimate.type(0), motion)));
      continue;
    }
    const StateGroup group(type);
    if (v == 0) motion = group.compose(estimate.state(0), group.inverse(true_state));
    moved.push_back(group.compose(motion, true_state));
  }
  return moved;
}

}  // namespace

NormalizedError normalized_error(const Graph& estimate, const Graph& truth) {
  const std::vector<std::vector<double>> moved = moved_truth(estimate, truth);
  std::vector<bool> held(moved.size());
  for (int v = 0; v < estimate.variable_count(); ++v) held[v] = v == 0 || estimate.fixed(v);
  Linearizer linearizer(estimate, std::move(held));
  const BlockStructure& structure = linearizer.structure();
  NormalizedError result{.dof = static_cast<int>(structure.size())};
  if (result.dof == 0) return result;
  BlockMatrix H(structure);
  Eigen::VectorXd e(structure.size()), g(structure.size()), He(structure.size());
  const auto span = [](Eigen::VectorXd& x) { return std::span(x.data(), x.size()); };
  linearizer.linearize(estimate.values(), H, span(g));
  for (int v = 0; v < estimate.variable_count(); ++v) {
    const int block = linearizer.block_of(v);
    if (block < 0) continue;
    estimate.type(v).local(1, estimate.state(v).data(), moved[v].data(),
                           e.data() + structure.offsets()[block]);
  }
  H.multiply(span(e), span(He));
  result.squared = e.dot(He);
  return result;
}

namespace {

struct Position {
  Eigen::VectorXd t;  ///< [m]
  Eigen::MatrixXd G;  ///< its derivative by δ, dimension × tangent
};

Position linearized_position(const Graph& graph, int v) {
  const VariableType& type = graph.type(v);
  if (!has_position(type)) {
    throw Error(ErrorCode::usage,
                "no expected error: " + graph.describe_variable(v) + " has no position");
  }
  const int d = type.placement()->dimension();
  const std::vector<double> G = position_jacobian(type, graph.state(v));
  return {position(type, graph.state(v)).head(d),
          Eigen::Map<const Eigen::MatrixXd>(G.data(), d, type.tangent_size())};
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
  if (poses.empty()) return 0.0;
  const auto n = static_cast<Eigen::Index>(poses.size());
  std::vector<Position> positions;
  for (const Id id : poses) positions.push_back(linearized_position(graph, *graph.find(id)));
  const Eigen::Index d = positions.front().t.size(), tangent = positions.front().G.cols();
  const std::vector<double> joint = joint_covariance(estimator, poses, static_cast<int>(tangent));
  const Eigen::Map<const Eigen::MatrixXd> all(joint.data(), tangent * n, tangent * n);
  Eigen::MatrixXd Sigma(d * n, d * n);
  for (Eigen::Index k = 0; k < n; ++k) {
    for (Eigen::Index i = 0; i < n; ++i) {
      Sigma.block(d * i, d * k, d, d) = dense::product_with_transpose(
          dense::product(positions[static_cast<std::size_t>(i)].G,
                         all.block(tangent * i, tangent * k, tangent, tangent)),
          positions[static_cast<std::size_t>(k)].G);
    }
  }
  const Eigen::MatrixXd Q = rigid_directions(positions);
  const Eigen::MatrixXd seen = dense::product_of_transpose(Q, Sigma);
  const double aligned = Sigma.trace() - (seen * Q).trace();
  return std::sqrt(std::max(0.0, aligned) / static_cast<double>(n));
}

std::vector<Id> evenly_spread(std::span<const Id> ids) {
  constexpr std::size_t kMost = 40;
  std::vector<Id> some;
  const std::size_t count = std::min(kMost, ids.size());
  for (std::size_t k = 1; k <= count; ++k) some.push_back(ids[k * ids.size() / count - 1]);
  return some;
}

ResultFields<NormalizedError> NormalizedError::fields() {
  using E = NormalizedError;
  return ResultFields<E>()
      .figure("squared", &E::squared, "e^T Sigma^-1 e, its mean being dof where Sigma is right")
      .figure("dof", &E::dof, "degrees of freedom")
      .details();
}

}  // namespace cairn
