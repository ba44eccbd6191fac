// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/program/graph_files.hpp"
#include "cairn/program/session.hpp"

namespace cairn::app {

/// Turns a trajectory in the axes of a camera (x right, y down, z ahead) to those of a robot (x
/// ahead, y left, z up): one that was read as KITTI, with a note, unless `axes` says robot, and
/// whatever has no factors where it says camera. Throws `Error` (input) where a trajectory has no
/// such axes.
void show_in_robot_axes(LoadedGraph& loaded, const std::string& axes, const Session& session);

/// Turns what was read where `axes` says camera. Throws `Error` (input) where that cannot be.
void turn_to_robot_axes(LoadedGraph& loaded, const std::string& axes);

}  // namespace cairn::app
