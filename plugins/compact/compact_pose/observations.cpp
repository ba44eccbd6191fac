// SPDX-License-Identifier: BSD-3-Clause
#include "observations.hpp"

#include <string>
#include <utility>

#include <fmt/core.h>

#include "cairn/graph/id_text.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/cholesky.hpp"

namespace cairn::compact {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

[[noreturn]] void refuse(const std::string& message) { throw Error(ErrorCode::input, message); }

/// The state of the landmarks and the pose as a Kalman filter has it: N(mean, covariance) of what
/// they are away from where the observations were linearised.
class LocalFilter {
 public:
  LocalFilter(std::span<const int> landmark_sizes, MatrixXd covariance)
      : covariance_(std::move(covariance)), mean_(VectorXd::Zero(covariance_.rows())) {
    Eigen::Index at = 0;
    for (const int size : landmark_sizes) {
      offset_.push_back(at);
      at += size;
    }
    pose_ = at;
  }

  MeasuredFit fit(const ObservationRows& observation) const {
    const MatrixXd SJ = cross(observation);
    MatrixXd J(observation.e.size(), observation.J_pose.cols() + observation.J_landmark.cols());
    J << observation.J_pose, observation.J_landmark;
    return compare(residual(observation), rows_of(observation, SJ), J);
  }

  /// Of the landmark and, after it, the pose.
  MatrixXd joint(const ObservationRows& s) const {
    const Eigen::Index own = s.J_landmark.cols(), n = s.J_pose.cols();
    MatrixXd both(own + n, own + n);
    const auto at = [&](bool pose) { return pose ? pose_ : offset_[s.landmark]; };
    for (const bool row : {false, true}) {
      for (const bool column : {false, true}) {
        both.block(row ? own : 0, column ? own : 0, row ? n : own, column ? n : own) =
            covariance_.block(at(row), at(column), row ? n : own, column ? n : own);
      }
    }
    return both;
  }

  void use(const ObservationRows& observation) {
    const MatrixXd SJ = cross(observation);
    MatrixXd V = rows_of(observation, SJ);
    V.diagonal().array() += 1.0;
    const Eigen::LLT<MatrixXd> llt(V);
    mean_ -= SJ * llt.solve(residual(observation));
    covariance_ -= SJ * llt.solve(MatrixXd(SJ.transpose()));
  }

 private:
  /// Σ Jᵀ
  MatrixXd cross(const ObservationRows& s) const {
    return covariance_.middleCols(pose_, s.J_pose.cols()) * s.J_pose.transpose() +
           covariance_.middleCols(offset_[s.landmark], s.J_landmark.cols()) *
               s.J_landmark.transpose();
  }
  /// J times that.
  MatrixXd rows_of(const ObservationRows& s, const MatrixXd& SJ) const {
    return s.J_pose * SJ.middleRows(pose_, s.J_pose.cols()) +
           s.J_landmark * SJ.middleRows(offset_[s.landmark], s.J_landmark.cols());
  }
  VectorXd residual(const ObservationRows& s) const {
    return s.e + s.J_pose * mean_.segment(pose_, s.J_pose.cols()) +
           s.J_landmark * mean_.segment(offset_[s.landmark], s.J_landmark.cols());
  }

  std::vector<Eigen::Index> offset_;
  Eigen::Index pose_ = 0;
  MatrixXd covariance_;
  VectorXd mean_;
};

}  // namespace

std::vector<ObservationFit> choose_observations(std::span<const ObservationRows> observations,
                                                std::span<const int> landmark_sizes,
                                                MatrixXd covariance, double least_gain,
                                                const MayUse& may_use) {
  LocalFilter filter(landmark_sizes, std::move(covariance));
  std::vector<ObservationFit> chosen(observations.size());
  for (;;) {
    std::size_t best = observations.size();
    for (std::size_t k = 0; k < observations.size(); ++k) {
      ObservationFit& one = chosen[k];
      if (one.used) continue;
      one.fit = filter.fit(observations[k]);
      one.informative = one.fit.gain > least_gain;
      const bool better = best == observations.size() || one.fit.gain > chosen[best].fit.gain;
      if (!one.informative || !better) continue;
      if (!may_use.fits(one.fit)) continue;
      one.linear = may_use.linear(k, filter.joint(observations[k]));
      if (one.linear) best = k;
    }
    if (best == observations.size()) return chosen;
    filter.use(observations[best]);
    chosen[best].used = true;
  }
}

ObservationRows linearized(std::span<const Measured> factors, Id pose, const double* x,
                           const double* landmark) {
  ObservationRows all;
  for (const Measured& factor : factors) {
    const bool from_pose = factor.factor().variables.front() == pose;
    const double* const states[] = {from_pose ? x : landmark, from_pose ? landmark : x};
    const Measured::Linear one = factor.at(states);
    const MatrixXd &J_pose = one.J[from_pose ? 0 : 1], &J_landmark = one.J[from_pose ? 1 : 0];
    const Eigen::Index old = all.e.size(), rows = old + one.residual.size();
    all.e.conservativeResize(rows);
    all.J_pose.conservativeResize(rows, J_pose.cols());
    all.J_landmark.conservativeResize(rows, J_landmark.cols());
    all.e.tail(rows - old) = one.residual;
    all.J_pose.bottomRows(rows - old) = J_pose;
    all.J_landmark.bottomRows(rows - old) = J_landmark;
  }
  return all;
}

Measured checked_observation(const Factor& factor, Id pose, const VariableType& pose_type,
                             const Variable& landmark) {
  if (!factor.type) refuse("a measurement of a landmark without a type");
  const std::string name = fmt::format("{} of landmark {} from pose {}", factor.type->tag(),
                                       id_text(landmark.id), id_text(pose));
  const bool from_pose = factor.variables == std::vector<Id>{pose, landmark.id};
  if (!from_pose && factor.variables != std::vector<Id>{landmark.id, pose})
    refuse(name + " is not on these two");
  const VariableType* types[] = {&pose_type, landmark.type.get()};
  if (!from_pose) std::swap(types[0], types[1]);
  return {factor, types, name};
}

LandmarkReport report_of(Id pose, Id landmark, std::size_t factors, const ObservationFit& fit) {
  return {.pose = pose,
          .landmark = landmark,
          .factors = static_cast<int>(factors),
          .gain = fit.fit.gain,
          .innovation = fit.fit.innovation,
          .verdict = fit.used           ? LinkVerdict::linked
                     : !fit.informative ? LinkVerdict::uninformative
                     : fit.linear       ? LinkVerdict::inconsistent
                                        : LinkVerdict::nonlinear};
}

}  // namespace cairn::compact
