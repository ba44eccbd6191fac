// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "cairn/io/generator.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "cairn/policy/registration.hpp"

namespace cairn::test {

/// A policy after it has run over a recording, and what it said.
struct PolicyRun {
  std::unique_ptr<PosePolicy> policy;
  std::vector<PoseReport> reports;

  std::vector<Id> kept() const;
  /// Earlier and later pose of those with a verdict, in order.
  std::vector<std::pair<Id, Id>> links(LinkVerdict verdict = LinkVerdict::linked) const;
};

/// Runs it over the recording to the end.
PolicyRun run(std::unique_ptr<PosePolicy> policy, Registration& registration,
              const Graph& recording);
/// A policy and a registration by their specs.
PolicyRun run(Registry& registry, const Simulation& world, const std::string& policy,
              const std::string& registration);

Simulation simulate(Registry& registry, const std::string& generator, std::uint64_t seed = 5);

/// Of the poses, in the order of the way.
std::vector<Id> all_ids(const Graph& graph);

}  // namespace cairn::test
