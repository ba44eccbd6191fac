// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "cairn/exploration/exploration.hpp"
#include "cairn/plugin/options.hpp"
#include "cairn/plugin/registry.hpp"

namespace cairn::test {

/// Robots: one without noise to speak of, and one with odometry that is 5 % off.
inline constexpr const char* kExactRobot =
    "lidar_building:relative=0,sigma_xy=1e-6,sigma_theta=1e-6,range_sigma=0";
inline constexpr const char* kNoisyRobot = "lidar_building:relative=0.05";
/// A registration that knows the truth.
inline constexpr const char* kTrueMatcher =
    "simulated:range=1.4,angle=0.35,sigma_translation=0.02,sigma_rotation=0.002";

/// A generated floor by the name of its plan, such as "rooms:width=12,height=9".
OccupancyGrid floor_named(const std::string& plan, std::uint64_t seed);

/// The parts of an exploration, by name.
struct ExplorationParts {
  explicit ExplorationParts(const std::string& world_name,
                            const std::string& explorer_name = "frontier");

  template <class Interface>
  std::unique_ptr<Interface> make(const std::string& name) {
    return registry.make<Interface>(parse_component(name));
  }
  /// A run of them; what it refers to must outlive it.
  Exploration on(const OccupancyGrid& floor, std::uint64_t seed = 1);

  Registry registry;
  std::unique_ptr<World> world;
  std::unique_ptr<PosePolicy> policy;
  std::unique_ptr<Registration> registration;
  std::unique_ptr<Mapper> mapper;
  std::unique_ptr<Explorer> explorer;
};

/// A run, and all that was decided in it.
struct DecidedRun {
  ExplorationResult result;
  std::vector<Decision> decisions;
};
DecidedRun explore(const std::string& plan, const std::string& world, const std::string& explorer,
                   const ExplorationLimits& limits, std::uint64_t seed = 3);

}  // namespace cairn::test
