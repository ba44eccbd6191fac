// SPDX-License-Identifier: BSD-3-Clause
// Landmarks, and measurements of them, that leave the graph again since with them the estimate has
// no covariance: a landmark that has moved so far away that its bearings say nothing of its
// distance, or one that the estimate has drawn to a pose that measured its bearing.
#include <algorithm>
#include <array>
#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "cairn/runtime/timed.hpp"
#include "compact_graph.hpp"
#include "dense/cholesky.hpp"
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

}  // namespace

std::vector<CompactGraph::LeftOut> CompactGraph::take_left_out() {
  return std::exchange(left_out_, {});
}

bool CompactGraph::has_covariance(Id id, Eigen::Index size) {
  MatrixXd block(size, size);
  return estimator_->covariance(id, id, {block.data(), static_cast<std::size_t>(block.size())}) &&
         block.allFinite();
}

/// Whether the estimate has a covariance of every pose and landmark; where the estimator does not
/// keep them, of those that were measured. `gone`: poses that have left it already.
bool CompactGraph::determined(std::span<const Id> measured, const std::unordered_set<Id>& gone) {
  const std::set<Id> some(measured.begin(), measured.end());
  const auto asked = [&](Id id) { return keeps_covariances_ || some.contains(id); };
  const Eigen::Index n = group_->tangent_size();
  for (int pose = 0; pose < solved_; ++pose) {
    if (asked(id(pose)) && !gone.contains(id(pose)) && !has_covariance(id(pose), n)) return false;
  }
  return std::ranges::all_of(landmarks_, [&](Id id) {
    return !asked(id) || has_covariance(id, landmark(id)->tangent_size());
  });
}

/// Relinearises and solves everything. Whether the estimate is determined now.
bool CompactGraph::solved_anew(std::span<const Id> measured) {
  return estimator_->update({}, {.full = true}).ok && determined(measured);
}

/// What poses of the graph measured of each landmark.
std::map<Id, std::vector<CompactGraph::LandmarkFactor>> CompactGraph::landmark_factors() const {
  std::map<Id, std::vector<LandmarkFactor>> all;
  for (const FactorId id : estimator_->factors()) {
    Factor factor = estimator_->factor(id);
    if (factor.variables.size() != 2) continue;
    Id pose = factor.variables[0], of = factor.variables[1];
    if (landmark(pose)) std::swap(pose, of);
    if (landmark(of) && find(pose) >= 0) all[of].push_back({id, pose, std::move(factor)});
  }
  return all;
}

/// The numbers of those that are not linear at the estimate, over what all of them leave uncertain
/// of the landmark while the poses are held; all of them if the others do not determine it.
std::vector<std::size_t> CompactGraph::not_linear(Id of,
                                                  std::span<const LandmarkFactor> factors) const {
  const VariableType& type = *landmark(of);
  const std::span<const double> state = landmark_state(of);
  std::vector<std::vector<Measured>> measured;
  std::vector<ObservationRows> rows;
  MatrixXd Lambda = MatrixXd::Zero(type.tangent_size(), type.tangent_size());
  for (const LandmarkFactor& one : factors) {
    std::array<const VariableType*, 2> types{&group_->motions().type(), &type};
    if (one.factor.variables.front() == of) std::swap(types[0], types[1]);
    measured.push_back({Measured(one.factor, types, "a measurement of a landmark")});
    rows.push_back(
        linearized(measured.back(), one.pose, this->state(find(one.pose)).data(), state.data()));
    Lambda += rows.back().J_landmark.transpose() * rows.back().J_landmark;
  }
  const std::optional<MatrixXd> S = inverse(Lambda);
  std::vector<std::size_t> all, some;
  MatrixXd rest = MatrixXd::Zero(Lambda.rows(), Lambda.cols());
  for (std::size_t k = 0; k < factors.size(); ++k) {
    all.push_back(k);
    const LandmarkView view{type, state, measured[k], factors[k].pose,
                            this->state(find(factors[k].pose))};
    if (S && nonlinearity(view, rows[k], *S) <= kMostNonlinear) {
      rest += rows[k].J_landmark.transpose() * rows[k].J_landmark;
    } else {
      some.push_back(k);
    }
  }
  return some.empty() || inverse(rest) ? some : all;
}

/// Takes them out; the landmark with them, if there are no others.
void CompactGraph::leave_out(Id of, std::span<const LandmarkFactor> factors, bool with_landmark) {
  LeftOut left{.landmark = {.type = landmark_types_.at(of), .id = of, .state = {}},
               .removed = with_landmark,
               .factors = {}};
  GraphUpdate update;
  for (const LandmarkFactor& one : factors) {
    update.removed_factors.push_back(one.id);
    left.factors.emplace_back(one.pose, one.factor);
  }
  if (with_landmark) update.removed_variables.push_back(of);
  estimator_->update(update, {.defer = true});
  left_out_.push_back(std::move(left));
  if (!with_landmark) return;
  std::erase(landmarks_, of);
  landmark_types_.erase(of);
}

/// Those of these that are landmarks.
void CompactGraph::leave_out(std::span<const Id> landmarks) {
  std::map<Id, std::vector<LandmarkFactor>> all = landmark_factors();
  for (const Id id : landmarks) {
    if (landmark(id)) leave_out(id, all[id], true);
  }
}

void CompactGraph::release(std::span<const Id> landmarks, PolicySeconds& seconds) {
  update({}, seconds);
  const Timed timed(seconds.estimate);
  leave_out(landmarks);
  estimator_->update({});
  copy_.reset();
  refresh();
}

/// After an update that has left variables without a covariance; `measured`: what its factors are
/// on. Mostly it is enough to relinearise: on its way to the estimate a landmark came close to a
/// pose. If not, what is not linear leaves; if that is not it, the landmarks that were measured
/// last; and if that is not it either, as where false measurements have moved everything, all
/// landmarks: odometry determines the poses.
void CompactGraph::restore_covariances(std::span<const Id> measured) {
  if (solved_anew(measured)) return;
  bool any = false;
  for (const auto& [id, factors] : landmark_factors()) {
    const std::vector<std::size_t> places = not_linear(id, factors);
    if (places.empty()) continue;
    std::vector<LandmarkFactor> leaving;
    for (const std::size_t place : places) leaving.push_back(factors[place]);
    leave_out(id, leaving, leaving.size() == factors.size());
    any = true;
  }
  if (any && solved_anew(measured)) return;
  leave_out(measured);
  if (solved_anew(measured)) return;
  leave_out(std::vector<Id>(landmarks_));
  (void)solved_anew(measured);
}

}  // namespace cairn::compact
