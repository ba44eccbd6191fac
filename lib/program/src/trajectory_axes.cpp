// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/trajectory_axes.hpp"

#include <fmt/core.h>

#include "cairn/evaluation/trajectory.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::app {

void show_in_robot_axes(LoadedGraph& loaded, const std::string& axes, const Session& session) {
  if (loaded.graph.factor_count() > 0 || axes == "robot") return;
  if (axes.empty() && loaded.report.format != "kitti") return;
  turn_to_robot_axes(loaded, "camera");
  if (!axes.empty()) return;
  session.note(
      fmt::format("{}: KITTI's axes are those of a camera, and are shown as a robot's, x "
                  "ahead and z up; --axes robot shows them as they are",
                  loaded.name));
}

void turn_to_robot_axes(LoadedGraph& loaded, const std::string& axes) {
  if (axes != "camera") return;
  try {
    camera_to_robot_axes(loaded.graph);
  } catch (const Error& error) {
    throw Error(error.code(), fmt::format("{}: --axes camera: {}", loaded.name, error.what()));
  }
}

}  // namespace cairn::app
