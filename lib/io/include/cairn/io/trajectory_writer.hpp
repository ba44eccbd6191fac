// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "cairn/graph/graph.hpp"

namespace cairn {

/// The ability of a format that writes poses alone, without factors and without anything else.
class TrajectoryWriter {
 public:
  static constexpr std::string_view kAbility = "trajectory_writer";

  /// As `Format::write`. `stamps`: the time [s] of each pose, by rising id, in place of its id,
  /// where the format has times; empty: none.
  virtual std::string write_poses(const Graph& graph, std::span<const double> stamps) = 0;

 protected:
  ~TrajectoryWriter() = default;
};

}  // namespace cairn
