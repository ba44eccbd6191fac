// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>

#include <Eigen/Core>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/program/session.hpp"

namespace cairn::app {

/// What is drawn over a map.
struct FloorDrawing {
  const FloorMap& map;
  std::span<const Eigen::Vector2d> trajectory = {};  ///< [m]
  std::optional<Eigen::Vector2d> robot = {};         ///< [m]
  std::span<const Eigen::Vector2d> path = {};        ///< planned, the corners of a polyline [m]
};

/// The known part of a map as lines of text of at most `width` columns and `height` lines. With
/// colour two squares per character (half blocks); without, '#' is an obstacle, '.' free floor, '+'
/// where the robot was, '@' where it is, and a character is as high as two are wide.
std::string floor_text(const FloorDrawing& drawing, std::size_t width, std::size_t height,
                       bool colour);

/// Prints it where standard output is a terminal.
void print_floor(const FloorDrawing& drawing, const Session& session);

}  // namespace cairn::app
