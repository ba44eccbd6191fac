// SPDX-License-Identifier: BSD-3-Clause
#include "pose_intake.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/geometry/pose.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

Error bad_line(const std::string& message) { return {ErrorCode::input, message}; }

std::string name_of(const Variable& variable) {
  return fmt::format("{} {}", variable.type->tag(), variable.id);
}

std::string name_of(const Factor& factor) {
  return fmt::format("{} {}", factor.type->tag(), fmt::join(factor.variables, " "));
}

}  // namespace

void PoseIntake::load(const Graph& map) {
  for (int v = 0; v < map.variable_count(); ++v) {
    if (is_point(map.type(v))) {
      landmarks_.emplace(map.id(v), map.variable(v).type);
      continue;
    }
    arrived_.insert(map.id(v));
    kept_.insert(map.id(v));
    if (!motions_) motions_.emplace(map.variable(v).type);
  }
}

// The poses so far --------------------------------------------------------------------------------

std::optional<Id> PoseIntake::current() const {
  if (arriving_) return arriving_->pose.id;
  return open_ ? newest_ : std::nullopt;
}

void PoseIntake::expect_complete() const {
  if (!current())
    throw bad_line("there is no pose that is not done; expected the line of the next one");
  if (!complete()) {
    throw bad_line(fmt::format(
        "pose {} has no odometry yet; expected a relative pose between poses {} and {} first",
        arriving_->pose.id, *newest_, arriving_->pose.id));
  }
}

Id PoseIntake::other_end(std::span<const Id> ends) const {
  const std::optional<Id> pose = current();
  if (!pose) throw bad_line("there is no pose that is not done; expected the line of the next one");
  const bool between = ends.size() == 2 && (ends[0] == pose) != (ends[1] == pose);
  if (!between) {
    throw bad_line(fmt::format(
        "between {}; expected a relative pose between pose {}, which is the newest, and another",
        fmt::join(ends, " and "), *pose));
  }
  return ends[0] == pose ? ends[1] : ends[0];
}

void PoseIntake::expect_kept(Id id) const {
  if (!arrived_.contains(id)) throw bad_line(fmt::format("there is no pose {}", id));
  if (kept_.contains(id)) return;
  // Which of the two it was is not remembered: that would take memory for as long as it runs.
  throw bad_line(
      fmt::format("pose {} was not kept{}; expected a pose that is, such as NEXT proposes", id,
                  some_left_ ? ", or has left since (DROPPED, REMOVED)" : ""));
}

// Lines of data -----------------------------------------------------------------------------------

void PoseIntake::check_pose(Variable& pose) const {
  const std::string name = name_of(pose);
  if (!is_pose(*pose.type)) {
    throw bad_line(name +
                   " is neither a pose nor a landmark; with a policy a robot's poses and the "
                   "landmarks that it sees can come");
  }
  if (motions_ && motions_->type().tag() != pose.type->tag()) {
    throw bad_line(fmt::format("{}: the poses before it are {}; expected another", name,
                               motions_->type().tag()));
  }
  if (arrived_.contains(pose.id) || current() == pose.id || landmarks_.contains(pose.id))
    throw bad_line(name + ": the id is already in use");
  if (!pose.state.empty()) {
    if (const std::string problem = pose.type->normalize(pose.state.data()); !problem.empty())
      throw bad_line(fmt::format("{}: {}", name, problem));
  }
}

void PoseIntake::arrive(Variable pose) {
  if (!motions_) motions_.emplace(pose.type);
  arriving_ = Arriving{std::move(pose), {}};
}

void PoseIntake::expect_arriving(std::span<const Id> ids) const {
  for (const Id id : ids) {
    if (!arriving_ || arriving_->pose.id != id) {
      throw bad_line(fmt::format(
          "FIX {}: only a pose that has just come can be held; expected FIX right after the line "
          "of the pose",
          id));
    }
  }
}

/// Like a pose, once; where its first measurement puts it.
void PoseIntake::add_landmark(const Variable& landmark) {
  const std::string name = name_of(landmark);
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

bool PoseIntake::take_odometry(Factor& factor, Id other) {
  check_motion(factor, other);
  if (other != (arriving_ ? newest_ : before_)) return false;
  if (!arriving_) {
    throw bad_line(
        fmt::format("odometry from pose {} to {} after other lines of pose {}; "
                    "expected it right after the line that brings the pose",
                    other, *newest_, *newest_));
  }
  arriving_->odometry.push_back(std::move(factor));
  return true;
}

/// Nothing that the policy would refuse later, when others wait for an answer.
void PoseIntake::check_motion(const Factor& factor, Id from) const {
  const FactorType& type = *factor.type;
  if (!type.is_relative() || type.variable_tags().front() != motions_->type().tag()) {
    throw bad_line(fmt::format("{} is not a relative pose of {}, and a policy takes nothing else",
                               type.tag(), motions_->type().tag()));
  }
  (void)motions_->to_factor(factor.type, from, *current(), motions_->of_factor(factor, from));
}

void PoseIntake::check_prior(const Factor& prior) const {
  const std::string name = name_of(prior);
  if (!motions_ || prior.type->variable_tags().front() != motions_->type().tag())
    throw bad_line(name +
                   ": not a measurement of one pose, and of landmarks a policy takes those "
                   "from poses");
  if (current() != prior.variables.front()) {
    throw bad_line(
        fmt::format("{}: expected a measurement of the newest pose before it ends (DONE)", name));
  }
}

bool PoseIntake::is_observation(const Factor& factor) const {
  return !factor.type->is_relative() && factor.variables.size() == 2 && current() &&
         std::ranges::count(factor.variables, *current()) == 1;
}

void PoseIntake::check_observation(const Factor& factor) const {
  const Id id = other_end(factor.variables);
  const std::string name = name_of(factor);
  const auto landmark = landmarks_.find(id);
  if (landmark == landmarks_.end()) {
    throw bad_line(fmt::format(
        "{}: there is no landmark {}; expected its line, such as 'NEW VERTEX_XY {}', first", name,
        id, id));
  }
  const VariableType& seen = *landmark->second;
  const auto tags = factor.type->variable_tags();
  const std::size_t of_pose = factor.variables[0] == id ? 1 : 0;
  if (tags[of_pose] != motions_->type().tag() || tags[1 - of_pose] != seen.tag())
    throw bad_line(fmt::format("{}: not a measurement of {} {} from a {}", name, seen.tag(), id,
                               motions_->type().tag()));
  if (seen.placement()->dimension() != motions_->type().placement()->dimension())
    throw bad_line(name + ": the poses are not where the landmark is");
}

void PoseIntake::add_measured(Id other, Factor factor) {
  if (!measured_) measured_ = Measured{other, {}};
  measured_->factors.push_back(std::move(factor));
}

void PoseIntake::add_observation(Factor factor) {
  const Id id = other_end(factor.variables);
  auto there = std::ranges::find(observations_, id, [](const LandmarkObservation& observation) {
    return observation.landmark.id;
  });
  if (there == observations_.end()) {
    there = observations_.insert(
        there, {{.type = landmarks_.at(id), .id = id, .state = {}, .fixed = false}, {}});
  }
  there->factors.push_back(std::move(factor));
}

// To the policy -----------------------------------------------------------------------------------

void PoseIntake::begun() {
  before_ = std::exchange(newest_, arriving_->pose.id);
  arriving_.reset();
  open_ = true;
}

void PoseIntake::ended(Id id, bool kept) {
  open_ = false;
  arrived_.insert(id);
  if (kept) kept_.insert(id);
}

void PoseIntake::left(Id id) {
  some_left_ = true;
  kept_.erase(id);
}

void PoseIntake::withdraw() {
  arriving_.reset();
  if (!newest_ && kept_.empty()) motions_.reset();
}

}  // namespace cairn
