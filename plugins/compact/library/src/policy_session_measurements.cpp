// SPDX-License-Identifier: BSD-3-Clause
// Absolute measurements of the newest pose, and those of landmarks, in the lines of a policy's
// session.
#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/policy/policy_session.hpp"

namespace cairn {
namespace {

std::string_view word_of_prior(LinkVerdict verdict) {
  switch (verdict) {
    case LinkVerdict::linked:
      return "TAKEN";
    case LinkVerdict::inconsistent:
      return "INCONSISTENT";
    case LinkVerdict::waiting:
      return "WAITING";
    case LinkVerdict::nonlinear:
      return "NONLINEAR";
    default:
      return "UNINFORMATIVE";
  }
}

}  // namespace

/// Data, as an edge is: not answered. Nothing that the policy would refuse later.
void PolicySession::take_prior(Factor prior) {
  const Id pose = prior.variables.front();
  const FactorType& type = *prior.type;
  const std::string name = fmt::format("{} {}", type.tag(), pose);
  if (!motions_ || type.variable_tags().front() != motions_->type().tag())
    throw bad_line(name +
                   ": not a measurement of one pose, and of landmarks a policy takes those "
                   "from poses");
  if (current() != pose) {
    throw bad_line(
        fmt::format("{}: expected a measurement of the newest pose before it ends (DONE)", name));
  }
  begin_measured(prior, name);
  priors_.push_back(std::move(prior));
}

/// For each measurement of the open pose but its links: brings it into canonical form, and hands
/// the pose over. `name` begins the message where it is refused.
void PolicySession::begin_measured(Factor& measured, const std::string& name) {
  if (const std::string problem = measured.type->normalize(measured.measurement.data());
      !problem.empty())
    throw bad_line(fmt::format("{}: {}", name, problem));
  expect_complete();
  if (!policy_.unlocated().empty()) {
    throw bad_line(
        name +
        ": it is not known where the robot is on the map; expected a match with it (LOCATE) first");
  }
  begin();
}

void PolicySession::offer_priors() {
  for (const Factor& prior : std::exchange(priors_, {})) {
    try {
      (void)policy_.offer_prior(prior);  // its report is in that of the pose
    } catch (const Error& error) {
      // The line was taken, and what follows it is not to blame.
      answer_ += fmt::format("NOTE {} {} was not taken: {}\n", prior.type->tag(),
                             prior.variables.front(), error.what());
    }
  }
}

void PolicySession::note_prior(const PriorReport& prior) {
  answer_ += fmt::format("PRIOR {} {} {} {}\n", prior.pose, word_of_prior(prior.verdict),
                         prior.gain, prior.innovation);
  counts_.priors += prior.verdict == LinkVerdict::linked;
}

// Landmarks ---------------------------------------------------------------------------------------

/// Like a pose, once; where its first measurement puts it.
void PolicySession::take_landmark(const Variable& landmark) {
  const std::string name = fmt::format("{} {}", landmark.type->tag(), landmark.id);
  if (arrived_.contains(landmark.id) || current() == landmark.id ||
      landmarks_.contains(landmark.id))
    throw bad_line(name + ": the id is already in use");
  if (motions_ &&
      landmark.type->placement()->dimension() != motions_->type().placement()->dimension()) {
    throw bad_line(fmt::format("{}: the poses are {}; expected a landmark where they are", name,
                               motions_->type().tag()));
  }
  landmarks_.emplace(landmark.id, landmark.type);
}

bool PolicySession::is_observation(const Factor& factor) const {
  return !factor.type->is_relative() && factor.variables.size() == 2 && current() &&
         std::ranges::count(factor.variables, *current()) == 1;
}

/// Data, as an edge is: not answered. Nothing that the policy would refuse later.
void PolicySession::take_observation(Factor factor) {
  const Id id = other_end(factor.variables);
  const FactorType& type = *factor.type;
  const std::string name =
      fmt::format("{} {} {}", type.tag(), factor.variables[0], factor.variables[1]);
  const auto landmark = landmarks_.find(id);
  if (landmark == landmarks_.end()) {
    throw bad_line(fmt::format(
        "{}: there is no landmark {}; expected its line, such as 'NEW VERTEX_XY {}', first", name,
        id, id));
  }
  const auto tags = type.variable_tags();
  const std::size_t of_pose = factor.variables[0] == id ? 1 : 0;
  if (tags[of_pose] != motions_->type().tag() || tags[1 - of_pose] != landmark->second->tag())
    throw bad_line(fmt::format("{}: not a measurement of {} {} from a {}", name,
                               landmark->second->tag(), id, motions_->type().tag()));
  if (landmark->second->placement()->dimension() != motions_->type().placement()->dimension())
    throw bad_line(name + ": the poses are not where the landmark is");
  begin_measured(factor, name);
  auto there = std::ranges::find(observations_, id, [](const LandmarkObservation& observation) {
    return observation.landmark.id;
  });
  if (there == observations_.end()) {
    there = observations_.insert(
        there, {{.type = landmark->second, .id = id, .state = {}, .fixed = false}, {}});
  }
  there->factors.push_back(std::move(factor));
}

void PolicySession::offer_landmarks() {
  for (const LandmarkObservation& observation : std::exchange(observations_, {})) {
    try {
      policy_.offer_landmark(observation);  // its report is in that of the pose
    } catch (const Error& error) {
      answer_ += fmt::format("NOTE what was measured of landmark {} was not taken: {}\n",
                             observation.landmark.id, error.what());
    }
  }
}

void PolicySession::note_landmark(const LandmarkReport& landmark) {
  const std::string_view word = landmark.added     ? "ADDED"
                                : landmark.removed ? "LEFT"
                                : landmark.verdict == LinkVerdict::unmatched
                                    ? "NOTADDED"
                                    : word_of_prior(landmark.verdict);
  answer_ += fmt::format("LANDMARK {} {} {} {} {}\n", landmark.pose, landmark.landmark, word,
                         landmark.gain, landmark.innovation);
  counts_.landmarks += landmark.added;
  if (landmark.verdict == LinkVerdict::linked) counts_.observations += landmark.factors;
  if (!landmark.removed) return;
  counts_.observations -= landmark.factors;
  counts_.landmarks =
      std::ranges::count_if(policy_.landmarks(), [&](Id id) { return landmarks_.contains(id); });
}

/// At the end: landmarks that nothing will determine any more.
void PolicySession::note_undetermined() {
  if (const std::int64_t count = undetermined(); count > 0) {
    answer_ += fmt::format(
        "NOTE {} of the landmarks that were seen are not in the graph: what was measured of them "
        "does not determine where they are (several poses together may, unless "
        "several_views=false)\n",
        count);
  }
}

}  // namespace cairn
