// SPDX-License-Identifier: BSD-3-Clause
#include "landmark_selection.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include <fmt/core.h>

#include "cairn/geometry/pose.hpp"
#include "cairn/graph/id_text.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/update/graph_update.hpp"
#include "linearity.hpp"

namespace cairn::compact {
namespace {

using Eigen::MatrixXd;

/// Of a position, in its standard deviations.
constexpr double kMostDigits = 1e12;

/// After so many poses in a row of which no measurement is linear, all of them are used.
constexpr int kMostNonlinearPoses = 5;

[[noreturn]] void refuse(const std::string& message) { throw Error(ErrorCode::input, message); }

/// Whether what a pose measures of a landmark is linear over their `joint` covariance, the
/// landmark's first. `rows`: the linear model.
bool is_linear(const RigidGroup& group, const PlacedState& pose, const LandmarkView& view,
               const ObservationRows& rows, const MatrixXd& joint) {
  const MatrixXd S = beside_pose(group, pose, view.type, view.landmark, joint);
  return nonlinearity(view, rows, S) <= kMostNonlinear;
}

void append(std::span<const Measured> measured, std::vector<Factor>& factors) {
  for (const Measured& factor : measured) factors.push_back(factor.factor());
}

}  // namespace

void LandmarkSelection::offer(const LandmarkObservation& observation, const CompactGraph& graph) {
  const Variable& landmark = observation.landmark;
  if (!landmark.type) refuse(fmt::format("landmark {} has no type", id_text(landmark.id)));
  const std::string name = fmt::format("{} {}", landmark.type->tag(), id_text(landmark.id));
  if (!graph.located()) {
    refuse(
        "it is not known where the pose is on the map: landmarks are used from the first match "
        "with it on");
  }
  const Placement* placement = landmark.type->placement();
  if (!is_point(*landmark.type) || placement->dimension() != graph.group().dimension())
    refuse(name + " is not a point where the poses are: not a landmark");
  if (landmark.fixed) refuse(name + " is fixed, and a policy estimates all landmarks");
  const VariableType* waits = waiting_.type(landmark.id);
  const VariableType* known = waits ? waits : graph.landmarks().type(landmark.id);
  if (graph.kept().find(landmark.id) >= 0 || landmark.id == graph.newest().id() ||
      (known && known->tag() != landmark.type->tag()))
    refuse(name + " has the id of something else");
  Seen seen{.landmark = landmark, .factors = {}};
  for (const Factor& factor : observation.factors) {
    seen.factors.push_back(
        checked_observation(factor, graph.newest().id(), graph.group().motions().type(), landmark));
  }
  if (!seen.factors.empty()) seen_.push_back(std::move(seen));
}

MayUse LandmarkSelection::may_use(std::function<bool(std::size_t, const MatrixXd&)> linear) const {
  return {.fits = [this](const MeasuredFit& fit) { return gate_.passes(fit.innovation, fit.dof); },
          .linear = std::move(linear)};
}

LandmarkSelection::Known LandmarkSelection::known(const CompactGraph& graph) const {
  Known known;
  for (std::size_t k = 0; k < seen_.size(); ++k) {
    const Id id = seen_[k].landmark.id;
    const VariableType* type = graph.landmarks().type(id);
    if (!type) continue;
    const auto at = std::ranges::find(known.landmarks, id) - known.landmarks.begin();
    if (at == std::ssize(known.landmarks)) {
      known.landmarks.push_back(id);
      known.sizes.push_back(type->tangent_size());
    }
    known.places.push_back(k);
    known.rows.push_back(linearized(seen_[k].factors, graph.newest().id(),
                                    graph.newest().state().data(),
                                    graph.kept().estimator().state(id).data()));
    known.rows.back().landmark = static_cast<int>(at);
  }
  return known;
}

std::vector<ObservationFit> LandmarkSelection::choose(const Known& known, CompactGraph& graph,
                                                      PolicySeconds& seconds) const {
  const PlacedState x = graph.group().place(graph.newest().state());
  // It is the pose that is not known then, not that it is near a landmark.
  const bool lost = nonlinear_poses_ >= kMostNonlinearPoses;
  const auto linear = [&](std::size_t k, const MatrixXd& joint) {
    if (everything_ || lost) return true;
    const Seen& seen = seen_[known.places[k]];
    const Id id = seen.landmark.id;
    return is_linear(graph.group(), x,
                     {*graph.landmarks().type(id), graph.kept().estimator().state(id), seen.factors,
                      graph.newest().id(), x.x},
                     known.rows[k], joint);
  };
  return choose_observations(known.rows, known.sizes,
                             graph.landmark_covariance(known.landmarks, seconds), least_gain_,
                             may_use(linear));
}

/// How landmarks agree with the poses, and whether the newest pose is known well enough.
void LandmarkSelection::note_fits(const Known& known, std::span<const ObservationFit> fits) {
  for (std::size_t k = 0; k < fits.size() && gate_.on(); ++k) {
    Agreement& agreement = agreement_[seen_[known.places[k]].landmark.id];
    agreement.used += fits[k].used;
    agreement.refused += fits[k].informative && fits[k].linear && !fits[k].used;
  }
  if (std::ranges::any_of(fits, &ObservationFit::used)) {
    nonlinear_poses_ = 0;
  } else if (!std::ranges::all_of(fits, &ObservationFit::linear)) {
    ++nonlinear_poses_;
  }
}

void LandmarkSelection::use_known(CompactGraph& graph, PoseReport& report) {
  const Known known = this->known(graph);
  if (known.places.empty()) return;
  const std::vector<ObservationFit> fits = choose(known, graph, report.seconds);
  note_fits(known, fits);
  std::vector<Factor> used;
  for (std::size_t k = 0; k < fits.size(); ++k) {
    const Seen& seen = seen_[known.places[k]];
    report.landmarks.push_back(
        report_of(report.id, seen.landmark.id, seen.factors.size(), fits[k]));
    if (fits[k].used) append(seen.factors, used);
  }
  for (auto k = known.places.rbegin(); k != known.places.rend(); ++k)  // they are settled
    seen_.erase(seen_.begin() + static_cast<std::ptrdiff_t>(*k));
  if (!used.empty()) see({}, used, graph, report);
  release_contradicted(graph, report);
}

/// Landmarks that more poses contradict than agree with: what put them there was false.
void LandmarkSelection::release_contradicted(CompactGraph& graph, PoseReport& report) {
  std::vector<Id> contradicted;
  for (const auto& [id, agreement] : agreement_) {
    if (agreement.refused > agreement.used && graph.landmarks().type(id))
      contradicted.push_back(id);
  }
  std::ranges::sort(contradicted);
  if (contradicted.empty()) return;
  graph.release(contradicted, report.seconds);
  settle_left_out(graph, report);
}

/// Where the factors of an observation put a landmark that is new, or it was given.
LandmarkSelection::FirstPlace LandmarkSelection::place(const Seen& seen,
                                                       const CompactGraph& graph) const {
  GraphUpdate trial;
  trial.variables.push_back(seen.landmark);
  append(seen.factors, trial.factors);
  const auto pose = graph.group().view(graph.newest().state());
  const std::vector<int> unplaced =
      place_variables(trial, [&](Id) { return std::span<const double>(pose); });
  if (!unplaced.empty()) return {};
  std::vector<double>& state = trial.variables.front().state;
  const ObservationRows rows =
      linearized(seen.factors, graph.newest().id(), graph.newest().state().data(), state.data());
  const double distance =
      (position(*seen.landmark.type, state) - graph.group().place(graph.newest().state()).at.t)
          .norm();
  // Of the standard deviation 1/|J|.
  if (!rows.e.allFinite() || !(distance * rows.J_landmark.norm() < kMostDigits)) {
    return {.problem = fmt::format(
                "what pose {} measured of landmark {} is left out: it puts the landmark {:.3g} m "
                "away, of which rounding leaves no digit that was measured; expected a distance of "
                "less than {:.0e} times its standard deviation",
                graph.newest().id(), seen.landmark.id, distance, kMostDigits)};
  }
  if (rank(rows.J_landmark) < seen.landmark.type->tangent_size()) return {};
  return {.state = std::move(state)};
}

bool LandmarkSelection::add_new(CompactGraph& graph, PoseReport& report) {
  const bool kept = graph.newest().kept;
  std::vector<Variable> added;
  std::vector<Factor> factors;
  std::vector<Seen> undetermined;
  for (Seen& seen : std::exchange(seen_, {})) {
    const Id id = seen.landmark.id;
    const bool twice = std::ranges::find(added, id, &Variable::id) != added.end();
    if (graph.landmarks().type(id)) {  // by another measurement of the pose
      const View view{.pose = graph.newest().id(), .factors = std::move(seen.factors)};
      judge_views(id, {&view, 1}, graph, report);
      continue;
    }
    LandmarkReport outcome{
        .pose = report.id, .landmark = id, .factors = static_cast<int>(std::ssize(seen.factors))};
    if (!twice) {
      FirstPlace first = place(seen, graph);
      if (!first.problem.empty()) {
        report.notes.push_back(std::move(first.problem));
        report.landmarks.push_back(outcome);
        continue;
      }
      if (!first.state) {
        undetermined.push_back(std::move(seen));
        continue;
      }
      added.push_back(seen.landmark);
      added.back().state = *std::move(first.state);
    }
    outcome.added = kept && !twice;
    outcome.gain = std::numeric_limits<double>::infinity();
    if (kept) outcome.verdict = LinkVerdict::linked;
    report.landmarks.push_back(outcome);
    append(seen.factors, factors);
  }
  bool any = kept && !added.empty();
  if (any) {
    std::vector<Id> ids;
    for (const Variable& landmark : added) ids.push_back(landmark.id);
    see(std::move(added), factors, graph, report);
    for (const Id id : ids) {
      if (gate_.on()) agreement_[id].used = 1;
      // If it has left at once, it waits with all of its views.
      if (graph.landmarks().type(id)) judge_views(id, waiting_.take(id), graph, report);
    }
  }
  for (const Seen& seen : undetermined) any = add_or_wait(seen, graph, report) || any;
  return any;
}

bool LandmarkSelection::use_waiting(CompactGraph& graph, PoseReport& report) {
  if (graph.newest().kept) return false;  // then all that are determined are added
  for (std::size_t k = 0; k < seen_.size(); ++k) {
    const Id id = seen_[k].landmark.id;
    if (graph.landmarks().type(id) || !waiting_.has_views(id)) continue;
    WaitingLandmark all = waiting_.with_newest(seen_[k].landmark, seen_[k].factors, graph);
    std::optional<Triangulated> found = waiting_.triangulate(all, graph, report.seconds);
    if (!found || !(found->found.fit.gain > least_gain_) || !waiting_.agree(*found)) continue;
    seen_.erase(seen_.begin() + static_cast<std::ptrdiff_t>(k));
    add_triangulated(std::move(all), std::move(*found), graph, report);
    return true;  // the others are added to a pose that is kept
  }
  return false;
}

/// Of a landmark that what the newest pose measures does not determine. Whether it is in the graph
/// now.
bool LandmarkSelection::add_or_wait(const Seen& seen, CompactGraph& graph, PoseReport& report) {
  const Id id = seen.landmark.id;
  if (graph.landmarks().type(id)) {  // by another measurement of the pose
    const View view{.pose = graph.newest().id(), .factors = seen.factors};
    judge_views(id, {&view, 1}, graph, report);
    return true;
  }
  LandmarkReport outcome{.pose = report.id,
                         .landmark = id,
                         .factors = static_cast<int>(std::ssize(seen.factors)),
                         .gain = std::numeric_limits<double>::infinity()};
  if (!waiting_.may_wait(id) || !graph.newest().kept) {
    waiting_.note(seen.landmark);
    report.landmarks.push_back(outcome);
    return false;
  }
  WaitingLandmark all = waiting_.with_newest(seen.landmark, seen.factors, graph);
  std::optional<Triangulated> found = waiting_.triangulate(all, graph, report.seconds);
  if (found && waiting_.agree(*found)) {
    add_triangulated(std::move(all), std::move(*found), graph, report);
    return true;
  }
  outcome.verdict = LinkVerdict::waiting;
  if (found) outcome.innovation = found->found.fit.innovation;
  report.landmarks.push_back(outcome);
  waiting_.add(std::move(all), graph, report);
  return false;
}

/// Adds a landmark with the views that put it there, and judges the others.
void LandmarkSelection::add_triangulated(WaitingLandmark waiting, Triangulated triangulated,
                                         CompactGraph& graph, PoseReport& report) {
  const Id id = waiting.landmark.id;
  waiting.landmark.state = std::move(triangulated.found.state);
  std::vector<Factor> factors;
  for (const std::size_t k : triangulated.chosen) {
    View& view = waiting.views[k];
    report.landmarks.push_back({.pose = view.pose,
                                .landmark = id,
                                .factors = static_cast<int>(std::ssize(view.factors)),
                                .added = k == 0,
                                .gain = triangulated.found.fit.gain,
                                .innovation = triangulated.found.fit.innovation,
                                .verdict = LinkVerdict::linked});
    append(view.factors, factors);
    view.factors.clear();
  }
  std::erase_if(waiting.views, [](const View& view) { return view.factors.empty(); });
  if (gate_.on()) agreement_[id].used = static_cast<int>(std::ssize(triangulated.chosen));
  waiting_.take(id);
  see({waiting.landmark}, factors, graph, report);
  judge_views(id, waiting.views, graph, report);
}

/// Of a landmark that is in the graph now: what poses that are kept measured of it before.
void LandmarkSelection::judge_views(Id landmark, std::span<const View> views, CompactGraph& graph,
                                    PoseReport& report) {
  for (const View& view : views) {
    const VariableType* type = graph.landmarks().type(landmark);
    if (!type) {  // it has left again
      waiting_.add(landmark, view, graph);
      continue;
    }
    const std::vector<int> size{type->tangent_size()};
    const int pose = graph.kept().find(view.pose);
    MatrixXd covariance = graph.landmark_covariance(landmark, pose, report.seconds);
    const PlacedState x = graph.group().place(graph.kept().state(pose));
    const std::span<const double> state = graph.kept().estimator().state(landmark);
    // At the estimate that the covariance is of.
    const std::vector<ObservationRows> rows{
        linearized(view.factors, view.pose, x.x.data(), state.data())};
    const auto linear = [&](std::size_t, const MatrixXd& joint) {
      return everything_ ||
             is_linear(graph.group(), x, {*type, state, view.factors, view.pose, x.x}, rows.front(),
                       joint);
    };
    const ObservationFit fit =
        choose_observations(rows, size, std::move(covariance), least_gain_, may_use(linear))
            .front();
    report.landmarks.push_back(report_of(view.pose, landmark, view.factors.size(), fit));
    if (!fit.used) continue;
    std::vector<Factor> factors;
    append(view.factors, factors);
    graph.add(factors, report.seconds);
    settle_left_out(graph, report);
  }
}

void LandmarkSelection::see(std::vector<Variable> added, std::span<const Factor> factors,
                            CompactGraph& graph, PoseReport& report) {
  graph.see(std::move(added), factors, report.seconds);
  settle_left_out(graph, report);
}

void LandmarkSelection::settle_left_out(CompactGraph& graph, PoseReport& report) {
  for (const LeftOut& left : graph.take_left_out()) {
    const Id id = left.landmark.id;
    if (left.removed) {
      waiting_.note_left(left.landmark);
      agreement_.erase(id);
    }
    for (const auto& [pose, factor] : left.factors) {
      // What a pose measured that leaves with it, or was not kept, is lost.
      const bool waits = left.removed && waiting_.may_wait(id) && graph.kept().find(pose) >= 0;
      report.landmarks.push_back({.pose = pose,
                                  .landmark = id,
                                  .factors = 1,
                                  .removed = true,
                                  .verdict = waits          ? LinkVerdict::waiting
                                             : left.removed ? LinkVerdict::unmatched
                                                            : LinkVerdict::nonlinear});
      if (!waits) continue;
      const Measured measured =
          checked_observation(factor, pose, graph.group().motions().type(), left.landmark);
      waiting_.add(id, {.pose = pose, .factors = {measured}}, graph);
    }
  }
}

}  // namespace cairn::compact
