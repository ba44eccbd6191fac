// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <initializer_list>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "cairn/plugin/registry.hpp"
#include "integration/process.hpp"

namespace cairn::test {

/// A registration that knows the truth.
inline constexpr const char* kTrueMatcher =
    "simulated:range=1.4,angle=0.35,sigma_translation=0.01,sigma_rotation=0.002";

/// Commands that explore generated rooms. Skipped, visibly, in a build that lacks a part.
class ExplorationCommands : public ::testing::Test {
 protected:
  using Part = std::pair<const char*, const char*>;  ///< kind and name

  void SetUp() override {
    need({{"world", "lidar_building"},
          {"mapper", "log_odds"},
          {"explorer", "frontier"},
          {"explorer", "drrt_star"},
          {"path_planner", "grid_dijkstra"},
          {"floor_plan", "rooms"},
          {"pose_policy", "compact_pose"}});
  }
  static void need(std::initializer_list<Part> parts) {
    const Registry registry;
    for (const auto& [kind, name] : parts) {
      if (!registry.has(kind, name)) GTEST_SKIP() << "built without " << name;
    }
  }
  /// What a command with these words says.
  static Outcome run(Arguments words, const Arguments& more) {
    words.insert(words.end(), more.begin(), more.end());
    return cairn(words);
  }

  TemporaryFolder folder_;
};

}  // namespace cairn::test
