// SPDX-License-Identifier: BSD-3-Clause
// An explorer that drives to the longest frontier, however far it is.
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "cairn/exploration/explorer.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/registry.hpp"

namespace {

struct LongestOptions {
  double smallest = 0.5;
  static auto fields() {
    return cairn::OptionFields<LongestOptions>().real("smallest", &LongestOptions::smallest, 0.0,
                                                      100.0, "shorter frontiers are left [m]");
  }
};

class Longest final : public cairn::Explorer {
 public:
  Longest(const LongestOptions& options, std::unique_ptr<cairn::PathPlanner> planner)
      : options_(options), planner_(std::move(planner)) {}

  void begin(std::uint64_t) override {}

  cairn::Decision decide(const cairn::Situation& now) override {
    cairn::Decision decision;
    planner_->start(now.map, now.pose.translation(), now.robot.radius);
    for (const cairn::Frontier& frontier : now.map.frontiers) {  // longest first
      if (frontier.length < options_.smallest) break;
      auto path = planner_->path_to(frontier.middle, 2.0);
      std::size_t passed = 0;
      if (!path || !cairn::next_motion(now.pose, *path, now.robot, passed)) continue;
      decision.why = "to the longest frontier";
      decision.candidates.push_back({std::move(*path), -frontier.length, "the longest frontier"});
      return decision;
    }
    decision.kind = cairn::Decision::Kind::finished;
    decision.why = "no frontier is left";
    return decision;
  }

 private:
  LongestOptions options_;
  std::unique_ptr<cairn::PathPlanner> planner_;
};

}  // namespace

void cairn_register(cairn::Registrar& registrar) {
  registrar.add<cairn::Explorer, LongestOptions>("longest", [](const LongestOptions& options,
                                                               cairn::Registry& registry) {
    return std::make_unique<Longest>(options, registry.make<cairn::PathPlanner>("grid_dijkstra"));
  });
}
