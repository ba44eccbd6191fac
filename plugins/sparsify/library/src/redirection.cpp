// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sparsification/redirection.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <unordered_map>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "cairn/geometry/pose.hpp"
#include "cairn/geometry/state_group.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/lu.hpp"

namespace cairn {
namespace {

using To = RedirectionRule::To;

/// What may become of a variable.
enum class Fate : char { stays, undecided, leaves };

/// Where a node goes: to a variable of the graph, by a relative pose of that covariance.
struct Target {
  int variable = -1;  ///< −1: nowhere
  std::vector<double> covariance;
};

/// Chooses among the graph's variables.
class Anchors {
 public:
  Anchors(const Graph& graph, RedirectionRule rule, std::vector<Fate> fates)
      : graph_(graph), rule_(rule), fates_(std::move(fates)) {
    for (int v = 0; v < graph.variable_count(); ++v)
      where_.push_back(where(graph.type(v), graph.id(v), graph.state(v)));
    if (rule.to == To::path) connect();
  }

  bool leaves(int variable) const { return fates_[variable] == Fate::leaves; }

  /// For a node of that type, id and state; `variable`: itself, or, where it is no longer there,
  /// the one that it was redirected to.
  Target choose(const VariableType& type, Id id, std::span<const double> x, int variable) const {
    for (const Fate most : {Fate::stays, Fate::undecided}) {
      const Target found = rule_.to == To::path   ? at_end_of_path(variable, most)
                           : rule_.to == To::next ? next(type, id, most)
                                                  : nearest(type, id, x, most);
      if (found.variable >= 0) return found;
    }
    if (rule_.to != To::path) return {};
    // No path leads anywhere: the nearest, as if its relative pose were exact.
    const Target found = nearest(type, id, x, Fate::stays);
    return found.variable >= 0 ? found : nearest(type, id, x, Fate::undecided);
  }

 private:
  struct Edge {
    int to, factor;
  };

  bool open(int v, const VariableType& type, Fate most) const {
    return fates_[v] <= most && graph_.type(v).tag() == type.tag();
  }

  /// What is near is near in these.
  Eigen::Vector3d where(const VariableType& type, Id id, std::span<const double> x) const {
    if (rule_.to == To::order) return {static_cast<double>(id), 0.0, 0.0};
    return has_position(type) ? position(type, x) : Eigen::Vector3d(0.0, 0.0, 0.0);
  }

  static Target exact(int variable, const VariableType& type) {
    const auto n = static_cast<std::size_t>(type.tangent_size());
    return {variable, std::vector<double>(n * n, 0.0)};
  }

  Target nearest(const VariableType& type, Id id, std::span<const double> x, Fate most) const {
    const Eigen::Vector3d here = where(type, id, x);
    int best = -1;
    double least = std::numeric_limits<double>::infinity();
    for (int v = 0; v < graph_.variable_count(); ++v) {
      if (!open(v, type, most)) continue;
      const double squares = (where_[v] - here).squaredNorm();
      if (squares < least || (rule_.newer && squares == least)) {
        least = squares;
        best = v;
      }
    }
    return exact(best, type);
  }

  Target next(const VariableType& type, Id id, Fate most) const {
    int best = -1;
    for (int v = 0; v < graph_.variable_count(); ++v) {
      if (!open(v, type, most)) continue;
      const auto after = [&](int w) { return graph_.id(w) > id; };
      const bool better = best < 0                  ? true
                          : after(v) != after(best) ? after(v)
                          : after(v)                ? graph_.id(v) < graph_.id(best)
                                                    : graph_.id(v) > graph_.id(best);
      if (better) best = v;
    }
    return exact(best, type);
  }

  /// All relative factors of two poses, from both ends.
  void connect() {
    edges_.resize(graph_.variable_count());
    for (int f = 0; f < graph_.factor_count(); ++f) {
      const auto on = graph_.factor_variables(f);
      if (on.size() != 2 || !graph_.type_of_factor(f)->is_relative()) continue;
      if (!graph_.type(on[0]).lie_group() || graph_.type(on[0]).tag() != graph_.type(on[1]).tag())
        continue;
      edges_[on[0]].push_back({on[1], f});
      edges_[on[1]].push_back({on[0], f});
    }
  }

  static double uncertainty(const Motion& motion, int n) {
    const Eigen::MatrixXd S = Eigen::Map<const Eigen::MatrixXd>(motion.covariance.data(), n, n);
    return std::pow(std::abs(S.partialPivLu().determinant()), 1.0 / n);
  }

  /// Dijkstra's shortest paths from `start`, up to the first variable that may be an anchor. The
  /// covariance is that of the path from there to `start`.
  Target at_end_of_path(int start, Fate most) const {
    const VariableType& type = graph_.type(start);
    if (!type.lie_group()) return {};
    const MotionGroup motions(graph_.type_of(start));
    struct Step {
      double length;
      Motion to_start;  ///< from this variable to `start`
      bool done = false;
    };
    std::unordered_map<int, Step> steps;
    using Entry = std::pair<double, int>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open_steps;
    steps.emplace(start, Step{0.0, motions.identity()});
    open_steps.emplace(0.0, start);
    while (!open_steps.empty()) {
      const int v = open_steps.top().second;
      open_steps.pop();
      if (std::exchange(steps.at(v).done, true)) continue;
      const Step at = steps.at(v);
      if (v != start && open(v, type, most)) return {v, at.to_start.covariance};
      for (const Edge& edge : edges_[v]) {
        const auto known = steps.find(edge.to);
        if (known != steps.end() && known->second.done) continue;
        Motion there;
        try {
          there = motions.of_factor(graph_.factor(edge.factor), graph_.id(edge.to));
        } catch (const Error&) {
          continue;  // information that is not definite measures no relative pose
        }
        const double length = at.length + uncertainty(there, motions.tangent_size());
        if (known != steps.end() && known->second.length <= length) continue;
        steps.insert_or_assign(edge.to, Step{length, motions.compose(there, at.to_start)});
        open_steps.emplace(length, edge.to);
      }
    }
    return {};
  }

  const Graph& graph_;
  RedirectionRule rule_;
  std::vector<Fate> fates_;
  std::vector<Eigen::Vector3d> where_;
  std::vector<std::vector<Edge>> edges_;  ///< `path`: of each variable
};

}  // namespace

void Redirection::leave(const Graph& graph, std::span<const int> nodes,
                        std::span<const int> others) {
  std::vector<Fate> fates(graph.variable_count(), Fate::stays);
  for (const int v : others) fates[v] = Fate::undecided;
  for (const int v : nodes) fates[v] = Fate::leaves;
  const Anchors anchors(graph, rule_, std::move(fates));
  // Where a node goes whose state is x; `variable`: where its path begins.
  const auto place = [&](Id id, const std::shared_ptr<const VariableType>& type,
                         std::span<const double> x, int variable) {
    const Target target = anchors.choose(*type, id, x, variable);
    Place placed{.type = type, .motion = {}};
    placed.lost = target.variable < 0;
    if (!placed.lost) {
      placed.anchor = graph.id(target.variable);
      placed.motion = {StateGroup(*type).between(graph.state(target.variable), x),
                       target.covariance};
    }
    return placed;
  };
  std::vector<std::pair<Id, int>> follow;
  for (const auto& [id, at] : at_) {
    const auto anchor = graph.find(at.anchor);
    if (!at.lost && anchor && anchors.leaves(*anchor)) follow.emplace_back(id, *anchor);
  }
  for (const auto& [id, anchor] : follow) {
    const Place before = at_.at(id);
    Place now = place(id, before.type, state(id, graph.state(anchor)), anchor);
    // The path to where it was goes on from there.
    if (!now.lost && rule_.to == To::path) {
      const MotionGroup motions(before.type);
      const StateGroup group(*before.type);
      const Motion first{
          group.between(graph.state(graph.find(now.anchor).value()), graph.state(anchor)),
          now.motion.covariance};
      now.motion = motions.compose(first, before.motion);
    }
    at_.insert_or_assign(id, std::move(now));
  }
  for (const int v : nodes) {
    if (graph.type(v).lie_group())
      at_.insert_or_assign(graph.id(v), place(graph.id(v), graph.type_of(v), graph.state(v), v));
  }
}

std::vector<double> Redirection::state(Id node, std::span<const double> anchor) const {
  const Place& place = at_.at(node);
  return StateGroup(*place.type).compose(anchor, place.motion.mean);
}

std::optional<Factor> Redirection::redirect(const Factor& factor) const {
  if (std::ranges::none_of(factor.variables, [&](Id id) { return has(id); })) return factor;
  if (factor.variables.size() != 2 || !factor.type->is_relative()) return std::nullopt;
  std::vector<Id> ends = factor.variables;
  const Place& any = at_.at(has(ends[0]) ? ends[0] : ends[1]);
  const MotionGroup motions(any.type);
  Motion z;
  try {
    z = motions.of_factor(*factor.type, factor.measurement, factor.information);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::usage) throw;
    return std::nullopt;  // information that is not definite: no covariance
  }
  for (int end = 0; end < 2; ++end) {
    if (!has(ends[end])) continue;
    const Place& place = at_.at(ends[end]);
    if (place.lost) return std::nullopt;
    Motion from_anchor = place.motion;
    for (double& covariance : from_anchor.covariance) covariance *= rule_.inflation;
    z = end == 0 ? motions.compose(from_anchor, z)
                 : motions.compose(z, motions.inverse(from_anchor));
    ends[end] = place.anchor;
  }
  if (ends[0] == ends[1]) return std::nullopt;
  return motions.to_factor(factor.type, ends[0], ends[1], z);
}

}  // namespace cairn
