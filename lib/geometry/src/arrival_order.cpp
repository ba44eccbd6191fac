// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/arrival_order.hpp"

#include <algorithm>
#include <cstddef>
#include <limits>

namespace cairn {
namespace {

constexpr int kNever = std::numeric_limits<int>::max();

bool is_pose(const Graph& graph, int variable) {
  const Placement* placement = graph.type(variable).placement();
  return !placement || placement->has_orientation();
}

/// The step of each pose; kNever for all else.
std::vector<int> steps_of_poses(const Graph& graph, int& steps) {
  std::vector<int> poses;
  for (int v = 0; v < graph.variable_count(); ++v) {
    if (is_pose(graph, v)) poses.push_back(v);
  }
  std::ranges::stable_sort(poses, {}, [&](int v) { return graph.id(v); });
  std::vector<int> step(static_cast<std::size_t>(graph.variable_count()), kNever);
  for (std::size_t k = 0; k < poses.size(); ++k) step[poses[k]] = static_cast<int>(k);
  steps = std::max(1, static_cast<int>(poses.size()));
  return step;
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

}  // namespace

std::vector<Arrival> arrival_order(const Graph& graph) {
  int steps = 0;
  std::vector<int> step = steps_of_poses(graph, steps);
  settle_landmarks(graph, step);
  std::vector<Arrival> arrivals(static_cast<std::size_t>(steps));
  for (int pass = 0; pass < 2; ++pass) {  // poses, then what they see
    for (int v = 0; v < graph.variable_count(); ++v) {
      if (is_pose(graph, v) == (pass == 0))
        arrivals[std::min(step[v], steps - 1)].variables.push_back(v);
    }
  }
  for (int f = 0; f < graph.factor_count(); ++f) {
    int latest = 0;
    for (const std::int32_t v : graph.factor_variables(f))
      latest = std::max(latest, std::min(step[v], steps - 1));
    arrivals[latest].factors.push_back(f);
  }
  return arrivals;
}

bool in_arrival_order(const std::vector<Arrival>& arrivals) {
  int last_pose = -1, last_factor = -1;
  for (const Arrival& arrival : arrivals) {
    if (!arrival.variables.empty()) {
      if (arrival.variables.front() < last_pose) return false;
      last_pose = arrival.variables.front();
    }
    for (const int f : arrival.factors) {
      if (f < last_factor) return false;
      last_factor = f;
    }
  }
  return true;
}

}  // namespace cairn
