// SPDX-License-Identifier: BSD-3-Clause
#include "graph_landmarks.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <set>
#include <utility>

#include "dense/eigenvalues.hpp"
#include "linearity.hpp"
#include "measured.hpp"
#include "observations.hpp"

namespace cairn::compact {
namespace {

using Eigen::MatrixXd;

/// A part of the largest eigenvalue: less is nothing.
constexpr double kNothing = 1e-12;

/// Λ⁻¹; nothing: it is singular, or not a number.
std::optional<MatrixXd> inverse(const MatrixXd& Lambda) {
  if (!Lambda.allFinite()) return std::nullopt;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(Lambda);
  const Eigen::VectorXd values = solver.eigenvalues();
  if (!(values.minCoeff() > kNothing * values.maxCoeff())) return std::nullopt;
  return MatrixXd(solver.eigenvectors() * values.cwiseInverse().asDiagonal() *
                  solver.eigenvectors().transpose());
}

bool has_covariance(Estimator& estimator, Id id, Eigen::Index size) {
  MatrixXd block(size, size);
  return estimator.covariance(id, id, {block.data(), static_cast<std::size_t>(block.size())}) &&
         block.allFinite();
}

}  // namespace

const VariableType* GraphLandmarks::type(Id id) const {
  const auto found = types_.find(id);
  return found == types_.end() ? nullptr : found->second.get();
}

void GraphLandmarks::add(Id id, std::shared_ptr<const VariableType> type) {
  ids_.push_back(id);
  types_.emplace(id, std::move(type));
}

bool GraphLandmarks::determined(std::span<const Id> measured, const KeptPoses& poses,
                                const std::unordered_set<Id>& gone) const {
  const std::set<Id> some(measured.begin(), measured.end());
  const auto asked = [&](Id id) { return keeps_all_ || some.contains(id); };
  const Eigen::Index n = poses.group()->tangent_size();
  for (int pose = 0; pose < poses.solved(); ++pose) {
    const Id id = poses.id(pose);
    if (asked(id) && !gone.contains(id) && !has_covariance(poses.estimator(), id, n)) return false;
  }
  return std::ranges::all_of(ids_, [&](Id id) {
    return !asked(id) || has_covariance(poses.estimator(), id, type(id)->tangent_size());
  });
}

/// Relinearises and solves everything. Whether the estimate is determined now.
bool GraphLandmarks::solved_anew(std::span<const Id> measured, KeptPoses& poses) const {
  return poses.update({}, {.full = true}).ok && determined(measured, poses);
}

/// What poses of the graph measured of each landmark.
std::map<Id, std::vector<GraphLandmarks::Measurement>> GraphLandmarks::measurements(
    const KeptPoses& poses) const {
  std::map<Id, std::vector<Measurement>> all;
  for (const FactorId id : poses.estimator().factors()) {
    Factor factor = poses.estimator().factor(id);
    if (factor.variables.size() != 2) continue;
    Id pose = factor.variables[0], of = factor.variables[1];
    if (type(pose)) std::swap(pose, of);
    if (type(of) && poses.find(pose) >= 0) all[of].push_back({id, pose, std::move(factor)});
  }
  return all;
}

/// The numbers of those that are not linear at the estimate, over what all of them leave uncertain
/// of the landmark while the poses are held; all of them if the others do not determine it.
std::vector<std::size_t> GraphLandmarks::not_linear(Id of, std::span<const Measurement> measured,
                                                    const KeptPoses& poses) const {
  const VariableType& type = *this->type(of);
  const std::span<const double> state = poses.estimator().state(of);
  std::vector<std::vector<Measured>> factors;
  std::vector<ObservationRows> rows;
  MatrixXd Lambda = MatrixXd::Zero(type.tangent_size(), type.tangent_size());
  for (const Measurement& one : measured) {
    std::array<const VariableType*, 2> types{&poses.group()->motions().type(), &type};
    if (one.factor.variables.front() == of) std::swap(types[0], types[1]);
    factors.push_back({Measured(one.factor, types, "a measurement of a landmark")});
    rows.push_back(linearized(factors.back(), one.pose, poses.state(poses.find(one.pose)).data(),
                              state.data()));
    Lambda += rows.back().J_landmark.transpose() * rows.back().J_landmark;
  }
  const std::optional<MatrixXd> S = inverse(Lambda);
  std::vector<std::size_t> all, some;
  MatrixXd rest = MatrixXd::Zero(Lambda.rows(), Lambda.cols());
  for (std::size_t k = 0; k < measured.size(); ++k) {
    all.push_back(k);
    const Id pose = measured[k].pose;
    const LandmarkView view{type, state, factors[k], pose, poses.state(poses.find(pose))};
    if (S && nonlinearity(view, rows[k], *S) <= kMostNonlinear) {
      rest += rows[k].J_landmark.transpose() * rows[k].J_landmark;
    } else {
      some.push_back(k);
    }
  }
  return some.empty() || inverse(rest) ? some : all;
}

/// Takes them out; the landmark with them, if there are no others.
void GraphLandmarks::leave_out(Id of, std::span<const Measurement> measured, bool with_landmark,
                               KeptPoses& poses) {
  LeftOut left{.landmark = {.type = types_.at(of), .id = of, .state = {}},
               .removed = with_landmark,
               .factors = {}};
  GraphUpdate update;
  for (const Measurement& one : measured) {
    update.removed_factors.push_back(one.id);
    left.factors.emplace_back(one.pose, one.factor);
  }
  if (with_landmark) update.removed_variables.push_back(of);
  poses.update(update, {.defer = true});
  left_out_.push_back(std::move(left));
  if (!with_landmark) return;
  std::erase(ids_, of);
  types_.erase(of);
}

void GraphLandmarks::leave_out(std::span<const Id> landmarks, KeptPoses& poses) {
  std::map<Id, std::vector<Measurement>> all = measurements(poses);
  for (const Id id : landmarks) {
    if (type(id)) leave_out(id, all[id], true, poses);
  }
}

/// Whether there was anything.
bool GraphLandmarks::leave_out_not_linear(KeptPoses& poses) {
  bool any = false;
  for (const auto& [id, measured] : measurements(poses)) {
    std::vector<Measurement> leaving;
    for (const std::size_t place : not_linear(id, measured, poses))
      leaving.push_back(measured[place]);
    if (leaving.empty()) continue;
    leave_out(id, leaving, leaving.size() == measured.size(), poses);
    any = true;
  }
  return any;
}

void GraphLandmarks::restore_covariances(std::span<const Id> measured, KeptPoses& poses) {
  if (solved_anew(measured, poses)) return;
  if (leave_out_not_linear(poses) && solved_anew(measured, poses)) return;
  leave_out(measured, poses);
  if (solved_anew(measured, poses)) return;
  leave_out(std::vector<Id>(ids_), poses);
  (void)solved_anew(measured, poses);
}

void GraphLandmarks::move(const Pose& by, const KeptPoses& poses, GraphUpdate& leaving,
                          GraphUpdate& coming) const {
  for (const Id id : ids_) {
    const std::shared_ptr<const VariableType>& type = types_.at(id);
    leaving.removed_variables.push_back(id);
    coming.variables.push_back(
        {.type = type, .id = id, .state = moved_point(*type, poses.estimator().state(id), by)});
  }
}

}  // namespace cairn::compact
