// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "cairn/exploration/exploration.hpp"
#include "cairn/grid/cell_traversal.hpp"
#include "cairn/grid/grid_format.hpp"
#include "cairn/planning/path_information.hpp"
#include "cairn/planning/path_motions.hpp"
#include "cairn/plugin/registry.hpp"
#include "exploration/support/exploration_runs.hpp"
#include "support/components.hpp"
#include "support/data.hpp"

namespace cairn {
namespace {

/// A path that the explorer listed, with the change of the trajectory's entropy [nats] by both.
struct Promise {
  double thesis = 0.0, exact = 0.0;
  int thesis_loops = 0, exact_loops = 0;
  bool chosen = false;
};

PathInformation::State along(PathInformation& information, const std::vector<Eigen::Vector2d>& path,
                             const RobotModel& robot) {
  PathInformation::State state = information.start();
  for (std::size_t k = 1; k < path.size(); ++k) {
    const PlannedPath segment{.points = {path[k]}, .length = 1.0};
    state = information.extended(state, motions_along(state.pose(), segment, robot));
  }
  return state;
}

double median(std::vector<double> values) {
  if (values.empty()) return NAN;
  std::ranges::sort(values);
  return values[values.size() / 2];
}

void print(const std::string& name, const std::vector<Promise>& promises) {
  std::vector<double> thesis, exact, apart;
  int more = 0;
  for (const Promise& one : promises) {
    thesis.push_back(one.thesis);
    exact.push_back(one.exact);
    apart.push_back(one.exact - one.thesis);
    more += one.thesis < one.exact;
  }
  if (promises.empty()) return;
  std::cout << fmt::format(
      "{}: {} paths; (5.16) median {:+.2f}, least {:+.2f}; exact median {:+.3f}, least {:+.3f}; "
      "(5.16) promises more on {}, median by {:.2f} nats\n",
      name, promises.size(), median(thesis), std::ranges::min(thesis), median(exact),
      std::ranges::min(exact), more, median(apart));
}

struct Drive {
  const char* explorer;
  bool match_consecutive;
};

/// What (5.16) promises of the paths that `drrt_star` lists, and their exact values, while the
/// graph grows. Where odometry alone leads from scan to scan there are many loop closures.
/// CAIRN_LOOPS_METRES: how far the robot drives (60).
TEST(ThesisLoopsStudy, PromisesOfPathsThatCloseLoops) {
  CAIRN_NEEDS_DATA();
  CAIRN_NEEDS("grid_format", "ros");
  CAIRN_NEEDS("registration", "icp");
  const char* const metres = std::getenv("CAIRN_LOOPS_METRES");
  for (const auto& [explorer, match_consecutive] :
       {Drive{"drrt_star:loops=thesis", true}, Drive{"drrt_star:loops=thesis,alpha=end", false},
        Drive{"drrt_star:alpha=end", false}}) {
    test::ExplorationParts parts("lidar_building", explorer);
    parts.policy =
        parts.make<PosePolicy>("compact_pose:range=2,angle=3.14,reuse=false,gate=0.9999");
    parts.registration = parts.make<Registration>("icp");
    const OccupancyGrid floor =
        read_grid((test::data_folder() / "maps/fr079.yaml").string(), parts.registry);
    Exploration exploration = parts.on(floor, 3);
    exploration.match_consecutive = match_consecutive;
    exploration.limits.distance = metres ? std::atof(metres) : 60.0;
    std::vector<Promise> early, late;
    exploration.decided = [&](const Decision& decision, const Situation& situation) {
      const FloorMap& map = situation.map;
      const auto in_sight = [&](const Pose2& older, const Pose2& newer) {
        const auto cell = [&](const Pose2& at) { return map.frame.to_cells(at.translation()); };
        return traverse_cells(cell(older), cell(newer), [&](int x, int y) {
          return !map.frame.contains(x, y) ||
                 map.cells[map.frame.index(x, y)] != CellState::occupied;
        });
      };
      PathInformation exact(situation, {}, in_sight),
          thesis(situation, {.loops = LoopForm::thesis}, in_sight);
      for (const Candidate& candidate : decision.candidates) {
        if (!candidate.change || candidate.path.points.size() < 2) continue;
        const auto a = along(thesis, candidate.path.points, situation.robot),
                   b = along(exact, candidate.path.points, situation.robot);
        if (a.loops() == 0) continue;
        (situation.poses.size() < 100 ? early : late)
            .push_back({a.trajectory_change(), b.trajectory_change(), a.loops(), b.loops(),
                        &candidate == &decision.candidates[decision.chosen]});
      }
    };
    const ExplorationResult result = run_exploration(exploration);
    std::cout << fmt::format("{}{}, {:.0f} m, {} poses kept, {} loop closures, {:.0f} m² seen\n",
                             explorer, match_consecutive ? "" : ", --no-consecutive",
                             result.steps.back().distance, result.graph.variable_count(),
                             result.slam.loops, result.against ? result.against->seen : NAN);
    const std::size_t paths = early.size() + late.size();
    double promised = 0.0, brought = 0.0;
    for (const Promise& one : late) {
      promised += one.thesis;
      brought += one.exact;
    }
    print("  graph of under 100 poses", early);
    print("  of 100 and more", late);
    std::erase_if(early, [](const Promise& one) { return !one.chosen; });
    std::erase_if(late, [](const Promise& one) { return !one.chosen; });
    print("  chosen, under 100 poses", early);
    print("  chosen, 100 and more", late);
    EXPECT_GT(paths, 0U);
    EXPECT_LE(promised, brought);
  }
}

}  // namespace
}  // namespace cairn
