// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/linear_constraint.hpp"

#include <algorithm>
#include <utility>

#include <fmt/core.h>
#include <Eigen/Core>

#include "cairn/geometry/pose.hpp"
#include "cairn/geometry/state_group.hpp"
#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/lu.hpp"
#include "dense/products.hpp"

namespace cairn {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// e, and its derivatives by a step of each node; where e_k depends on the root as well, that is in
/// `by_root`.
struct LinearConstraint::Coordinates {
  VectorXd e;
  std::vector<MatrixXd> by_own;  ///< of node k: rows of e_k × tangent
  MatrixXd by_root;              ///< all rows × tangent of the root
};

int LinearConstraint::coordinates_of(const Nodes& nodes) {
  const int poses = nodes.poses - (nodes.absolute_size > 0 ? 0 : 1);
  const int landmark = nodes.observation ? nodes.observation->tangent_size(1) : 0;
  return poses * nodes.pose->tangent_size() + nodes.landmarks * landmark;
}

LinearConstraint::LinearConstraint(Nodes nodes, int rank) : nodes_(std::move(nodes)), rank_(rank) {
  if (!nodes_.pose || !is_pose(*nodes_.pose) || nodes_.poses < 1)
    throw Error(ErrorCode::usage, "a linear constraint is on one pose at least");
  const FactorType* const of = nodes_.observation.get();
  if (nodes_.landmarks > 0 &&
      (!of || of->arity() != 2 || of->variable_tags()[0] != nodes_.pose->tag() ||
       of->residual_size() != of->tangent_size(1))) {
    throw Error(ErrorCode::usage,
                "a linear constraint on landmarks needs a factor that measures the whole position "
                "of one in the frame of a pose");
  }
  for (int k = 0; k < arity(); ++k) {
    tags_.push_back(is_landmark(k) ? of->variable_tags()[1] : nodes_.pose->tag());
    const bool measured = k > 0 || nodes_.absolute_size > 0;
    rows_.push_back(rows_.back() + (measured ? tangent_size(k) : 0));
    numbers_.push_back(numbers_.back() + (!measured        ? 0
                                          : is_landmark(k) ? of->measurement_size()
                                                           : ambient_size(k)));
  }
  if (rank_ < 1 || rank_ > coordinate_count()) {
    throw Error(ErrorCode::usage,
                fmt::format("a linear constraint of rank {} on nodes with {} coordinates{}: "
                            "expected 1 to as many",
                            rank_, coordinate_count(),
                            nodes_.absolute_size > 0 ? "" : " in the frame of the first"));
  }
  if (of) unit_ = pack(MatrixXd::Identity(of->residual_size(), of->residual_size()));
}

int LinearConstraint::tangent_size(int variable) const {
  return is_landmark(variable) ? nodes_.observation->tangent_size(1) : nodes_.pose->tangent_size();
}

int LinearConstraint::ambient_size(int variable) const {
  return is_landmark(variable) ? nodes_.observation->ambient_size(1) : nodes_.pose->ambient_size();
}

std::string LinearConstraint::normalize(double* measurement) const {
  for (int k = 0; k < arity(); ++k) {
    if (numbers_[k] == numbers_[k + 1]) continue;
    double* const z = measurement + numbers_[k];
    std::string problem =
        is_landmark(k) ? nodes_.observation->normalize(z) : nodes_.pose->normalize(z);
    if (!problem.empty()) return problem;
  }
  return {};
}

std::vector<double> LinearConstraint::measurement_at(const double* const* x,
                                                     std::span<const double> b,
                                                     std::span<const double> G) const {
  std::vector<double> z(static_cast<std::size_t>(measurement_size()));
  std::ranges::copy(b, z.begin() + numbers_.back());
  std::ranges::copy(G, z.begin() + numbers_.back() + rank_);
  const StateGroup group(*nodes_.pose);
  const auto of = [&](int k) {
    return StateGroup::View(x[k], static_cast<std::size_t>(ambient_size(k)));
  };
  if (nodes_.absolute_size > 0) std::ranges::copy(of(0), z.begin());
  for (int k = 1; k < nodes_.poses; ++k)
    std::ranges::copy(group.between(of(0), of(k)), z.begin() + numbers_[k]);
  const Pose root = pose_of(*nodes_.pose->placement(), x[0]);
  for (int k = nodes_.poses; k < arity(); ++k) {
    Eigen::Vector3d at = Eigen::Vector3d::Zero();
    std::copy_n(x[k], ambient_size(k), at.data());
    const Eigen::Vector3d seen = root.R.transpose() * (at - root.t);
    std::copy_n(seen.data(), numbers_[k + 1] - numbers_[k], z.begin() + numbers_[k]);
  }
  return z;
}

/// A step ε from x changes local(z, x) by D⁻¹ε (see `VariableType::retract_jacobian`); of
/// y = x_0⁻¹ x_k, a step δ_k is one of ε = δ_k, and δ_0 one of ε = −Ad(y⁻¹) δ_0.
LinearConstraint::Coordinates LinearConstraint::coordinates(const double* const* x,
                                                            const double* measurement,
                                                            bool with_jacobians) const {
  const int p = nodes_.pose->tangent_size();
  const StateGroup group(*nodes_.pose);
  const StateGroup::View root(x[0], static_cast<std::size_t>(ambient_size(0)));
  Coordinates at{VectorXd(coordinate_count()), std::vector<MatrixXd>(tags_.size()), {}};
  if (with_jacobians) at.by_root = MatrixXd::Zero(coordinate_count(), p);
  for (int k = 0; k < arity(); ++k) {
    const double* const z = measurement + numbers_[k];
    double* const e = at.e.data() + rows_[k];
    const int m = rows_[k + 1] - rows_[k];
    if (m == 0) continue;
    if (is_landmark(k)) {
      const double* const ends[] = {x[0], x[k]};
      MatrixXd by_pose(m, p);
      at.by_own[k].resize(m, m);
      double* const out[] = {by_pose.data(), at.by_own[k].data()};
      nodes_.observation->evaluate(ends, z, unit_.data(), e, with_jacobians ? out : nullptr);
      if (with_jacobians) at.by_root.middleRows(rows_[k], m) = by_pose;
      continue;
    }
    const StateGroup::State y =
        k == 0 ? group.state(root) : group.between(root, {x[k], root.size()});
    nodes_.pose->local(1, z, y.data(), e);
    if (!with_jacobians) continue;
    MatrixXd D(m, m);
    nodes_.pose->retract_jacobian(z, e, D.data());
    at.by_own[k] = D.inverse();
    if (k == 0) continue;
    at.by_root.middleRows(rows_[k], m) =
        -dense::product(at.by_own[k], group.adjoint(group.inverse(y)));
  }
  if (with_jacobians && nodes_.absolute_size > 0) at.by_root.topRows(p) = at.by_own[0];
  return at;
}

void LinearConstraint::evaluate(const double* const* x, const double* measurement,
                                const double* sqrt_information, double* residual,
                                double* const* jacobians) const {
  const Coordinates at = coordinates(x, measurement, jacobians != nullptr);
  const double* const b = measurement + numbers_.back();
  const Eigen::Map<const MatrixXd> G(b + rank_, rank_, coordinate_count());
  const MatrixXd whitening = unpack({sqrt_information, packed_size(rank_)}, rank_);
  const auto U = whitening.triangularView<Eigen::Upper>();
  Eigen::Map<VectorXd>(residual, rank_) =
      U * VectorXd(G * at.e - Eigen::Map<const VectorXd>(b, rank_));
  for (int k = 0; jacobians && k < arity(); ++k) {
    if (!jacobians[k]) continue;
    const auto own = G.middleCols(rows_[k], rows_[k + 1] - rows_[k]);
    Eigen::Map<MatrixXd>(jacobians[k], rank_, tangent_size(k)) =
        U * (k == 0 ? dense::product(G, at.by_root) : dense::product(own, at.by_own[k]));
  }
}

}  // namespace cairn
