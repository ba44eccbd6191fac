// SPDX-License-Identifier: BSD-3-Clause
#include "compact/support/policy_runs.hpp"

#include "cairn/geometry/pose_chain.hpp"

namespace cairn::test {

std::vector<Id> PolicyRun::kept() const {
  std::vector<Id> ids;
  for (const PoseReport& report : reports) {
    if (report.kept) ids.push_back(report.id);
  }
  return ids;
}

std::vector<std::pair<Id, Id>> PolicyRun::links(LinkVerdict verdict) const {
  std::vector<std::pair<Id, Id>> pairs;
  for (const PoseReport& report : reports) {
    for (const LinkReport& link : report.links) {
      if (link.verdict == verdict) pairs.emplace_back(link.earlier, link.later);
    }
  }
  return pairs;
}

PolicyRun run(std::unique_ptr<PosePolicy> policy, Registration& registration,
              const Graph& recording) {
  PolicyRun result{std::move(policy), {}};
  const std::vector<Arrival> poses = pose_chain(recording);
  run_policy(recording, poses, *result.policy, registration, [&](const PoseReport& report) {
    result.reports.push_back(report);
    return true;
  });
  return result;
}

PolicyRun run(Registry& registry, const Simulation& world, const std::string& policy,
              const std::string& registration) {
  const auto matcher = registry.make<Registration>(registration);
  matcher->begin({.recording = &world.graph, .truth = &world.truth});
  return run(registry.make<PosePolicy>(policy), *matcher, world.graph);
}

Simulation simulate(Registry& registry, const std::string& generator, std::uint64_t seed) {
  return registry.make<Generator>(generator)->generate(registry, seed);
}

std::vector<Id> all_ids(const Graph& graph) {
  std::vector<Id> ids;
  for (const Arrival& pose : pose_chain(graph)) ids.push_back(graph.id(pose.pose()));
  return ids;
}

}  // namespace cairn::test
