// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>

#include "cairn/graph/graph.hpp"

namespace cairn::formats {

// Each writes a whole graph as `Format::write` does. Numbers are the shortest that read back as the
// same double, so that a graph that was written and read again is the same to the last bit.

/// Variables by rising id, then FIX lines, then factors in their order, of whatever types.
std::string write_g2o(const Graph& graph);
/// Pose graphs: VERTEX2 and EDGE2, in space VERTEX3 and EDGE3, whose rotations are rounded to
/// angles.
std::string write_toro(const Graph& graph);
/// Cameras and points, each numbered by rising id, and observations in their order. Rotations and
/// translations are those of the file that was read but for rounding.
std::string write_bal(const Graph& graph);
/// Poses by rising id: the time as stamp, or the id where there are not as many `stamps` as poses,
/// position, quaternion. Points (landmarks), velocities and all else are no part of a trajectory.
std::string write_tum(const Graph& graph, std::span<const double> stamps);
/// Poses by rising id: rows of [R t]. The row number is the id, so ids must be 0, 1, 2 …, or
/// symbols of one letter with these numbers, without a gap.
std::string write_kitti(const Graph& graph, std::span<const double> stamps);

}  // namespace cairn::formats
