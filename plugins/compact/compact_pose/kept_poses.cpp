// SPDX-License-Identifier: BSD-3-Clause
#include "kept_poses.hpp"

#include <utility>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"

namespace cairn::compact {

void need_covariance(bool there, Id id) {
  if (there) return;
  throw Error(
      ErrorCode::numerical,
      fmt::format("there is no covariance of {} to judge measurements by: the measurements do not "
                  "determine it, or rounding takes its digits, as on a long trajectory without "
                  "loop closures whose steps are far more accurate than its headings",
                  id));
}

Ahead compose(const RigidGroup& group, const Ahead& ahead, const Motion& motion) {
  const State z = group.state(motion.mean);
  Matrix S = to_matrix(motion.covariance, group.tangent_size());
  if (ahead.covariance.size() == 0) return {z, S};
  const Matrix A = group.adjoint(group.inverse(z));
  S += A * ahead.covariance * A.transpose();
  return {group.compose(ahead.mean, z), S};
}

void KeptPoses::set_group(std::unique_ptr<RigidGroup> group) {
  index_ = std::make_unique<PoseIndex>(group->dimension());
  group_ = std::move(group);
}

std::vector<Id> KeptPoses::ids() const {
  std::vector<Id> ids;
  for (const Kept& pose : kept_) ids.push_back(pose.id);
  return ids;
}

int KeptPoses::find(Id id) const {
  const auto place = number_.find(id);
  return place == number_.end() ? -1 : place->second;
}

void KeptPoses::add(Id id) {
  number_.emplace(id, size());
  kept_.push_back({id, group_->place(group_->state(estimator_->state(id)))});
  index_->add(kept_.back().placed.at.t);
}

void KeptPoses::add(Coming pose, const PlacedState& placed) {
  number_.emplace(pose.variable.id, size());
  kept_.push_back({pose.variable.id, placed});
  index_->add(placed.at.t);
  coming_.push_back(std::move(pose));
}

void KeptPoses::renumber(std::span<const int> now) {
  std::erase_if(kept_, [&, k = 0](const Kept&) mutable { return now[k++] < 0; });
  number_.clear();
  index_ = std::make_unique<PoseIndex>(group_->dimension());
  for (int k = 0; k < size(); ++k) {
    number_.emplace(id(k), k);
    index_->add(placed(k).at.t);
  }
}

void KeptPoses::read_states() {
  for (int k = 0; k < size(); ++k) {
    kept_[k].placed = group_->place(group_->state(estimator_->state(id(k))));
    index_->move(k, kept_[k].placed.at.t);
  }
}

const Ahead& KeptPoses::ahead(int pose) const {
  static const Ahead kNone;
  return pose < solved() ? kNone : coming_[pose - solved()].ahead;
}

GraphUpdate KeptPoses::odometry_from(int first) const {
  GraphUpdate update;
  for (int k = first; k < size(); ++k) {
    const Coming& pose = coming_[k - solved()];
    Variable& variable = update.variables.emplace_back(pose.variable);
    if (!variable.fixed || variable.state.empty()) {
      const auto state = group_->view(this->state(k));
      variable.state.assign(state.begin(), state.end());
    }
    update.factors.push_back(pose.odometry);
  }
  return update;
}

UpdateReport KeptPoses::update(const GraphUpdate& update, const UpdateOptions& options) {
  const UpdateReport report = estimator_->update(update, options);
  copy_ = {};
  coming_.clear();
  return report;
}

Estimator& KeptPoses::whole() {
  if (coming_.empty()) return *estimator_;
  if (!copy_.estimator) copy_ = {estimator_->clone(), solved()};
  if (copy_.poses < size())
    copy_.estimator->update(odometry_from(std::exchange(copy_.poses, size())));
  return *copy_.estimator;
}

Matrix KeptPoses::covariance(int i, int k) const {
  Matrix S(group_->tangent_size(), group_->tangent_size());
  need_covariance(
      estimator_->covariance(id(i), id(k), {S.data(), static_cast<std::size_t>(S.size())}), id(k));
  return S;
}

Displacement KeptPoses::between(int i, int k) const {
  Displacement d = group_->displacement(placed(i), placed(k));
  group_->set_covariance(covariance(i, i), covariance(i, k), covariance(k, k), d);
  return d;
}

}  // namespace cairn::compact
