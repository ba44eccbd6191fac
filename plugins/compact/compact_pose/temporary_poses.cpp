// SPDX-License-Identifier: BSD-3-Clause
#include "temporary_poses.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "cairn/types/loss.hpp"
#include "measured.hpp"

namespace cairn::compact {
namespace {

/// So many are waited for to make the oldest one's loss small.
constexpr std::size_t kMostTemporary = 24;

LinearFactor linear_factor(FactorId id, Factor factor, Estimator& estimator) {
  std::vector<std::shared_ptr<const VariableType>> types;
  std::vector<const VariableType*> plain;
  std::vector<const double*> states;
  for (const Id on : factor.variables) {
    types.push_back(estimator.type(on));
    plain.push_back(types.back().get());
    states.push_back(estimator.state(on).data());
  }
  Measured::Linear linear = Measured(factor, plain, "a factor").at(states);
  if (factor.loss) {
    const double squared = linear.residual.squaredNorm();
    double weight = 1.0;
    factor.loss->evaluate({&squared, 1}, {}, {&weight, 1});
    for (Eigen::MatrixXd& J : linear.J) J *= std::sqrt(weight);
  }
  return {id, std::move(factor), std::move(linear.J)};
}

/// Whether the odometry of a pose can be joined: it came from a pose of the graph, and went on to
/// one.
bool joins(Id pose, std::span<const LinearFactor> factors) {
  return std::ranges::count_if(factors, [&](const LinearFactor& f) {
           return f.factor.type->is_relative() && f.is_on(pose);
         }) == 2;
}

}  // namespace

bool TemporaryPoses::contains(Id pose) const {
  return std::ranges::find(poses_, pose, &Temporary::id) != poses_.end();
}

void TemporaryPoses::add_newest(const KeptPoses& poses) {
  const int newest = poses.size() - 1;
  poses_.push_back({poses.id(newest), newest < poses.solved() ? latest_factors_ : kComing});
  // Where no landmark is seen none is judged, and judging many takes the cube of their number.
  while (poses_.size() > kMostTemporary + 1) poses_.erase(poses_.begin());
}

void TemporaryPoses::remove(Id pose) {
  std::erase_if(poses_, [&](const Temporary& t) { return t.id == pose; });
}

void TemporaryPoses::note_factors(FactorId first) {
  latest_factors_ = first;
  for (Temporary& pose : poses_) pose.since = std::min(pose.since, first);
}

void TemporaryPoses::forget_factors() {
  for (Temporary& pose : poses_) pose.since = 0;
}

std::vector<LinearFactor> TemporaryPoses::factors(Estimator& estimator) const {
  std::vector<LinearFactor> incident;
  const FactorId since = std::ranges::min(poses_, {}, &Temporary::since).since;
  const std::vector<FactorId> all = estimator.factors();
  for (auto f = std::ranges::lower_bound(all, since); f != all.end(); ++f) {
    Factor factor = estimator.factor(*f);
    if (std::ranges::any_of(factor.variables, [&](Id id) { return contains(id); }))
      incident.push_back(linear_factor(*f, std::move(factor), estimator));
  }
  return incident;
}

std::optional<TemporaryPoses::Leaving> TemporaryPoses::judge(const Conditions& conditions,
                                                             const KeptPoses& poses) {
  std::erase_if(poses_, [&](const Temporary& pose) { return poses.find(pose.id) < 0; });
  while (!poses_.empty() && !conditions.followed(poses_.front().id)) {
    const Id oldest = poses_.front().id, newest = poses.id(poses.size() - 1);
    const bool many = poses_.size() > kMostTemporary;
    if (!many && conditions.needed(oldest)) break;
    std::vector<LinearFactor> factors = this->factors(poses.estimator());
    LeavingPoses leaving;
    for (const Temporary& one : poses_) {
      if (one.id != newest) leaving.others.push_back(one.id);
    }
    if (poses_.back().id == newest) leaving.newest = newest;
    const auto loss = [&](Id pose, bool all) {
      return information_loss(pose, all, leaving, factors, poses.group()->tangent_size(),
                              poses.estimator());
    };
    const InformationLoss cut = loss(oldest, true);
    const bool known = cut.newest <= conditions.most.newest;
    if (!known && !many) break;
    const Id pose = known || joins(oldest, factors) ? oldest : poses_[1].id;
    if (conditions.followed(pose)) break;
    if (const std::optional<Id> cover = conditions.cover(poses.find(pose))) {
      const bool with_all = known && cut.map <= conditions.most.map;
      if (with_all || (joins(pose, factors) && loss(pose, false).map <= conditions.most.map))
        return Leaving{pose, *cover, !with_all, std::move(factors)};
    }
    remove(pose);
  }
  return std::nullopt;
}

}  // namespace cairn::compact
