// SPDX-License-Identifier: BSD-3-Clause
#include "odometry_gaps.hpp"

#include <algorithm>
#include <limits>
#include <queue>
#include <set>
#include <utility>

#include <fmt/core.h>

#include "cairn/geometry/motion.hpp"
#include "cairn/geometry/pose.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

constexpr double kLooser = 10.0;  // standard deviations

/// The measurements between poses, as ways from each to the others.
class Ways {
 public:
  Ways(const Graph& graph, std::optional<Id> begin) : from_(graph.variable_count()) {
    for (int f = 0; f < graph.factor_count(); ++f) {
      const auto on = graph.factor_variables(f);
      if (on.size() != 2 || !graph.factor_type(f).is_relative()) continue;
      if (begin && std::min(graph.id(on[0]), graph.id(on[1])) < *begin) continue;
      joined_.insert(std::minmax(on[0], on[1]));
      try {
        const MotionGroup group(graph.type_of(on[0]));
        const Motion motion = group.of_factor(graph.factor(f), graph.id(on[0]));
        double trace = 0.0;
        const auto n = static_cast<std::size_t>(group.tangent_size());
        for (std::size_t k = 0; k < n; ++k) trace += motion.covariance[k * (n + 1)];
        from_[on[0]].push_back({on[1], f, trace});
        from_[on[1]].push_back({on[0], f, trace});
      } catch (const Error&) {
        continue;  // without the covariance of a whole relative pose it leads nowhere
      }
    }
  }

  bool are_joined(int a, int b) const { return joined_.contains(std::minmax(a, b)); }

  /// Factors, from `from` on; none: there is no way (Dijkstra).
  std::vector<int> shortest(int from, int to) const {
    constexpr double kFar = std::numeric_limits<double>::infinity();
    std::vector<double> distance(from_.size(), kFar);
    std::vector<std::pair<int, int>> back(from_.size(), {-1, -1});  // pose before, factor
    using Reached = std::pair<double, int>;
    std::priority_queue<Reached, std::vector<Reached>, std::greater<>> queue;
    distance[from] = 0.0;
    queue.emplace(0.0, from);
    while (!queue.empty()) {
      const auto [so_far, v] = queue.top();
      queue.pop();
      if (v == to) break;
      if (so_far > distance[v]) continue;
      for (const Edge& edge : from_[v]) {
        const double next = so_far + edge.length;
        if (!(next < distance[edge.to])) continue;
        distance[edge.to] = next;
        back[edge.to] = {v, edge.factor};
        queue.emplace(next, edge.to);
      }
    }
    std::vector<int> factors;
    for (int v = to; back[v].first >= 0; v = back[v].first) factors.push_back(back[v].second);
    std::ranges::reverse(factors);
    return factors;
  }

 private:
  struct Edge {
    int to, factor;
    double length;
  };
  std::vector<std::vector<Edge>> from_;
  std::set<std::pair<int, int>> joined_;  ///< also by less than a whole relative pose
};

Factor along(const Graph& graph, int from, const std::vector<int>& way) {
  const MotionGroup group(graph.type_of(from));
  Motion motion = group.identity();
  Id at = graph.id(from);
  for (const int f : way) {
    const Factor step = graph.factor(f);
    motion = group.compose(motion, group.of_factor(step, at));
    at = step.variables[0] == at ? step.variables[1] : step.variables[0];
  }
  for (double& entry : motion.covariance) entry *= kLooser * kLooser;
  return group.to_factor(graph.factor(way.front()).type, graph.id(from), at, motion);
}

}  // namespace

std::vector<OdometryGap> bridge_gaps(Graph& recording, std::optional<Id> begin) {
  std::vector<int> poses;
  for (int v = 0; v < recording.variable_count(); ++v) {
    const bool counts = is_pose(recording.type(v)) && (!begin || recording.id(v) >= *begin);
    if (counts) poses.push_back(v);
  }
  std::ranges::sort(poses, {}, [&](int v) { return recording.id(v); });
  const Ways ways(recording, begin);
  std::vector<OdometryGap> gaps;
  for (std::size_t k = 1; k < poses.size(); ++k) {
    if (ways.are_joined(poses[k - 1], poses[k])) continue;
    const std::vector<int> way = ways.shortest(poses[k - 1], poses[k]);
    if (way.empty()) continue;
    gaps.push_back({.before = recording.id(poses[k - 1]),
                    .after = recording.id(poses[k]),
                    .measurements = static_cast<int>(std::ssize(way)),
                    .factor = recording.add(along(recording, poses[k - 1], way))});
  }
  return gaps;
}

std::string to_string(const std::vector<OdometryGap>& gaps) {
  if (gaps.empty()) return {};
  std::string text = fmt::format(
      "no factor joins pose {} to pose {}, the next by id; {} lead from one to the other, and "
      "stand "
      "for odometry, as if they were ten times as uncertain",
      gaps.front().before, gaps.front().after,
      gaps.front().measurements == 1
          ? "another measurement"
          : fmt::format("{} other measurements", gaps.front().measurements));
  if (gaps.size() > 1) text += fmt::format("; so do others in {} more gaps", gaps.size() - 1);
  return text;
}

}  // namespace cairn
