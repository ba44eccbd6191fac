// SPDX-License-Identifier: BSD-3-Clause
// Landmarks of a compact graph.
#include <array>
#include <tuple>
#include <utility>

#include "cairn/geometry/pose.hpp"
#include "cairn/runtime/timed.hpp"
#include "compact_graph.hpp"

namespace cairn::compact {

using Eigen::MatrixXd;

const VariableType* CompactGraph::landmark(Id id) const {
  const auto found = landmark_types_.find(id);
  return found == landmark_types_.end() ? nullptr : found->second.get();
}

void CompactGraph::note_landmark(Id id, std::shared_ptr<const VariableType> type) {
  landmarks_.push_back(id);
  landmark_types_.emplace(id, std::move(type));
}

MatrixXd CompactGraph::landmark_covariance(std::span<const Id> landmarks, PolicySeconds& seconds) {
  const MatrixXd S_nn = newest_covariance(seconds);
  const Timed timed(seconds.covariances);
  std::vector<Id> ids(landmarks.begin(), landmarks.end());
  ids.push_back(kept_[anchor_].id);
  Eigen::Index last = 0;
  for (const Id id : landmarks) last += landmark(id)->tangent_size();
  const Eigen::Index n = group_->tangent_size();
  MatrixXd joint(last + n, last + n);
  Eigen::Index column = 0;
  for (const Id id : landmarks) {
    const Eigen::Index size = landmark(id)->tangent_size();
    MatrixXd block(last + n, size);
    need_covariance(estimator_->covariance_column(
                        id, ids, {block.data(), static_cast<std::size_t>(block.size())}),
                    id);
    joint.block(0, column, last, size) = block.topRows(last);
    joint.block(last, column, n, size) = A_ * block.bottomRows(n);
    joint.block(column, last, size, n) = joint.block(last, column, n, size).transpose();
    column += size;
  }
  joint.bottomRightCorner(n, n) = S_nn;
  return joint;
}

MatrixXd CompactGraph::landmark_covariance(Id landmark, int pose, PolicySeconds& seconds) {
  update({}, seconds);
  const Timed timed(seconds.covariances);
  const std::array<Id, 2> ids{landmark, id(pose)};
  const Eigen::Index first = this->landmark(landmark)->tangent_size(), n = group_->tangent_size();
  MatrixXd joint(first + n, first + n);
  for (const auto& [of, column, size] :
       {std::tuple{ids[0], Eigen::Index{0}, first}, std::tuple{ids[1], first, n}}) {
    MatrixXd block(first + n, size);
    need_covariance(estimator_->covariance_column(
                        of, ids, {block.data(), static_cast<std::size_t>(block.size())}),
                    of);
    joint.middleCols(column, size) = block;
  }
  return joint;
}

void CompactGraph::see(std::vector<Variable> added, std::span<const Factor> factors,
                       PolicySeconds& seconds) {
  keep(seconds);
  update(factors, seconds, {}, std::move(added));
}

void CompactGraph::move_landmarks(const State& move, GraphUpdate& leaving,
                                  GraphUpdate& coming) const {
  const Pose by = group_->place(move).at;
  for (const Id id : landmarks_) {
    const std::shared_ptr<const VariableType>& type = landmark_types_.at(id);
    leaving.removed_variables.push_back(id);
    coming.variables.push_back(
        {.type = type, .id = id, .state = moved_point(*type, estimator_->state(id), by)});
  }
}

}  // namespace cairn::compact
