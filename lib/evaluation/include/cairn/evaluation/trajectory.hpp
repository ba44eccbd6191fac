// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cairn/geometry/pose.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"

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
/// comment. Times since 1970 in other units are made seconds (`stamp_unit`), with a note. Throws
/// `Error` (input) with file and line where one is no finite number or below the one before.
CAIRN_API std::vector<double> read_stamps(const std::filesystem::path& file,
                                          std::vector<std::string>& notes);

/// The poses with these stamps [s], one for each by rising id, which must not fall. Of poses with
/// one stamp the first is kept, with a note.
CAIRN_API Trajectory with_stamps(Trajectory poses, const std::vector<double>& stamps,
                                 std::vector<std::string>& notes);

// Frames ------------------------------------------------------------------------------------------

/// A trajectory whose world and body are a camera's (x right, y down, z forward), in a robot's (x
/// forward, y left, z up): T becomes C⁻¹ T C, where C takes a robot's coordinates to a camera's.
CAIRN_API Trajectory camera_to_robot_axes(Trajectory poses);
/// The same of a file whose quaternions have w first, and were read as if it were last; with
/// `w_first` false the reverse.
CAIRN_API Trajectory with_quaternions_of_order(Trajectory poses, bool w_first);
/// The same for the states of a graph without factors, whose measurements would be wrong after it:
/// poses turn, points move. Throws `Error` (input) where it has factors, variables of the plane,
/// which no camera's axes fit, or poses with more than a pose in their states.
CAIRN_API void camera_to_robot_axes(Graph& trajectory);

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

/// What a pairing by id rests on where ids are the numbers of a file's rows
/// (`ReadReport::row_ids`).
enum class RowPairing {
  none,       ///< both files have ids of their own
  complete,   ///< every pose has a partner
  partial,    ///< some have none: right only if both begin with the same pose and skip none
  unfounded,  ///< the same, and one of the two has times, so that rows are no ids
};
/// Of pairs by id; `estimate_rows`, `truth_rows`: whether the ids of that file are row numbers.
CAIRN_API RowPairing row_pairing(const TrajectoryPairs& pairs, bool estimate_rows, bool truth_rows);

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

/// What brings an estimate nearest to the truth before the two are compared.
enum class Alignment {
  rigid,       ///< a rigid motion (Kabsch 1976)
  similarity,  ///< and a scale (Umeyama 1991), which the estimate of a single camera lacks
};

/// Root mean squares of errors of an estimate against the truth.
struct TrajectoryError {
  std::int64_t poses = 0;            ///< compared
  double scale = 1.0;                ///< by which the positions of the estimate were multiplied
  double ate_translation = 0.0;      ///< absolute, after alignment [m]
  double ate_rotation = 0.0;         ///< [deg]
  double rpe_translation = 0.0;      ///< relative, between consecutive poses [m]
  double rpe_rotation = 0.0;         ///< [deg]
  double rpe_all_translation = 0.0;  ///< relative, over all pairs [m]
  double rpe_all_rotation = 0.0;     ///< [deg]

  CAIRN_API static ResultFields<TrajectoryError> fields();
};

/// The rigid motion (Kabsch, no scale) that brings the positions of the estimate nearest to those
/// of the truth; about z where both lie in the plane. What positions leave open, the orientations
/// decide.
CAIRN_API Pose align(const TrajectoryPairs& pairs);

/// The scale s of the similarity that minimises Σ ‖truth − (s R estimate + t)‖² over positions
/// (Umeyama 1991, in the plane about z). Throws `Error` (input) where positions do not determine
/// it: all of one trajectory in one point.
CAIRN_API double aligning_scale(const TrajectoryPairs& pairs);

/// `aligning_scale`, where it explains the error: it differs from 1 by more than 2 %, and less than
/// a quarter of the ATE is left with it (of 9 poses and fewer, from 4, less than that: what it
/// explains must be 300 times what is left per degree of freedom). Over a drive with random errors
/// a scale leaves more than half in most cases.
CAIRN_API std::optional<double> explaining_scale(const TrajectoryPairs& pairs);

/// One of two trajectories in the axes of a camera, where the other is in those of a robot.
struct CameraAxes {
  bool of_estimate = false;   ///< else of the truth
  double ate_rotation = 0.0;  ///< with that one turned (`camera_to_robot_axes`) [deg]
};

/// Where orientations are off by about the 120° between a camera's axes and a robot's
/// (`ate_rotation` [deg], of `pairs`), and agree when one of the two is turned. In linear time.
CAIRN_API std::optional<CameraAxes> camera_axes_of_one(const TrajectoryPairs& pairs,
                                                       double ate_rotation);

/// Compares poses after `align`, or after scaling the estimate and then `align`, for all errors
/// alike. All-to-all errors go over all n(n-1)/2 pairs of instants.
CAIRN_API TrajectoryError compare(const TrajectoryPairs& pairs,
                                  Alignment alignment = Alignment::rigid);
/// The same for poses of equal id.
CAIRN_API TrajectoryError compare(const Trajectory& estimate, const Trajectory& truth);
/// `ate_translation` of that alone [m], in linear time.
CAIRN_API double absolute_error(const Trajectory& estimate, const Trajectory& truth);
/// How far the orientations are from those of the truth after `align` [deg], a root mean square:
/// `TrajectoryError::ate_rotation` alone, in linear time.
CAIRN_API double rotation_error(const TrajectoryPairs& pairs);

}  // namespace cairn
