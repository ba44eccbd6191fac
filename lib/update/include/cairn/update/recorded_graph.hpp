// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/graph/update.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/solve/estimator.hpp"

namespace cairn {

/// One step of a recording: a pose, what it sees for the first time, what travels with it (a
/// velocity, a bias), and the measurements that became possible with it.
struct Arrival {
  std::vector<int> variables;  ///< by index in the graph: the pose first
  /// Factors between this pose and the one before, in either direction; by position in the graph.
  std::vector<int> odometry;
  std::vector<int> links;  ///< all other factors, by position: loop closures, landmarks, priors
  /// In a `pose_chain`, where `links` are between poses: factors on this pose alone, and those on
  /// this pose and a landmark; by position.
  std::vector<int> priors, observations;

  int pose() const { return variables.front(); }
};

/// The order in which a graph was recorded. A step is a pose, in the order of ids,
/// with everything else of which it is the latest: the factors whose other variables are there, and
/// the landmarks that no earlier pose has seen. Every variable and every factor is in one step. A
/// pose is what has an orientation. What has no position, such as a velocity, a bias or a
/// calibration, comes with the first factor that ties it to poses; in a graph without orientations
/// it is a step as a pose is. Variables that no pose ever meets come with the last step (a graph of
/// points is one step).
CAIRN_API std::vector<Arrival> arrival_order(const Graph& graph);

/// Whether a graph lists its poses and factors in the order in which they arrived.
CAIRN_API bool in_arrival_order(const std::vector<Arrival>& arrivals);

/// The same for a trajectory with unbroken odometry, which may see landmarks; none for an empty
/// graph. Throws `Error` (input), with what would work, for anything else: a variable that is
/// neither a point nor a pose of a Lie group, or a pose of another type than the first; a factor
/// that is neither relative, nor on one pose, nor on a pose and a landmark; a pose without a factor
/// to the one before. With `begin`, only the poses from this id on, without
/// odometry of the first: those before it are of earlier sessions, and need no odometry. Throws
/// `Error` (input) if it is not there.
CAIRN_API std::vector<Arrival> pose_chain(const Graph& graph, std::optional<Id> begin = {});

/// What a step brings to an estimator: its variables with their recorded states, then its odometry,
/// its links, its priors and its observations, so that a pose without a state is initialised from
/// its odometry.
CAIRN_API GraphUpdate arrival_update(const Graph& graph, const Arrival& arrival);

/// Leaves the initial states to the estimator: empties those of new variables that are not fixed
/// and that a factor of the update can compute from the current estimate. Returns how many others
/// keep theirs.
CAIRN_API int leave_states_to_factors(GraphUpdate& update, Estimator& estimator);

}  // namespace cairn
