// SPDX-License-Identifier: BSD-3-Clause
// Short paths by RRT*: one tree from where the robot is, for any number of goals.
#include "cairn/planning/rrt_star.hpp"

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "cairn/exploration/path_planner.hpp"
#include "cairn/exploration/random_stream.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/registry.hpp"

namespace cairn::exploration {
namespace {

using Eigen::Vector2d;

struct RrtStarPlannerOptions {
  double density = 5.0, step = 0.5, reach = 2.0;
  int seed = 1;

  static auto fields() {
    using O = RrtStarPlannerOptions;
    return OptionFields<O>()
        .real("density", &O::density, 0.01, 10000.0, "nodes of the tree per m² of free floor")
        .real("step", &O::step, 0.01, 100.0, "by which the tree grows towards a sample at most [m]")
        .real("reach", &O::reach, 0.01, 1000.0,
              "largest distance of nodes that are joined [m], at least the step")
        .integer("seed", &O::seed, 0, 2147483647, "of the samples, the same for every tree");
  }
};

class RrtStarPlanner final : public PathPlanner {
 public:
  explicit RrtStarPlanner(const RrtStarPlannerOptions& options) : options_(options) {}

  void start(const FloorMap& map, const Vector2d& from, double radius) override {
    tree_.reset();
    space_.emplace(map, from, radius);
    if (space_->empty()) return;
    tree_.emplace(*space_, cost_, RrtStarOptions{.step = options_.step, .reach = options_.reach});
    RandomStream random(static_cast<std::uint64_t>(options_.seed), RandomStream::Purpose::explorer);
    tree_->grow(random, options_.density);
  }

  std::optional<PlannedPath> path_to(const Vector2d& goal, double tolerance) override {
    if (!tree_) return std::nullopt;
    const std::optional<Vector2d> end = space_->view_of(goal, tolerance);
    const int last = end ? tree_->best_before(*end) : -1;
    if (last < 0) return std::nullopt;
    PlannedPath path{.points = {}, .length = 0.0, .look_at = goal};
    for (const int node : tree_->path(last))
      path.points.push_back(tree_->nodes()[static_cast<std::size_t>(node)].point);
    path.length = tree_->value(last) + (*end - path.points.back()).norm();
    path.points.push_back(*end);
    return path;
  }

 private:
  RrtStarPlannerOptions options_;
  PathLength cost_;
  std::optional<FreeSpace> space_;
  std::optional<RrtStar<PathLength>> tree_;
};

}  // namespace
}  // namespace cairn::exploration

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  using namespace cairn::exploration;
  registrar.add<PathPlanner, RrtStarPlannerOptions>(
      "rrt_star", [](const RrtStarPlannerOptions& options) {
        return std::make_unique<RrtStarPlanner>(options);
      });
}
