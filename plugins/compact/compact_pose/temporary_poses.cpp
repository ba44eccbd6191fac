// SPDX-License-Identifier: BSD-3-Clause
// Poses that landmarks locate, in places where others stay: they are in the graph until what they
// measured adds little to it.
#include "temporary_poses.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "cairn/runtime/timed.hpp"
#include "cairn/types/loss.hpp"
#include "compact_graph.hpp"
#include "dense/cholesky.hpp"
#include "measured.hpp"

namespace cairn::compact {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// So many are waited for to make the oldest one's loss small.
constexpr std::size_t kMostTemporary = 24;

/// A variance that would grow by more than the inverse of this is one of something undetermined.
constexpr double kDetermined = 1e-9;

/// ln |I − A|; −∞ where that is not positive definite.
double log_determinant_of_rest(const MatrixXd& A) {
  const Eigen::LLT<MatrixXd> llt(MatrixXd(MatrixXd::Identity(A.rows(), A.cols()) - A));
  if (llt.info() != Eigen::Success) return -kInfinity;
  const Eigen::ArrayXd diagonal = llt.matrixLLT().diagonal();
  if ((diagonal.square() < kDetermined).any()) return -kInfinity;
  return 2.0 * diagonal.log().sum();
}

/// Variables in one vector.
class Places {
 public:
  void add(Id id, Index size) {
    if (first_.try_emplace(id, total_).second) {
      ids_.push_back(id);
      total_ += size;
    }
  }
  bool has(Id id) const { return first_.contains(id); }
  Index operator[](Id id) const { return first_.at(id); }
  Index total() const { return total_; }
  const std::vector<Id>& ids() const { return ids_; }

 private:
  std::map<Id, Index> first_;
  std::vector<Id> ids_;
  Index total_ = 0;
};

/// Σ of these variables, those that an information matrix on `places` has; zero for others.
MatrixXd block_of(const MatrixXd& S, const Places& places, const Places& of,
                  const std::function<Index(Id)>& size) {
  MatrixXd block = MatrixXd::Zero(of.total(), of.total());
  for (const Id a : of.ids()) {
    for (const Id b : of.ids()) {
      if (!places.has(a) || !places.has(b)) continue;
      block.block(of[a], of[b], size(a), size(b)) = S.block(places[a], places[b], size(a), size(b));
    }
  }
  return block;
}

}  // namespace

MatrixXd eliminate(const MatrixXd& J, Index count) {
  const MatrixXd own = J.leftCols(count), others = J.rightCols(J.cols() - count);
  const Eigen::LLT<MatrixXd> llt(MatrixXd(own.transpose() * own));
  return others - own * llt.solve(MatrixXd(own.transpose() * others));
}

double information_about(const MatrixXd& R, const MatrixXd& S, const MatrixXd& S_given) {
  const double all = log_determinant_of_rest(R * S * R.transpose());
  const double given = log_determinant_of_rest(R * S_given * R.transpose());
  // Where R alone determines anything, the difference is one of infinities, or of rounding.
  const double loss = 0.5 * (given - all);
  return std::isfinite(loss) ? std::max(0.0, loss) : kInfinity;
}

bool CompactGraph::temporary(int pose) const {
  return std::ranges::find(temporary_, id(pose), &Temporary::id) != temporary_.end();
}

void CompactGraph::make_temporary() {
  temporary_.push_back({kept_.back().id, solved_ == size() ? latest_factors_ : kComing});
  // Where no landmark is seen none is judged, and judging many takes the cube of their number.
  while (temporary_.size() > kMostTemporary + 1) temporary_.erase(temporary_.begin());
}

void CompactGraph::make_permanent(int pose) {
  std::erase_if(temporary_, [&](const Temporary& t) { return t.id == id(pose); });
}

std::vector<CompactGraph::IncidentFactor> CompactGraph::factors_of_temporary() {
  std::vector<IncidentFactor> incident;
  std::set<Id> poses;
  FactorId since = std::numeric_limits<FactorId>::max();
  for (const Temporary& one : temporary_) {
    poses.insert(one.id);
    since = std::min(since, one.since);
  }
  const std::vector<FactorId> all = estimator_->factors();
  for (auto f = std::ranges::lower_bound(all, since); f != all.end(); ++f) {
    Factor factor = estimator_->factor(*f);
    if (std::ranges::none_of(factor.variables, [&](Id id) { return poses.contains(id); })) continue;
    std::vector<std::shared_ptr<const VariableType>> types;
    std::vector<const VariableType*> plain;
    std::vector<const double*> states;
    for (const Id id : factor.variables) {
      types.push_back(estimator_->type(id));
      plain.push_back(types.back().get());
      states.push_back(estimator_->state(id).data());
    }
    Measured::Linear linear = Measured(factor, plain, "a factor").at(states);
    if (factor.loss) {
      const double squared = linear.residual.squaredNorm();
      double weight = 1.0;
      factor.loss->evaluate({&squared, 1}, {}, {&weight, 1});
      for (MatrixXd& J : linear.J) J *= std::sqrt(weight);
    }
    incident.push_back({*f, std::move(factor), std::move(linear.J)});
  }
  return incident;
}

/// Without all that the oldest but `k` measured, or without what it measured of landmarks.
InformationLoss CompactGraph::loss_without(std::size_t k, bool all,
                                           std::span<const IncidentFactor> incident) {
  const Id leaving = temporary_[k].id, newest = kept_.back().id;
  const Index n = group_->tangent_size();
  const auto size = [&](Id id) {
    const VariableType* type = landmark(id);
    return type ? static_cast<Index>(type->tangent_size()) : n;
  };
  Places temporary, others;
  if (!all) others.add(leaving, n);
  for (const Temporary& one : temporary_) {
    if (one.id != newest) temporary.add(one.id, n);
  }
  const Index of_others = temporary.total();
  const bool judged = temporary_.back().id == newest;  // which is temporary itself
  if (judged) temporary.add(newest, n);
  Index rows = 0;
  const auto measured = [&](const IncidentFactor& f) {
    const std::vector<Id>& on = f.factor.variables;
    return std::ranges::find(on, leaving) != on.end() && (all || !f.factor.type->is_relative());
  };
  for (const IncidentFactor& f : incident) {
    if (!measured(f)) continue;
    rows += f.J.front().rows();
    for (const Id id : f.factor.variables) {
      if (id != leaving) others.add(id, size(id));
    }
  }
  const Index own = all ? n : 0;
  MatrixXd J = MatrixXd::Zero(rows, own + others.total());
  MatrixXd H = MatrixXd::Zero(temporary.total(), temporary.total());
  Index row = 0;
  for (const IncidentFactor& f : incident) {
    const std::vector<Id>& on = f.factor.variables;
    for (std::size_t a = 0; a < on.size(); ++a) {
      if (!temporary.has(on[a])) continue;
      for (std::size_t b = 0; b < on.size(); ++b) {
        if (!temporary.has(on[b])) continue;
        H.block(temporary[on[a]], temporary[on[b]], n, n) += f.J[a].transpose() * f.J[b];
      }
    }
    if (!measured(f)) continue;
    const Index count = f.J.front().rows();
    for (std::size_t a = 0; a < on.size(); ++a) {
      const Index column = others.has(on[a]) ? own + others[on[a]] : 0;
      J.block(row, column, count, f.J[a].cols()) = f.J[a];
    }
    row += count;
  }
  const MatrixXd R = all ? eliminate(J, n) : J;
  MatrixXd S(others.total(), others.total());
  for (const Id id : others.ids()) {
    MatrixXd column(others.total(), size(id));
    need_covariance(estimator_->covariance_column(
                        id, others.ids(), {column.data(), static_cast<std::size_t>(column.size())}),
                    id);
    S.middleCols(others[id], size(id)) = column;
  }
  const auto about = [&](Index known) {  // where the others but the first `known` are in the set
    const Eigen::LLT<MatrixXd> llt(MatrixXd(H.topLeftCorner(known, known)));
    MatrixXd whole = MatrixXd::Zero(H.rows(), H.cols());
    whole.topLeftCorner(known, known) = llt.solve(MatrixXd(MatrixXd::Identity(known, known)));
    return information_about(R, S, block_of(whole, temporary, others, size));
  };
  const double map = about(H.rows());
  return {map, judged ? std::max(0.0, about(of_others) - map) : 0.0};
}

/// A chain to the oldest but `k` ends at its cover now, as one that ends with a match, and the next
/// begins there.
void CompactGraph::recast_chains(Id leaving, Id cover) {
  if (!keeps_chains_) return;
  const auto end = std::find_if(chains_.rbegin(), chains_.rend(),
                                [&](const OdometryChain& chain) { return chain.to == leaving; });
  if (end == chains_.rend()) return;
  const MotionGroup& motions = group_->motions();
  const Displacement d = between(find(cover), find(leaving));
  const auto mean = group_->view(d.mean);
  const Motion there{{mean.begin(), mean.end()},
                     {d.covariance.data(), d.covariance.data() + d.covariance.size()}};
  const Motion back = motions.inverse(there);
  end->steps.push_back({cover, back.mean, back.covariance, true});
  end->to = cover;
  for (auto next = end.base(); next != chains_.end(); ++next) {
    if (next->from != leaving) continue;
    next->steps.insert(next->steps.begin(), {leaving, there.mean, there.covariance, true});
    next->from = cover;
  }
}

/// Removes the oldest but `k`, with all that it measured; `joined`: its odometry becomes a part of
/// that to the next.
CompactGraph::Leaving CompactGraph::remove_temporary(std::size_t k, bool joined, Id cover,
                                                     std::span<const IncidentFactor> incident) {
  const Temporary pose = temporary_[k];
  GraphUpdate update, removal;
  std::vector<Factor> removed, odometry;
  for (const IncidentFactor& f : incident) {
    if (std::ranges::find(f.factor.variables, pose.id) == f.factor.variables.end()) continue;
    removal.removed_factors.push_back(f.id);
    removed.push_back(f.factor);
    if (f.factor.type->is_relative()) odometry.push_back(f.factor);
  }
  if (joined && odometry.size() == 2) {
    const MotionGroup& motions = group_->motions();
    std::array<Id, 2> ends{};
    for (std::size_t a = 0; a < 2; ++a) {
      const std::vector<Id>& on = odometry[a].variables;
      ends[a] = on.front() == pose.id ? on.back() : on.front();
    }
    const Motion motion = motions.compose(motions.of_factor(odometry[0], ends[0]),
                                          motions.of_factor(odometry[1], pose.id), order_);
    update.factors.push_back(motions.to_factor(odometry[1].type, ends[0], ends[1], motion));
  }
  recast_chains(pose.id, cover);
  removal.removed_variables = update.removed_variables = {pose.id};
  const bool ok = estimator_->update(update).ok;
  copy_.reset();
  temporary_.erase(temporary_.begin() + static_cast<std::ptrdiff_t>(k));
  Leaving leaving{.poses = {pose.id}, .now = {}, .note = {}};
  int left = 0;
  for (const Kept& kept : kept_) leaving.now.push_back(kept.id == pose.id ? -1 : left++);
  merge_ways(removal, removed);
  renumber(removal, 0, leaving.now);
  if (!ok || !determined({})) restore_covariances({});
  refresh();
  return leaving;
}

/// Whether its odometry can be joined: it came from a pose of the graph, and went on to one.
bool CompactGraph::joins(std::size_t k, std::span<const IncidentFactor> incident) const {
  return std::ranges::count_if(incident, [&](const IncidentFactor& f) {
           return f.factor.type->is_relative() &&
                  std::ranges::find(f.factor.variables, temporary_[k].id) !=
                      f.factor.variables.end();
         }) == 2;
}

std::optional<CompactGraph::Leaving> CompactGraph::drop_temporary(
    const InformationLoss& most, const std::function<std::optional<Id>(int)>& cover,
    const std::function<bool(Id)>& needed, PolicySeconds& seconds) {
  update({}, seconds);
  const Timed timed(seconds.estimate);
  const auto follows = [&](std::size_t k) {  // the trajectory continues from there
    return temporary_[k].id == kept_.back().id ||
           (!newest_.kept && temporary_[k].id == kept_[newest_.predecessor].id);
  };
  std::erase_if(temporary_, [&](const Temporary& pose) { return find(pose.id) < 0; });
  while (!temporary_.empty() && !follows(0)) {
    if (temporary_.size() <= kMostTemporary && needed(temporary_.front().id)) break;
    const std::vector<IncidentFactor> incident = factors_of_temporary();
    const InformationLoss cut = loss_without(0, true, incident);
    const bool known = cut.newest <= most.newest;
    if (!known && temporary_.size() <= kMostTemporary) break;
    const std::size_t k = known || joins(0, incident) ? 0 : 1;
    if (follows(k)) break;
    const int pose = find(temporary_[k].id);
    if (const std::optional<Id> place = cover(pose)) {
      if (known && cut.map <= most.map) return remove_temporary(k, false, *place, incident);
      if (joins(k, incident) && loss_without(k, false, incident).map <= most.map)
        return remove_temporary(k, true, *place, incident);
    }
    make_permanent(pose);
  }
  return std::nullopt;
}

}  // namespace cairn::compact
