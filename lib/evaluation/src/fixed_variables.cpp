// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/fixed_variables.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <string>
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

constexpr std::size_t kMostPaths = 1000, kMostOfAPair = 10;  // that are compared
constexpr double kDegrees = 57.29577951308232;

/// A pose that is placed in the world: fixed, or by a prior on all of it.
struct Anchor {
  int variable = 0;
  int prior = -1;  ///< factor, −1: fixed
  Motion at;
};

/// From one anchor to another by relative measurements.
struct Path {
  int from = 0, to = 0;   ///< anchors
  int crossing = 0;       ///< the factor where their trees meet
  Eigen::VectorXd apart;  ///< from where the measurements have the other end to where it is placed
  Eigen::MatrixXd Sigma;  ///< its covariance
  Pose pose;              ///< `apart` in metres
};

/// Mahalanobis distance per degree of freedom; 0 where the covariance has no inverse.
double squared(const Eigen::VectorXd& apart, const Eigen::MatrixXd& Sigma) {
  const Eigen::LLT<Eigen::MatrixXd> llt(Sigma);
  if (llt.info() != Eigen::Success) return 0.0;
  return apart.dot(Eigen::VectorXd(llt.solve(apart))) / static_cast<double>(apart.size());
}
double squared(const Path& path) { return squared(path.apart, path.Sigma); }

/// Relative measurements, and from each anchor the tree of the poses that it reaches first.
class Anchors {
 public:
  explicit Anchors(const Graph& graph)
      : graph_(graph), reached_(static_cast<std::size_t>(graph.variable_count())) {
    for (int v = 0; v < graph.variable_count(); ++v) {
      if (graph.fixed(v) && is_pose(graph.type(v)))
        add({v, -1, {copied(graph.state(v)), zero_covariance(v)}});
    }
    for (const FactorPool& pool : graph.factor_pools()) {
      if (pool.type->arity() != 1) continue;
      for (const int f : pool.sequence) add_prior(f);
    }
  }
  bool are_several() const { return anchors_.size() > 1; }

  /// What is to be said of the two that contradict each other by most; empty where none do.
  std::string contradiction() {
    grow_trees();
    std::vector<Path> paths;
    for (const int f : crossings_) paths.push_back(along(f));
    const auto worst =
        std::ranges::max_element(paths, {}, [](const Path& path) { return squared(path); });
    if (worst == paths.end() || !(squared(*worst) > kImplausibleChi2)) return {};
    const std::vector<int> suspects = not_confirmed(*worst, paths);
    return suspects.empty() ? of_anchors(*worst) : of_measurements(*worst, suspects);
  }

 private:
  struct Reached {
    int root = -1;    ///< the anchor
    int factor = -1;  ///< by which it is reached, −1: the root itself
  };

  static std::vector<double> copied(std::span<const double> numbers) {
    return {numbers.begin(), numbers.end()};
  }
  std::vector<double> zero_covariance(int v) const {
    const auto n = static_cast<std::size_t>(graph_.type(v).tangent_size());
    return std::vector<double>(n * n, 0.0);
  }

  /// Of a factor that measures a pose wholly, where that pose is no anchor yet.
  void add_prior(int f) {
    const FactorType& type = graph_.factor_type(f);
    const int v = graph_.factor_variables(f)[0], n = graph_.type(v).tangent_size();
    if (!is_pose(graph_.type(v)) || graph_.information_rank(f) < n) return;
    if (reached_[v].root >= 0) return;
    const double* x = graph_.state(v).data();
    Anchor anchor{v, f, {copied(graph_.state(v)), zero_covariance(v)}};
    if (!type.propagate(0, &x, graph_.measurement(f).data(), anchor.at.mean.data())) return;
    Eigen::VectorXd error(type.residual_size());
    Eigen::MatrixXd J(type.residual_size(), n);
    double* jacobian = J.data();
    x = anchor.at.mean.data();
    type.evaluate(&x, graph_.measurement(f).data(), graph_.sqrt_information(f).data(), error.data(),
                  &jacobian);
    const Eigen::LLT<Eigen::MatrixXd> llt(Eigen::MatrixXd(J.transpose() * J));
    if (llt.info() != Eigen::Success) return;
    Eigen::Map<Eigen::MatrixXd>(anchor.at.covariance.data(), n, n) =
        llt.solve(Eigen::MatrixXd::Identity(n, n));
    add(std::move(anchor));
  }
  void add(Anchor anchor) {
    reached_[anchor.variable].root = static_cast<int>(anchors_.size());
    anchors_.push_back(std::move(anchor));
  }

  int other_end(int f, int v) const {
    const auto ends = graph_.factor_variables(f);
    return ends[0] == v ? ends[1] : ends[0];
  }

  std::vector<std::vector<int>> relative_factors() const {
    std::vector<std::vector<int>> factors(static_cast<std::size_t>(graph_.variable_count()));
    for (const FactorPool& pool : graph_.factor_pools()) {
      if (!pool.type->is_relative()) continue;
      for (const int f : pool.sequence) {
        if (graph_.information_rank(f) < pool.type->residual_size()) continue;
        for (const int v : graph_.factor_variables(f)) factors[v].push_back(f);
      }
    }
    return factors;
  }

  void grow_trees() {
    const std::vector<std::vector<int>> factors = relative_factors();
    std::vector<int> front;
    for (const Anchor& anchor : anchors_) front.push_back(anchor.variable);
    std::map<std::pair<int, int>, std::size_t> paths;
    for (std::size_t next = 0; next < front.size(); ++next) {
      const int v = front[next];
      for (const int f : factors[v]) {
        const int w = other_end(f, v);
        if (reached_[w].root < 0) {
          reached_[w] = {reached_[v].root, f};
          front.push_back(w);
        } else if (v < w && reached_[w].root != reached_[v].root &&
                   crossings_.size() < kMostPaths &&
                   paths[std::minmax(reached_[w].root, reached_[v].root)]++ < kMostOfAPair) {
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
  /// From the root of the first variable of a crossing to that of its second.
  std::vector<int> factors_along(int crossing) const {
    const auto ends = graph_.factor_variables(crossing);
    std::vector<int> path = path_to_root(ends[0]);
    std::ranges::reverse(path);
    path.push_back(crossing);
    for (const int f : path_to_root(ends[1])) path.push_back(f);
    return path;
  }

  const MotionGroup& group_of(int v) {
    std::unique_ptr<MotionGroup>& group = groups_[graph_.pool(v)];
    if (!group) group = std::make_unique<MotionGroup>(graph_.type_of(v));
    return *group;
  }

  Path along(int crossing) {
    const auto ends = graph_.factor_variables(crossing);
    Path path{reached_[ends[0]].root, reached_[ends[1]].root, crossing, {}, {}, {}};
    const Anchor &from = anchors_[path.from], &to = anchors_[path.to];
    const MotionGroup& group = group_of(from.variable);
    Motion there = from.at;  // where the measurements have the other end
    int at = from.variable;
    for (const int f : factors_along(crossing)) {
      Motion step =
          group.of_factor(graph_.factor_type(f), graph_.measurement(f), graph_.information(f));
      if (graph_.factor_variables(f)[0] != at) step = group.inverse(step);
      there = group.compose(there, step);
      at = other_end(f, at);
    }
    const LieGroup& lie = *group.type().lie_group();
    std::vector<double> apart(there.mean.size()), inverse(there.mean.size());
    lie.inverse(there.mean.data(), inverse.data());
    lie.compose(inverse.data(), to.at.mean.data(), apart.data());
    const int n = group.tangent_size();
    using Map = Eigen::Map<const Eigen::MatrixXd>;
    path.Sigma = Map(there.covariance.data(), n, n) + Map(to.at.covariance.data(), n, n);
    path.apart.resize(n);
    lie.log(apart.data(), path.apart.data());
    path.pose = pose_of(group.type(), apart);
    return path;
  }

  /// Measurements of a path that no other between the same two confirms. A path that agrees with
  /// both confirms its measurements, if it is so certain that this one contradicts it. Empty: there
  /// is no such path.
  std::vector<int> not_confirmed(const Path& wrong, const std::vector<Path>& paths) const {
    std::vector<int> suspects = factors_along(wrong.crossing);
    std::set<int> confirmed;
    for (const Path& path : paths) {
      if (std::minmax(path.from, path.to) != std::minmax(wrong.from, wrong.to) ||
          squared(path) > kImplausibleChi2 || squared(wrong.apart, path.Sigma) <= kImplausibleChi2)
        continue;
      const std::vector<int> factors = factors_along(path.crossing);
      confirmed.insert(factors.begin(), factors.end());
    }
    if (confirmed.empty()) return {};
    std::erase_if(suspects, [&](int f) { return confirmed.contains(f); });
    return suspects;
  }

  std::string of_anchors(const Path& path) const {
    const bool fixed = anchors_[path.from].prior < 0 && anchors_[path.to].prior < 0;
    return fmt::format(
        "{}, and contradict each other: {}. {} one of them only, or bring both "
        "into one frame",
        both(path), way(path), fixed ? "Fix" : "Place");
  }
  std::string of_measurements(const Path& path, const std::vector<int>& suspects) const {
    const std::string first = graph_.describe_factor(suspects.front());
    return fmt::format(
        "{}: {}, though other measurements agree with both. {} wrong; a robust loss such as cauchy "
        "limits it",
        both(path), way(path),
        suspects.size() == 1 ? first + " is"
                             : fmt::format("{} or another of {} is", first, suspects.size()));
  }
  std::string both(const Path& path) const {
    const Anchor &from = anchors_[path.from], &to = anchors_[path.to];
    std::string how = "both fixed";
    if (from.prior >= 0 || to.prior >= 0)
      how = fmt::format("placed by {} and {}", anchor_name(from), anchor_name(to));
    return fmt::format("{} and {} are {}", graph_.describe_variable(from.variable),
                       graph_.describe_variable(to.variable), how);
  }
  std::string anchor_name(const Anchor& anchor) const {
    return anchor.prior < 0 ? "FIX" : graph_.describe_factor(anchor.prior);
  }
  std::string way(const Path& path) const {
    const std::size_t count = factors_along(path.crossing).size();
    return fmt::format(
        "from one to the other {} {:.3g} m and {:.3g}° away from where it is {}",
        count == 1 ? "1 measurement leads" : fmt::format("{} measurements lead", count),
        path.pose.t.norm(), kDegrees * rotation_angle(path.pose.R),
        anchors_[path.to].prior < 0 ? "fixed" : "placed");
  }

  const Graph& graph_;
  std::vector<Anchor> anchors_;
  std::vector<Reached> reached_;
  std::vector<int> crossings_;  ///< factors between the trees of two anchors
  std::map<int, std::unique_ptr<MotionGroup>> groups_;  ///< by pool of variables
};

}  // namespace

std::string contradicting_fixed_poses(const Graph& graph) {
  Anchors anchors(graph);
  return anchors.are_several() ? anchors.contradiction() : std::string();
}

}  // namespace cairn
