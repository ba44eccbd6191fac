// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cairn/geometry/pose_chain.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "cairn/policy/registration.hpp"

namespace cairn::test {

/// A policy after it has run over a recording, and what it said.
struct PolicyRun {
  std::unique_ptr<PosePolicy> policy;
  std::vector<PoseReport> reports;

  std::vector<Id> kept() const {
    std::vector<Id> ids;
    for (const PoseReport& report : reports) {
      if (report.kept) ids.push_back(report.id);
    }
    return ids;
  }
  /// Earlier and later pose of those with a verdict, in order.
  std::vector<std::pair<Id, Id>> links(LinkVerdict verdict = LinkVerdict::linked) const {
    std::vector<std::pair<Id, Id>> pairs;
    for (const PoseReport& report : reports) {
      for (const LinkReport& link : report.links) {
        if (link.verdict == verdict) pairs.emplace_back(link.earlier, link.later);
      }
    }
    return pairs;
  }
};

inline PolicyRun run(std::unique_ptr<PosePolicy> policy, Registration& registration,
                     const Graph& recording) {
  PolicyRun result{std::move(policy), {}};
  const std::vector<Arrival> poses = pose_chain(recording);
  run_policy(recording, poses, *result.policy, registration, [&](const PoseReport& report) {
    result.reports.push_back(report);
    return true;
  });
  return result;
}

inline PolicyRun run(Registry& registry, const Simulation& world, const std::string& policy,
                     const std::string& registration) {
  const auto matcher = registry.make<Registration>(registration);
  matcher->begin({.recording = &world.graph, .truth = &world.truth});
  return run(registry.make<PosePolicy>(policy), *matcher, world.graph);
}

inline Simulation simulate(Registry& registry, const std::string& generator,
                           std::uint64_t seed = 5) {
  return registry.make<Generator>(generator)->generate(registry, seed);
}

inline std::vector<Id> all_ids(const Graph& graph) {
  std::vector<Id> ids;
  for (const Arrival& pose : pose_chain(graph)) ids.push_back(graph.id(pose.pose()));
  return ids;
}

}  // namespace cairn::test
