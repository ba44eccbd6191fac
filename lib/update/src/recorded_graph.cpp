// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/update/recorded_graph.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <utility>

#include <fmt/core.h>

#include "cairn/geometry/pose.hpp"
#include "cairn/geometry/pose_chain.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/update/graph_update.hpp"

namespace cairn {
namespace {

constexpr int kNever = std::numeric_limits<int>::max();

/// Whether each variable is a step of its own: those with an orientation. What has no position at
/// all, such as a velocity or a bias, travels with a pose, unless there is none.
std::vector<bool> find_poses(const Graph& graph) {
  const bool oriented = std::ranges::any_of(graph.variable_pools(), [](const VariablePool& pool) {
    return has_orientation(*pool.type) && !pool.variables.empty();
  });
  std::vector<bool> poses(static_cast<std::size_t>(graph.variable_count()));
  for (int v = 0; v < graph.variable_count(); ++v)
    poses[v] = oriented ? has_orientation(graph.type(v)) : !is_point(graph.type(v));
  return poses;
}

/// The step of each pose; kNever for all else.
std::vector<int> steps_of_poses(const Graph& graph, const std::vector<bool>& is_step, int& steps) {
  std::vector<int> poses;
  for (int v = 0; v < graph.variable_count(); ++v) {
    if (is_step[v]) poses.push_back(v);
  }
  std::ranges::stable_sort(poses, {}, [&](int v) { return graph.id(v); });
  std::vector<int> step(static_cast<std::size_t>(graph.variable_count()), kNever);
  for (std::size_t k = 0; k < poses.size(); ++k) step[poses[k]] = static_cast<int>(k);
  steps = std::max(1, static_cast<int>(poses.size()));
  return step;
}

/// What has no position comes with the first factor that ties it to poses, when the latest of these
/// is there. (Two velocities of one factor would wait for each other if they waited for all else.)
void settle_passengers(const Graph& graph, std::vector<int>& step) {
  const std::vector<int> poses = step;
  for (int f = 0; f < graph.factor_count(); ++f) {
    const auto on = graph.factor_variables(f);
    int latest = -1;
    for (const std::int32_t v : on) {
      if (poses[v] != kNever) latest = std::max(latest, poses[v]);
    }
    if (latest < 0) continue;
    for (const std::int32_t v : on) {
      if (poses[v] == kNever && !has_position(graph.type(v))) step[v] = std::min(step[v], latest);
    }
  }
}

/// A landmark comes with the first factor that it shares with nothing that comes later. Landmarks
/// that only other landmarks meet follow these; so this is repeated while anything changes.
void settle_landmarks(const Graph& graph, std::vector<int>& step) {
  const std::vector<int> poses = step;
  for (bool changed = true; changed;) {
    changed = false;
    for (int f = 0; f < graph.factor_count(); ++f) {
      const auto on = graph.factor_variables(f);
      for (const std::int32_t v : on) {
        if (poses[v] != kNever || on.size() < 2) continue;
        int latest = 0;
        for (const std::int32_t other : on) {
          if (other != v) latest = std::max(latest, step[other]);
        }
        if (latest < step[v]) {
          step[v] = latest;
          changed = true;
        }
      }
    }
  }
}

/// Whether a factor is on these two variables, either way round, and on nothing else.
bool joins(const Graph& graph, int factor, int a, int b) {
  const auto on = graph.factor_variables(factor);
  return on.size() == 2 && ((on[0] == a && on[1] == b) || (on[0] == b && on[1] == a));
}

}  // namespace

std::vector<Arrival> arrival_order(const Graph& graph) {
  int steps = 0;
  const std::vector<bool> is_step = find_poses(graph);
  std::vector<int> step = steps_of_poses(graph, is_step, steps);
  settle_passengers(graph, step);
  settle_landmarks(graph, step);
  std::vector<Arrival> arrivals(static_cast<std::size_t>(steps));
  for (const bool pass : {true, false}) {  // poses, then what comes with them
    for (int v = 0; v < graph.variable_count(); ++v) {
      if (is_step[v] == pass) arrivals[std::min(step[v], steps - 1)].variables.push_back(v);
    }
  }
  for (int f = 0; f < graph.factor_count(); ++f) {
    int latest = 0;
    for (const std::int32_t v : graph.factor_variables(f))
      latest = std::max(latest, std::min(step[v], steps - 1));
    const bool odometry =
        latest > 0 && joins(graph, f, arrivals[latest].pose(), arrivals[latest - 1].pose());
    (odometry ? arrivals[latest].odometry : arrivals[latest].links).push_back(f);
  }
  return arrivals;
}

bool in_arrival_order(const std::vector<Arrival>& arrivals) {
  int last_pose = -1, last_factor = -1;
  for (const Arrival& arrival : arrivals) {
    if (!arrival.variables.empty()) {
      if (arrival.pose() < last_pose) return false;
      last_pose = arrival.pose();
    }
    int latest = last_factor;
    for (const auto* factors : {&arrival.odometry, &arrival.links}) {  // each rises
      if (factors->empty()) continue;
      if (factors->front() < last_factor) return false;
      latest = std::max(latest, factors->back());
    }
    last_factor = latest;
  }
  return true;
}

// Pose graphs -------------------------------------------------------------------------------------

namespace {

Error bad_input(const std::string& message) { return {ErrorCode::input, message}; }

/// Whether all variables are landmarks, or poses of one type.
void check_poses(const Graph& graph) {
  int first = -1;
  for (int v = 0; v < graph.variable_count(); ++v) {
    const VariableType& type = graph.type(v);
    if (is_point(type)) continue;
    if (!is_pose(type)) {
      throw bad_input(
          fmt::format("{} is not a pose of a Lie group, and this takes trajectories only: a "
                      "robot's poses, relative poses between them, absolute measurements of them, "
                      "and landmarks that are seen from them",
                      graph.describe_variable(v)));
    }
    if (first < 0) first = v;
    if (graph.pool(v) != graph.pool(first)) {
      throw bad_input(fmt::format("{} and {} are poses of different types; a trajectory has one",
                                  graph.describe_variable(first), graph.describe_variable(v)));
    }
  }
  if (first < 0 && graph.variable_count() > 0)
    throw bad_input(
        fmt::format("{} and all others are points, and this takes a trajectory: poses with "
                    "odometry between them",
                    graph.describe_variable(0)));
}

/// How many of the variables of a factor are landmarks.
int landmarks_of(const Graph& graph, int factor) {
  return static_cast<int>(std::ranges::count_if(
      graph.factor_variables(factor), [&](std::int32_t v) { return is_point(graph.type(v)); }));
}

bool is_observation(const Graph& graph, int factor) {
  return graph.factor_variables(factor).size() == 2 && landmarks_of(graph, factor) == 1;
}

void check_factors(const Graph& graph) {
  for (int f = 0; f < graph.factor_count(); ++f) {
    const FactorType& type = graph.factor_type(f);
    const int landmarks = landmarks_of(graph, f);
    if (landmarks == 0 && (type.is_relative() || type.arity() == 1)) continue;
    if (is_observation(graph, f)) continue;
    throw bad_input(
        fmt::format("{} is neither the motion from one pose to another, nor a measurement of a "
                    "single pose, nor of a landmark from a pose: leave it out",
                    graph.describe_factor(f)));
  }
}

/// Moves the links for which `chosen` is true to `others`.
template <class Chosen>
void separate(std::vector<int>& links, std::vector<int>& others, const Chosen& chosen) {
  const auto first = std::stable_partition(links.begin(), links.end(), std::not_fn(chosen));
  others.assign(first, links.end());
  links.erase(first, links.end());
}

/// Says why there is no odometry from a pose to the next by id.
[[noreturn]] void refuse_gap(const Graph& graph, int before, int pose) {
  const Gauge gauge = resolve_gauge(graph);
  const std::string here = graph.describe_variable(pose), there = graph.describe_variable(before);
  if (gauge.component[pose] != gauge.component[before]) {
    throw bad_input(fmt::format(
        "no measurements lead from {} to {}, the next by id: the graph has {} parts whose relative "
        "poses are unknown, and a trajectory is one of them; give each part in a file of its own, "
        "or the pose at which to begin (begin={}), without those before it",
        there, here, gauge.components, graph.id(pose)));
  }
  throw bad_input(fmt::format(
      "no factor joins {} to {}, the pose before it by id: odometry must be unbroken and ids "
      "increase along the trajectory; if the poses before it are of an earlier session, give the "
      "first one of this session, at which to begin (begin={})",
      here, there, graph.id(pose)));
}

}  // namespace

std::vector<Arrival> pose_chain(const Graph& graph, std::optional<Id> begin) {
  check_poses(graph);
  check_factors(graph);
  if (graph.variable_count() == 0) return {};
  std::vector<Arrival> chain = arrival_order(graph);
  for (Arrival& arrival : chain) {
    separate(arrival.links, arrival.priors,
             [&](int f) { return graph.factor_variables(f).size() == 1; });
    separate(arrival.links, arrival.observations, [&](int f) { return is_observation(graph, f); });
  }
  if (begin) {
    const auto first = std::ranges::find(
        chain, *begin, [&](const Arrival& arrival) { return graph.id(arrival.pose()); });
    if (first == chain.end())
      throw bad_input(fmt::format("there is no pose {} at which to begin", *begin));
    chain.erase(chain.begin(), first);
    chain.front().odometry.clear();
  }
  for (std::size_t k = 1; k < chain.size(); ++k) {
    if (chain[k].odometry.empty()) refuse_gap(graph, chain[k - 1].pose(), chain[k].pose());
  }
  return chain;
}

// Updates -----------------------------------------------------------------------------------------

GraphUpdate arrival_update(const Graph& graph, const Arrival& arrival) {
  GraphUpdate update;
  for (const int v : arrival.variables) update.variables.push_back(graph.variable(v));
  for (const auto* factors :
       {&arrival.odometry, &arrival.links, &arrival.priors, &arrival.observations}) {
    for (const int f : *factors) update.factors.push_back(graph.factor(f));
  }
  return update;
}

int leave_states_to_factors(GraphUpdate& update, Estimator& estimator) {
  std::vector<std::vector<double>> recorded;
  for (Variable& variable : update.variables) {
    recorded.push_back(variable.state);
    if (!variable.fixed) variable.state.clear();
  }
  GraphUpdate trial = update;
  const std::vector<int> unplaced = place_variables(trial, [&](Id id) {
    return estimator.has(id) ? estimator.state(id) : std::span<const double>();
  });
  for (const int k : unplaced) update.variables[k].state = std::move(recorded[k]);
  return static_cast<int>(std::ssize(unplaced));
}

}  // namespace cairn
