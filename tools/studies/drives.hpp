// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "cairn/exploration/exploration.hpp"
#include "cairn/plugin/options.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/interrupt.hpp"
#include "cairn/program/progress.hpp"
#include "cairn/program/session.hpp"
#include "slam_names.hpp"

namespace cairn::app {

/// The explorations that a study of paths looks at.
struct DriveOptions {
  std::string floor{};
  std::string explorer = "frontier", world = "lidar_building", planner = "grid_dijkstra";
  SlamNames slam{};
  int runs = 1;
  std::uint64_t seed = 1;

  static OptionFields<DriveOptions> fields();
};

/// Explores a floor with one seed after the other. Interrupts end it while it exists.
class StudyDrives {
 public:
  /// What a robot is made of.
  struct Parts {
    std::unique_ptr<World> world;
    std::unique_ptr<PosePolicy> policy;
    std::unique_ptr<Registration> registration;
    std::unique_ptr<Mapper> mapper;
    std::unique_ptr<Explorer> explorer;
  };

  StudyDrives(const DriveOptions& options, Session& session);

  /// Calls `drive(seed)` once for each run, until it is interrupted.
  void each(const std::function<void(std::uint64_t)>& drive);
  /// New ones, by their names.
  Parts parts() const;
  /// A run of these parts on the floor.
  Exploration exploration(Parts& parts, std::uint64_t seed) const;

  template <class Part>
  std::unique_ptr<Part> make(const std::string& name) const {
    return session_.registry().make<Part>(parse_component(name));
  }
  Session& session() const { return session_; }
  StatusLine& line() { return line_; }
  bool interrupted() const { return guard_.interrupted(); }

 private:
  const DriveOptions& options_;
  Session& session_;
  OccupancyGrid floor_;
  InterruptGuard guard_;
  StatusLine line_;
};

}  // namespace cairn::app
