// SPDX-License-Identifier: BSD-3-Clause
// Landmarks that are seen from the poses of a compact graph.
#include "landmarks.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <memory>
#include <string>
#include <tuple>
#include <unordered_map>
#include <utility>

#include <fmt/core.h>

#include "cairn/geometry/pose.hpp"
#include "cairn/graph/id_text.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"
#include "cairn/update/graph_update.hpp"
#include "compact_graph.hpp"
#include "compact_pose.hpp"
#include "dense/cholesky.hpp"
#include "linearity.hpp"

namespace cairn::compact {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Of a position, in its standard deviations.
constexpr double kMostDigits = 1e12;

/// After so many poses in a row of which no measurement is linear, all of them are used.
constexpr int kMostNonlinearPoses = 5;

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

// The graph ---------------------------------------------------------------------------------------

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

// The policy --------------------------------------------------------------------------------------

void CompactPose::offer_landmark(const LandmarkObservation& observation) {
  if (!open_) throw Error(ErrorCode::usage, "offer_landmark without a pose");
  const Variable& landmark = observation.landmark;
  if (!landmark.type) refuse(fmt::format("landmark {} has no type", id_text(landmark.id)));
  const std::string name = fmt::format("{} {}", landmark.type->tag(), id_text(landmark.id));
  if (!graph_.located()) {
    refuse(
        "it is not known where the pose is on the map: landmarks are used from the first match "
        "with it on");
  }
  const Placement* placement = landmark.type->placement();
  if (!is_point(*landmark.type) || placement->dimension() != graph_.group().dimension())
    refuse(name + " is not a point where the poses are: not a landmark");
  if (landmark.fixed) refuse(name + " is fixed, and a policy estimates all landmarks");
  const auto waiting = waiting_landmarks_.find(landmark.id);
  const VariableType* known = waiting != waiting_landmarks_.end()
                                  ? waiting->second.landmark.type.get()
                                  : graph_.landmark(landmark.id);
  if (graph_.find(landmark.id) >= 0 || landmark.id == graph_.newest_id() ||
      (known && known->tag() != landmark.type->tag()))
    refuse(name + " has the id of something else");
  Seen seen{.landmark = landmark, .factors = {}};
  for (const Factor& factor : observation.factors) {
    seen.factors.push_back(
        checked_observation(factor, graph_.newest_id(), graph_.group().motions().type(), landmark));
  }
  if (!seen.factors.empty()) seen_.push_back(std::move(seen));
}

MayUse CompactPose::may_use(std::function<bool(std::size_t, const MatrixXd&)> linear) const {
  return {
      .fits = [this](const MeasuredFit& fit) { return check_->passes(fit.innovation, fit.dof); },
      .linear = std::move(linear)};
}

/// Whether what a pose measures of a landmark in the graph is linear over their `joint` covariance,
/// the landmark's first. `rows`: the linear model.
bool CompactPose::linear(Id landmark, Id pose, const PlacedState& x,
                         std::span<const Measured> factors, const ObservationRows& rows,
                         const MatrixXd& joint) const {
  if (options_.strategy == Strategy::apal) return true;  // everything
  const VariableType& type = *graph_.landmark(landmark);
  const std::span<const double> state = graph_.landmark_state(landmark);
  const MatrixXd S = beside_pose(graph_.group(), x, type, state, joint);
  return nonlinearity({type, state, factors, pose, x.x}, rows, S) <= kMostNonlinear;
}

/// Those of landmarks in the graph.
void CompactPose::use_landmarks() {
  std::vector<std::size_t> known;
  std::vector<Id> ids;
  std::vector<int> sizes;
  std::vector<ObservationRows> rows;
  for (std::size_t k = 0; k < seen_.size(); ++k) {
    const Id id = seen_[k].landmark.id;
    const VariableType* type = graph_.landmark(id);
    if (!type) continue;
    auto at = std::ranges::find(ids, id) - ids.begin();
    if (at == std::ssize(ids)) {
      ids.push_back(id);
      sizes.push_back(type->tangent_size());
    }
    known.push_back(k);
    rows.push_back(linearized(seen_[k].factors, graph_.newest_id(), graph_.newest_state().data(),
                              graph_.landmark_state(id).data()));
    rows.back().landmark = static_cast<int>(at);
  }
  if (known.empty()) return;
  const PlacedState x = graph_.group().place(graph_.newest_state());
  // It is the pose that is not known then, not that it is near a landmark.
  const bool lost = nonlinear_poses_ >= kMostNonlinearPoses;
  const std::vector<ObservationFit> fits =
      choose_observations(rows, sizes, graph_.landmark_covariance(ids, report_.seconds),
                          landmark_gain_, may_use([&](std::size_t k, const MatrixXd& joint) {
                            const Seen& seen = seen_[known[k]];
                            return lost || linear(seen.landmark.id, graph_.newest_id(), x,
                                                  seen.factors, rows[k], joint);
                          }));
  for (std::size_t k = 0; k < known.size() && check_->on(); ++k) {
    Agreement& agreement = agreement_[seen_[known[k]].landmark.id];
    agreement.used += fits[k].used;
    agreement.refused += fits[k].informative && fits[k].linear && !fits[k].used;
  }
  const auto any = [&](auto what) { return std::ranges::any_of(fits, what); };
  if (any([](const ObservationFit& fit) { return fit.used; })) {
    nonlinear_poses_ = 0;
  } else if (any([](const ObservationFit& fit) { return !fit.linear; })) {
    ++nonlinear_poses_;
  }
  std::vector<Factor> used;
  for (std::size_t k = 0; k < known.size(); ++k) {
    const Seen& seen = seen_[known[k]];
    const ObservationFit& fit = fits[k];
    report_.landmarks.push_back(report_of(report_.id, seen.landmark.id, seen.factors.size(), fit));
    if (!fit.used) continue;
    for (const Measured& factor : seen.factors) used.push_back(factor.factor());
  }
  for (auto k = known.rbegin(); k != known.rend(); ++k)  // they are settled
    seen_.erase(seen_.begin() + static_cast<std::ptrdiff_t>(*k));
  if (!used.empty()) see({}, used);
  release_contradicted();
}

/// Landmarks that more poses contradict than agree with: what put them there was false.
void CompactPose::release_contradicted() {
  std::vector<Id> contradicted;
  for (const auto& [id, agreement] : agreement_) {
    if (agreement.refused > agreement.used && graph_.landmark(id)) contradicted.push_back(id);
  }
  std::ranges::sort(contradicted);
  if (contradicted.empty()) return;
  graph_.release(contradicted, report_.seconds);
  settle_left_out();
}

/// Where the factors of an observation put a landmark that is new, or it was given.
CompactPose::FirstPlace CompactPose::place(const Seen& seen) const {
  GraphUpdate trial;
  trial.variables.push_back(seen.landmark);
  for (const Measured& factor : seen.factors) trial.factors.push_back(factor.factor());
  const auto pose = graph_.group().view(graph_.newest_state());
  const std::vector<int> unplaced =
      place_variables(trial, [&](Id) { return std::span<const double>(pose); });
  if (!unplaced.empty()) return {};
  std::vector<double>& state = trial.variables.front().state;
  const ObservationRows rows =
      linearized(seen.factors, graph_.newest_id(), graph_.newest_state().data(), state.data());
  const double distance =
      (position(*seen.landmark.type, state) - graph_.group().place(graph_.newest_state()).at.t)
          .norm();
  // Of the standard deviation 1/|J|.
  if (!rows.e.allFinite() || !(distance * rows.J_landmark.norm() < kMostDigits)) {
    return {.state = {},
            .problem = fmt::format(
                "what pose {} measured of landmark {} is left out: it puts the landmark {:.3g} m "
                "away, of which rounding leaves no digit that was measured; expected a distance of "
                "less than {:.0e} times its standard deviation",
                graph_.newest_id(), seen.landmark.id, distance, kMostDigits)};
  }
  if (rank(rows.J_landmark) < seen.landmark.type->tangent_size()) return {};
  return {.state = std::move(state), .problem = {}};
}

/// Those that the newest pose, which is kept, sees first. Whether there are any.
bool CompactPose::add_landmarks() {
  std::vector<Variable> added;
  std::vector<Factor> factors;
  std::vector<Seen> undetermined;
  for (Seen& seen : std::exchange(seen_, {})) {
    const Id id = seen.landmark.id;
    const bool twice = std::ranges::find(added, id, &Variable::id) != added.end();
    if (graph_.landmark(id)) {  // by another measurement of the pose
      const View view{.pose = graph_.newest_id(), .factors = std::move(seen.factors)};
      judge_views(id, {&view, 1});
      continue;
    }
    if (!twice) {
      FirstPlace first = place(seen);
      if (!first.problem.empty()) {
        report_.notes.push_back(std::move(first.problem));
        report_.landmarks.push_back({.pose = report_.id,
                                     .landmark = id,
                                     .factors = static_cast<int>(std::ssize(seen.factors))});
        continue;
      }
      if (!first.state) {
        undetermined.push_back(std::move(seen));
        continue;
      }
      added.push_back(seen.landmark);
      added.back().state = *std::move(first.state);
    }
    const bool kept = graph_.newest_kept();
    report_.landmarks.push_back({.pose = report_.id,
                                 .landmark = id,
                                 .factors = static_cast<int>(std::ssize(seen.factors)),
                                 .added = kept && !twice,
                                 .gain = std::numeric_limits<double>::infinity(),
                                 .verdict = kept ? LinkVerdict::linked : LinkVerdict::unmatched});
    for (const Measured& factor : seen.factors) factors.push_back(factor.factor());
  }
  bool any = false;
  if (graph_.newest_kept() && !added.empty()) {
    std::vector<Id> ids;
    for (const Variable& landmark : added) ids.push_back(landmark.id);
    see(std::move(added), factors);
    for (const Id id : ids) {
      if (check_->on()) agreement_[id].used = 1;
      settle_landmark(id);
    }
    any = true;
  }
  for (const Seen& seen : undetermined) any = add_or_wait(seen) || any;
  return any;
}

}  // namespace cairn::compact
