// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/fixed_variables.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <Eigen/Core>

#include "cairn/evaluation/plausibility.hpp"
#include "cairn/geometry/motion.hpp"
#include "cairn/geometry/pose.hpp"
#include "dense/cholesky.hpp"

namespace cairn {
namespace {

constexpr std::size_t kMostPairs = 1000;  // of fixed poses that are compared
constexpr double kDegrees = 57.29577951308232;

struct Disagreement {
  int from = 0, to = 0;  ///< variables
  std::int64_t measurements = 0;
  double squared = 0.0;  ///< Mahalanobis distance per degree of freedom
  double metres = 0.0, degrees = 0.0;
};

/// Relative measurements, and from each fixed pose the tree of those that it reaches first.
class FixedPoses {
 public:
  explicit FixedPoses(const Graph& graph) : graph_(graph), factors_(graph.variable_count()) {
    for (const FactorPool& pool : graph.factor_pools()) {
      if (!pool.type->is_relative()) continue;
      for (const int f : pool.sequence) {
        if (graph.information_rank(f) < pool.type->residual_size()) continue;
        for (const int v : graph.factor_variables(f)) factors_[v].push_back(f);
      }
    }
  }

  /// The two that contradict each other by most; nothing that is plausible.
  Disagreement worst() {
    grow_trees();
    Disagreement worst;
    for (const int f : crossings_) {
      const Disagreement found = along(f);
      if (found.squared > worst.squared) worst = found;
    }
    return worst;
  }

 private:
  struct Reached {
    int root = -1;    ///< the fixed pose
    int factor = -1;  ///< by which it is reached, −1: the root itself
  };

  int other_end(int f, int v) const {
    const auto ends = graph_.factor_variables(f);
    return ends[0] == v ? ends[1] : ends[0];
  }

  void grow_trees() {
    reached_.assign(static_cast<std::size_t>(graph_.variable_count()), {});
    std::vector<int> front;
    for (int v = 0; v < graph_.variable_count(); ++v) {
      if (!graph_.fixed(v) || !is_pose(graph_.type(v))) continue;
      reached_[v].root = v;
      front.push_back(v);
    }
    std::set<std::pair<int, int>> pairs;
    for (std::size_t next = 0; next < front.size(); ++next) {
      const int v = front[next];
      for (const int f : factors_[v]) {
        const int w = other_end(f, v);
        if (reached_[w].root < 0) {
          reached_[w] = {reached_[v].root, f};
          front.push_back(w);
        } else if (reached_[w].root != reached_[v].root && pairs.size() < kMostPairs &&
                   pairs.insert(std::minmax(reached_[w].root, reached_[v].root)).second) {
          crossings_.push_back(f);
        }
      }
    }
  }

  /// The factors from a variable to the root of its tree.
  std::vector<int> path_to_root(int v) const {
    std::vector<int> path;
    while (reached_[v].factor >= 0) {
      path.push_back(reached_[v].factor);
      v = other_end(path.back(), v);
    }
    return path;
  }

  const MotionGroup& group_of(int v) {
    std::unique_ptr<MotionGroup>& group = groups_[graph_.pool(v)];
    if (!group) group = std::make_unique<MotionGroup>(graph_.type_of(v));
    return *group;
  }

  /// Of the roots of the two trees that a factor joins.
  Disagreement along(int crossing) {
    const auto ends = graph_.factor_variables(crossing);
    std::vector<int> path = path_to_root(ends[0]);
    std::ranges::reverse(path);
    path.push_back(crossing);
    for (const int f : path_to_root(ends[1])) path.push_back(f);

    Disagreement result{reached_[ends[0]].root, reached_[ends[1]].root, std::ssize(path)};
    const MotionGroup& group = group_of(result.from);
    const LieGroup& lie = *group.type().lie_group();
    Motion measured = group.identity();
    int at = result.from;
    for (const int f : path) {
      Motion step =
          group.of_factor(graph_.factor_type(f), graph_.measurement(f), graph_.information(f));
      if (graph_.factor_variables(f)[0] != at) step = group.inverse(step);
      measured = group.compose(measured, step);
      at = other_end(f, at);
    }
    // Where the measurements have the other end, and from there to where it is fixed.
    std::vector<double> there(measured.mean.size()), apart(there), inverse(there);
    lie.compose(graph_.state(result.from).data(), measured.mean.data(), there.data());
    lie.inverse(there.data(), inverse.data());
    lie.compose(inverse.data(), graph_.state(result.to).data(), apart.data());
    const int n = group.tangent_size();
    Eigen::VectorXd xi(n);
    lie.log(apart.data(), xi.data());
    const Eigen::Map<const Eigen::MatrixXd> Sigma(measured.covariance.data(), n, n);
    const Eigen::MatrixXd copy = Sigma;
    const Eigen::LLT<Eigen::MatrixXd> llt(copy);
    if (llt.info() != Eigen::Success) return result;
    result.squared = xi.dot(Eigen::VectorXd(llt.solve(xi))) / n;
    const Pose pose = pose_of(group.type(), apart);
    result.metres = pose.t.norm();
    result.degrees = kDegrees * rotation_angle(pose.R);
    return result;
  }

  const Graph& graph_;
  std::vector<std::vector<int>> factors_;  ///< relative ones, by variable
  std::vector<Reached> reached_;
  std::vector<int> crossings_;  ///< factors between the trees of two fixed poses
  std::map<int, std::unique_ptr<MotionGroup>> groups_;  ///< by pool of variables
};

bool has_two_fixed(const Graph& graph) {
  int fixed = 0;
  for (int v = 0; v < graph.variable_count() && fixed < 2; ++v)
    fixed += graph.fixed(v) && is_pose(graph.type(v));
  return fixed >= 2;
}

}  // namespace

std::string contradicting_fixed_poses(const Graph& graph) {
  if (!has_two_fixed(graph)) return {};
  const Disagreement worst = FixedPoses(graph).worst();
  if (!(worst.squared > kImplausibleChi2)) return {};
  return fmt::format(
      "{} and {} are both fixed, and contradict each other: from one to the other {} "
      "{:.3g} m and {:.3g}° away from where it is fixed. Fix one of them only, or bring both into "
      "one frame",
      graph.describe_variable(worst.from), graph.describe_variable(worst.to),
      worst.measurements == 1 ? "1 measurement leads"
                              : fmt::format("{} measurements lead", worst.measurements),
      worst.metres, worst.degrees);
}

}  // namespace cairn
