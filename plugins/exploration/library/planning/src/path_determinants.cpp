// SPDX-License-Identifier: BSD-3-Clause
#include "path_determinants.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace cairn {
namespace {

using Eigen::Matrix3d;

constexpr int kLanes = PoseCovariances::kLanes;

/// Entries of a block, and of the lower triangle of a symmetric one.
constexpr std::size_t kEntries = 9, kTriangle = 6;

}  // namespace

PathDeterminants::PathDeterminants(const Situation& situation, double loop_gain, CanMatch can_match)
    : covariances_(situation, situation.pose),
      can_match_(std::move(can_match)),
      match_(situation.match),
      odometry_(situation.robot.odometry),
      index_(covariances_.poses(), situation.pose, situation.match),
      update_(choose_partner_kernel()),
      newest_(covariances_.diagonal(covariances_.size() - 1)),
      to_robot_(Matrix3d::Zero()),
      robot_(situation.pose),
      log_match_(std::log(match_.covariance().determinant())),
      least_determinant_(std::exp(log_match_ + 2.0 * match_.loop_gain_unless(loop_gain))),
      partner_of_(situation.poses.size(), -1) {
  if (const auto since = motion_since_newest(situation))
    to_robot_ = covariances_.moved(robot_, odometry_.covariance(*since));
}

PathDeterminants::Path PathDeterminants::along(std::span<const Pose2> motions) {
  Path path;
  walk(motions, path);
  find_partners();
  Matrix3d posterior = newest_ + to_robot_;
  for (std::size_t k = 0; k < steps_.size(); ++k) {
    const Step& step = steps_[k];
    posterior += step.noise;
    const Choice choice = best_choice(step, posterior);
    if (choice.partner < 0) continue;
    ++path.loops;
    path.log_determinant += std::log(choice.determinant) - log_match_;
    const int ahead = k + 1 < steps_.size() ? steps_[k + 1].partners_from_here : 0;
    close(choice, step, ahead, posterior);
  }
  return path;
}

/// The poses of the path, and those of the graph that they can be matched with.
void PathDeterminants::walk(std::span<const Pose2> motions, Path& path) {
  steps_.clear();
  matches_.clear();
  Pose2 pose = robot_;
  Matrix3d sum = to_robot_;
  for (const Pose2& motion : motions) {
    pose = pose * motion;
    path.length += motion.translation().norm();
    const Matrix3d Q = odometry_.covariance(motion);
    path.log_determinant -= std::log(Q.determinant());
    const Matrix3d noise = covariances_.moved(pose, Q);
    sum += noise;
    Step step{.pose = pose, .walk = sum, .noise = noise};
    step.first = static_cast<int>(matches_.size());
    index_.for_each(pose, [&](int l) {
      if (!can_match_ || can_match_(covariances_.pose(l), pose)) matches_.push_back(l);
    });
    step.count = static_cast<int>(matches_.size()) - step.first;
    steps_.push_back(step);
  }
}

/// Numbers the partners from the path's end on, so that those which are still ahead are the first.
void PathDeterminants::find_partners() {
  pose_of_.clear();
  for (auto step = steps_.rbegin(); step != steps_.rend(); ++step) {
    for (int& match : std::span(matches_).subspan(static_cast<std::size_t>(step->first),
                                                  static_cast<std::size_t>(step->count))) {
      int& partner = partner_of_[static_cast<std::size_t>(match)];
      if (partner < 0) {
        partner = static_cast<int>(pose_of_.size());
        pose_of_.push_back(match);
      }
      match = partner;
    }
    step->partners_from_here = static_cast<int>(pose_of_.size());
  }
  const std::size_t count = pose_of_.size();
  stride_ = static_cast<int>((count + kLanes - 1) / kLanes * kLanes);
  const auto stride = static_cast<std::size_t>(stride_);
  cross_.assign(kEntries * stride, 0.0);
  K_.assign(kEntries * stride, 0.0);
  S_.assign(kTriangle * stride, 0.0);
  innovation_.assign(kEntries * stride, 0.0);
  D_.clear();
  coupling_.clear();
  closures_ = 0;
  for (std::size_t p = 0; p < count; ++p) {
    const int l = pose_of_[p];
    partner_of_[static_cast<std::size_t>(l)] = -1;
    const Matrix3d cross = covariances_.block(l, covariances_.size() - 1).transpose();
    const Matrix3d S = newest_ + covariances_.diagonal(l) - cross - cross.transpose();
    std::size_t entry = 0, in_triangle = 0;
    for (int c = 0; c < 3; ++c) {
      for (int r = 0; r < 3; ++r, ++entry) {
        cross_[entry * stride + p] = cross(r, c);
        K_[entry * stride + p] = newest_(r, c) - cross(r, c);
        if (r >= c) S_[in_triangle++ * stride + p] = S(r, c);
      }
    }
  }
}

/// The closure that makes |Σ_kk| least, of those with enough gain.
PathDeterminants::Choice PathDeterminants::best_choice(const Step& step,
                                                       const Matrix3d& posterior) const {
  Choice best;
  if (step.count == 0) return best;
  const Matrix3d apart = step.walk + covariances_.moved(step.pose, match_.covariance());
  const Matrix3d now = posterior + covariances_.prior();
  double least = std::numeric_limits<double>::infinity();
  for (int m = step.first; m < step.first + step.count; ++m) {
    const int partner = matches_[static_cast<std::size_t>(m)];
    const double* entries = S_.data() + partner;
    Matrix3d S = apart;
    std::ptrdiff_t entry = 0;
    for (int c = 0; c < 3; ++c) {
      for (int r = c; r < 3; ++r, ++entry) {
        S(r, c) += entries[entry * stride_];
        if (r > c) S(c, r) = S(r, c);
      }
    }
    const double determinant = S.determinant();
    if (!(determinant > least_determinant_)) continue;
    const Matrix3d K = block(K_, partner) + step.walk;
    const double after = (now - K * S.inverse() * K.transpose()).determinant();
    if (!(after < least)) continue;
    least = after;
    best = {partner, determinant, S, K};
  }
  return best;
}

void PathDeterminants::close(const Choice& choice, const Step& step, int partners_ahead,
                             Matrix3d& posterior) {
  const Matrix3d L = Eigen::LLT<Matrix3d>(choice.S).matrixL();
  const Matrix3d inverse = L.triangularView<Eigen::Lower>().solve(Matrix3d::Identity());
  const Matrix3d end = inverse * choice.K.transpose();
  posterior -= end.transpose() * end;
  if (partners_ahead == 0) return;
  const auto stride = static_cast<std::size_t>(stride_),
             partner = static_cast<std::size_t>(choice.partner);
  // The row of L: cov(y, ·) of what is whitened already, which is Dᵀ of the partner.
  coupling_.resize(kEntries * static_cast<std::size_t>(closures_));
  for (std::size_t b = 0; b < static_cast<std::size_t>(closures_); ++b) {
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t r = 0; r < 3; ++r)
        coupling_[kEntries * b + 3 * c + r] = D_[(kEntries * b + 3 * r + c) * stride + partner];
    }
  }
  D_.resize(kEntries * static_cast<std::size_t>(closures_ + 1) * stride);
  const int count = (partners_ahead + kLanes - 1) / kLanes * kLanes;
  // cov(ε_k − ε_l, ε_j − ε_p) of a later pose j and its partner p: with Σ_tt and walk for ε_k, ε_j.
  const int l = pose_of_[partner];
  const double* column = covariances_.column(l);
  const Matrix3d own = newest_ + step.walk - block(cross_, choice.partner).transpose();
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t r = 0; r < 3; ++r) {
      const double* from = column + (3 * r + c) * static_cast<std::size_t>(covariances_.padded());
      const double* cross = cross_.data() + (3 * c + r) * stride;
      double* innovation = innovation_.data() + (3 * c + r) * stride;
      const double at = own(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c));
      for (std::size_t p = 0; p < static_cast<std::size_t>(partners_ahead); ++p)
        innovation[p] = at - cross[p] + from[pose_of_[p]];
    }
  }
  update_({.count = count,
           .stride = stride_,
           .closures = closures_,
           .innovation = innovation_.data(),
           .D_before = D_.data(),
           .coupling = coupling_.data(),
           .inverse = inverse.data(),
           .end = end.data(),
           .D = D_.data() + kEntries * static_cast<std::size_t>(closures_) * stride,
           .S = S_.data(),
           .K = K_.data()});
  ++closures_;
}

Matrix3d PathDeterminants::block(const std::vector<double>& entries, int partner) const {
  Matrix3d block;
  const double* from = entries.data() + partner;
  for (int entry = 0; entry < 9; ++entry)
    block.data()[entry] = from[static_cast<std::ptrdiff_t>(entry) * stride_];
  return block;
}

}  // namespace cairn
