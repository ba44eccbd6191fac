// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "cairn/geometry/pose.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// A pose in 3D, whatever the graph's dimension (a planar pose lies in z = 0).
struct TrajectoryPose {
  Id id = 0;
  std::array<double, 3> t{};                           ///< position [m]
  std::array<double, 9> R{1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< rotation body → world, column-major
  std::optional<double> stamp;                         ///< time [s], if it is known
};

/// Poses by rising id.
using Trajectory = std::vector<TrajectoryPose>;

/// All poses of a graph (variables with orientation), by rising id. They have no stamps: a graph
/// does not know any, but the report of reading it may (`ReadReport::stamps`).
CAIRN_API Trajectory trajectory(const Graph& graph);

/// Whether a graph has poses, all of types of the plane, such as VERTEX_SE2.
CAIRN_API bool is_planar(const Graph& graph);
/// Whether all poses lie in z = 0, turned about z alone.
CAIRN_API bool is_planar(const Trajectory& poses);

/// Time stamps [s] of a text with one number per line, such as KITTI's times.txt; '#' begins a
/// comment. Throws `Error` (input) with file and line where one is no finite number or not above
/// the one before.
CAIRN_API std::vector<double> read_stamps(const std::filesystem::path& file);

// Frames ------------------------------------------------------------------------------------------

/// A trajectory whose world and body are a camera's (x right, y down, z forward), in a robot's (x
/// forward, y left, z up): T becomes C⁻¹ T C, where C takes a robot's coordinates to a camera's.
CAIRN_API Trajectory camera_to_robot_axes(Trajectory poses);

/// The projection on the plane z = 0: x, y, and for yaw the direction of the body's x axis. A body
/// whose x axis is vertical has none; its yaw is what rounding makes of it.
CAIRN_API Trajectory projected_to_plane(Trajectory poses);

// Pairs -------------------------------------------------------------------------------------------

/// Poses of an estimate and of the truth that are to be compared: the k-th of one with the k-th of
/// the other, at least two.
struct TrajectoryPairs {
  Trajectory estimate, truth;
  std::int64_t only_in_estimate = 0;  ///< poses without a partner
  std::int64_t only_in_truth = 0;
  double largest_difference = 0.0;  ///< of the stamps of a pair, where stamps made it [s]
};

/// Pairs poses of equal id. Throws `Error` (input) if fewer than two are in both.
CAIRN_API TrajectoryPairs pair_by_id(const Trajectory& estimate, const Trajectory& truth);

/// How stamps are compared.
struct StampMatching {
  double offset = 0.0;           ///< added to the stamps of the estimate [s]
  double max_difference = 0.01;  ///< up to which two stamps match [s]
};

/// Pairs poses by their stamps, in the order of time and each at most once: of all pairs that
/// differ by no more than `max_difference` the nearest first, then the nearest of what is left and
/// keeps the order. (Of equally near ones the earlier first.) All poses must have stamps. Throws
/// `Error` (input), with the times of both and what may help, if there are fewer than two pairs.
CAIRN_API TrajectoryPairs pair_by_stamp(const Trajectory& estimate, const Trajectory& truth,
                                        const StampMatching& matching = {});

/// Whether stamps are the better guide to which poses belong together: all have them, and in one of
/// the two at least they are something else than the ids.
CAIRN_API bool stamps_tell_more(const Trajectory& estimate, const Trajectory& truth);

// Errors ------------------------------------------------------------------------------------------

/// Root mean squares of errors of an estimate against the truth.
struct TrajectoryError {
  std::int64_t poses = 0;            ///< compared
  double ate_translation = 0.0;      ///< absolute, after rigid alignment [m]
  double ate_rotation = 0.0;         ///< [deg]
  double rpe_translation = 0.0;      ///< relative, between consecutive poses [m]
  double rpe_rotation = 0.0;         ///< [deg]
  double rpe_all_translation = 0.0;  ///< relative, over all pairs [m]
  double rpe_all_rotation = 0.0;     ///< [deg]
};

/// The rigid motion (Kabsch, no scale) that brings the positions of the estimate nearest to those
/// of the truth; about z where both lie in the plane. What positions leave open, the orientations
/// decide.
CAIRN_API Pose align(const TrajectoryPairs& pairs);

/// Compares poses after `align`. All-to-all errors go over all n(n-1)/2 pairs of instants.
CAIRN_API TrajectoryError compare(const TrajectoryPairs& pairs);
/// The same for poses of equal id.
CAIRN_API TrajectoryError compare(const Trajectory& estimate, const Trajectory& truth);
/// `ate_translation` of that alone [m], in linear time.
CAIRN_API double absolute_error(const Trajectory& estimate, const Trajectory& truth);

}  // namespace cairn
