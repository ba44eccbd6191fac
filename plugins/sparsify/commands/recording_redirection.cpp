// SPDX-License-Identifier: BSD-3-Clause
#include "recording_redirection.hpp"

#include <algorithm>
#include <cstdlib>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/geometry/state_group.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/update/recorded_graph.hpp"

namespace cairn::app {
namespace {

/// The poses of a recording by number, and the odometry between them.
class Trajectory {
 public:
  explicit Trajectory(const Graph& recording)
      : recording_(recording), number_(recording.variable_count(), -1) {
    for (const Arrival& arrival : arrival_order(recording)) {
      if (arrival.variables.empty() || !recording.type(arrival.pose()).lie_group()) continue;
      number_[arrival.pose()] = static_cast<int>(std::ssize(poses_));
      poses_.push_back(arrival.pose());
      odometry_.push_back(first_relative(arrival));
    }
  }

  /// -1: no pose.
  int number(int variable) const { return number_[variable]; }
  int pose(int number) const { return poses_[number]; }

  /// The pose of node `to` from node `from` by odometry.
  std::vector<double> motion(int from, int to) const {
    const StateGroup group(recording_.type(poses_[from]));
    std::vector<double> z = group.identity();
    for (int n = std::min(from, to) + 1; n <= std::max(from, to); ++n)
      z = group.compose(z, step(group, n));
    return from <= to ? z : group.inverse(z);
  }

 private:
  std::optional<int> first_relative(const Arrival& arrival) const {
    const auto found = std::ranges::find_if(
        arrival.odometry, [&](int f) { return recording_.type_of_factor(f)->is_relative(); });
    return found == arrival.odometry.end() ? std::nullopt : std::optional(*found);
  }

  /// Pose `number` from the one before.
  std::vector<double> step(const StateGroup& group, int number) const {
    const std::optional<int> f = odometry_[number];
    if (!f) {
      throw Error(ErrorCode::input,
                  fmt::format("no factor measures {} relative to {}, and --redirect beforehand "
                              "composes odometry: choose --redirect early or late",
                              recording_.describe_variable(poses_[number]),
                              recording_.describe_variable(poses_[number - 1])));
    }
    std::vector<double> z = recording_.factor(*f).measurement;
    return recording_.factor_variables(*f)[0] == poses_[number] ? group.inverse(z) : z;
  }

  const Graph& recording_;
  std::vector<int> number_, poses_;
  std::vector<std::optional<int>> odometry_;  ///< by number, from the pose before
};

int nearest_that_stays(int leaving, int newest, int keep_every) {
  const int nearest = keep_every * ((leaving + 1 + keep_every / 2) / keep_every);
  return nearest > newest ? nearest - keep_every : nearest;
}

}  // namespace

RedirectedRecording redirect_recording(const Graph& recording, int keep_every) {
  const Trajectory trajectory(recording);
  RedirectedRecording result;
  for (int v = 0; v < recording.variable_count(); ++v) {
    const int added =
        result.graph.add_variable(recording.type_of(v), recording.id(v), recording.state(v));
    result.graph.set_fixed(added, recording.fixed(v));
  }
  for (int f = 0; f < recording.factor_count(); ++f) {
    Factor factor = recording.factor(f);
    const auto on = recording.factor_variables(f);
    if (on.size() == 2 && factor.type->is_relative()) {
      const int ends[] = {trajectory.number(on[0]), trajectory.number(on[1])};
      const int old = ends[0] < ends[1] ? 0 : 1, leaving = ends[old], newest = ends[1 - old];
      if (leaving >= 0 && newest - leaving > 1 && leaving % keep_every != 0) {
        const int stays = nearest_that_stays(leaving, newest, keep_every);
        if (stays == newest) {
          ++result.dropped;
          continue;
        }
        const StateGroup group(recording.type(on[old]));
        factor.variables[old] = recording.id(trajectory.pose(stays));
        factor.measurement =
            old == 0 ? group.compose(trajectory.motion(stays, leaving), factor.measurement)
                     : group.compose(factor.measurement, trajectory.motion(leaving, stays));
        ++result.redirected;
      }
    }
    result.graph.add(factor);
  }
  return result;
}

}  // namespace cairn::app
