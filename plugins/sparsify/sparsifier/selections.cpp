// SPDX-License-Identifier: BSD-3-Clause
#include "selections.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <optional>
#include <queue>
#include <set>
#include <tuple>
#include <utility>

#include <Eigen/Core>

#include "cairn/geometry/pose.hpp"
#include "cairn/runtime/error.hpp"
#include "work_graph.hpp"

namespace cairn::sparsify {
namespace {

std::size_t share(double part, std::size_t all) {
  return std::min(all, static_cast<std::size_t>(std::llround(part * static_cast<double>(all))));
}

}  // namespace

std::vector<int> KeepEvery::select(const Graph& graph, std::span<const int> nodes,
                                   Sparsifier& /*sparsifier*/) {
  std::vector<int> chosen;
  if (seen_ == 0 && !nodes.empty()) {
    // The first of its type, which is not asked about where it stays anyway, is the first to stay.
    const VariableType& type = graph.type(nodes.front());
    int first = 0;
    while (&graph.type(first) != &type) ++first;
    if (first != nodes.front()) seen_ = 1;
  }
  for (const int v : nodes) {
    const bool stays = seen_++ % every_ == 0 || v + 1 == graph.variable_count();
    if (!stays) chosen.push_back(v);
  }
  return chosen;
}

std::vector<int> SelectionByPart::select(const Graph& graph, std::span<const int> nodes,
                                         Sparsifier& sparsifier) {
  return choose(graph, nodes, sparsifier, static_cast<int>(share(part_, nodes.size())));
}

std::vector<int> LeastLoss::choose(const Graph& graph, std::span<const int> nodes,
                                   Sparsifier& sparsifier, int count) {
  const auto wanted = static_cast<std::size_t>(count);
  Graph work = graph.clone();
  std::set<Id> left;
  for (const int v : nodes) left.insert(graph.id(v));
  std::vector<int> chosen;
  while (chosen.size() < wanted && !left.empty()) {
    std::vector<int> there;
    for (const Id id : left) there.push_back(work.find(id).value());
    const std::vector<double> losses = sparsifier.losses(work, there);
    std::vector<std::size_t> order(there.size());
    for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
    std::ranges::stable_sort(order, {}, [&](std::size_t k) { return losses[k]; });
    const std::size_t round = std::max<std::size_t>(1, (wanted - chosen.size()) / 8);
    const WorkGraph neighbours(work);
    std::set<int> touched;
    std::vector<int> leaving;
    for (const std::size_t k : order) {
      if (leaving.size() == round || !std::isfinite(losses[k])) break;
      if (touched.contains(there[k])) continue;
      for (const int other : neighbours.blanket({&there[k], 1})) touched.insert(other);
      leaving.push_back(there[k]);
    }
    if (leaving.empty()) break;
    for (const int v : leaving) {
      chosen.push_back(graph.find(work.id(v)).value());
      left.erase(work.id(v));
    }
    apply(sparsifier.remove(work, leaving), work);
  }
  return chosen;
}

namespace {

/// How many nodes in a row, in the order of the graph, have left.
class Gaps {
 public:
  explicit Gaps(int nodes) : before_(nodes), after_(nodes) {}
  /// The gap that is there once this node has left as well.
  int without(int node) const { return before_[node] + 1 + after_[node]; }
  /// The node leaves; `changes(n)` is called around what changes for the nodes at the gap's ends.
  template <class Changes>
  void leave(int node, Changes&& changes) {
    const int gap = without(node);
    const int first = node - before_[node] - 1, last = node + after_[node] + 1;
    if (first >= 0) changes(first, [&] { after_[first] = gap; });
    if (last < static_cast<int>(std::ssize(before_))) changes(last, [&] { before_[last] = gap; });
  }

 private:
  std::vector<int> before_, after_;  ///< of each node that is there: how many beside it have left
};

/// What leaves a longer gap waits until nothing else may leave: a factor that stands for a long
/// drive is far from linear.
constexpr int kLongGap = 8;

}  // namespace

std::vector<int> SmallestBlanket::choose(const Graph& graph, std::span<const int> nodes,
                                         Sparsifier& /*sparsifier*/, int count) {
  std::vector<std::set<int>> neighbours(graph.variable_count());
  for (int f = 0; f < graph.factor_count(); ++f) {
    for (const int a : graph.factor_variables(f)) {
      for (const int b : graph.factor_variables(f)) {
        if (a != b) neighbours[a].insert(b);
      }
    }
  }
  Gaps gaps(graph.variable_count());
  const auto rank = [&](int v) {
    const int gap = gaps.without(v);
    return std::tuple(gap > kLongGap, neighbours[v].size(), gap, v);
  };
  std::set<std::tuple<bool, std::size_t, int, int>> queue;
  std::vector<bool> may(graph.variable_count());
  for (const int v : nodes) {
    may[v] = true;
    queue.insert(rank(v));
  }
  const auto change = [&](int node, auto&& what) {
    if (may[node]) queue.erase(rank(node));
    what();
    if (may[node]) queue.insert(rank(node));
  };
  const auto wanted = static_cast<std::size_t>(count);
  std::vector<int> chosen;
  while (chosen.size() < wanted && !queue.empty()) {
    const int v = std::get<3>(*queue.begin());
    queue.erase(queue.begin());
    may[v] = false;
    chosen.push_back(v);
    gaps.leave(v, change);
    const std::vector<int> around(neighbours[v].begin(), neighbours[v].end());
    for (const int other : around) change(other, [&] { neighbours[other].erase(v); });
    for (std::size_t k = 0; around.size() > 1 && k < around.size(); ++k) {
      const int a = around[k], b = around[(k + 1) % around.size()];
      if (a == b) continue;
      change(a, [&] { neighbours[a].insert(b); });
      change(b, [&] { neighbours[b].insert(a); });
    }
  }
  return chosen;
}

std::vector<int> Oldest::choose(const Graph& /*graph*/, std::span<const int> nodes,
                                Sparsifier& /*sparsifier*/, int count) {
  return {nodes.begin(), nodes.begin() + std::min<std::ptrdiff_t>(count, std::ssize(nodes))};
}

namespace {

/// The nearest other pose of each pose, while they leave one by one. A search goes from a pose to
/// both sides along x, until that alone is farther than the nearest so far.
class NearestPairs {
 public:
  /// Of the poses that are `counted`.
  NearestPairs(const Graph& graph, double angle, const std::vector<bool>& counted) : angle_(angle) {
    for (int v = 0; v < graph.variable_count(); ++v) {
      if (!counted[v] || !is_pose(graph.type(v))) continue;
      nodes_.push_back(v);
      poses_.push_back(pose_of(graph.type(v), graph.state(v)));
    }
    nearest_.resize(nodes_.size());
    for (std::size_t k = 0; k < nodes_.size(); ++k) along_x_.push_back(k);
    std::ranges::sort(along_x_, {}, [&](std::size_t k) { return poses_[k].t.x(); });
    for (std::size_t at = 0; at < along_x_.size(); ++at) search(at);
  }

  /// The one that is nearest to another of those that `may` leave, and that other one: variables
  /// of the graph.
  std::optional<std::pair<int, int>> closest(const std::vector<bool>& may) const {
    const Neighbour* best = nullptr;
    std::size_t of = 0;
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      if (!may[nodes_[k]] || nearest_[k].at < 0) continue;
      if (best && best->distance <= nearest_[k].distance) continue;
      best = &nearest_[k];
      of = k;
    }
    if (!best) return std::nullopt;
    return std::pair{nodes_[of], nodes_[static_cast<std::size_t>(best->at)]};
  }

  void remove(int node) {
    const auto gone = std::ranges::lower_bound(nodes_, node) - nodes_.begin();
    nodes_.erase(nodes_.begin() + gone);
    poses_.erase(poses_.begin() + gone);
    nearest_.erase(nearest_.begin() + gone);
    std::erase(along_x_, static_cast<std::size_t>(gone));
    for (std::size_t& k : along_x_) k -= k > static_cast<std::size_t>(gone);
    for (std::size_t at = 0; at < along_x_.size(); ++at) {
      std::ptrdiff_t& other = nearest_[along_x_[at]].at;
      if (other == gone) {
        search(at);
      } else if (other > gone) {
        --other;
      }
    }
  }

 private:
  struct Neighbour {
    double distance = 0.0;
    std::ptrdiff_t at = -1;  ///< in `nodes_`; -1: there is no other
  };

  double distance(const Pose& a, const Pose& b) const {
    const double rotation = angle_ > 0.0 ? angle_ * rotation_angle(a.R.transpose() * b.R) : 0.0;
    return std::hypot((a.t - b.t).norm(), rotation);
  }

  /// The nearest pose of the one at this place along x; of equals, the first.
  void search(std::size_t place) {
    const std::size_t k = along_x_[place];
    Neighbour best;
    const auto try_one = [&](std::size_t j) {
      // A distance may be rounded to less than its part along x.
      const double along = (1.0 - 1e-12) * std::abs(poses_[j].t.x() - poses_[k].t.x());
      if (best.at >= 0 && best.distance < along) return false;
      const Neighbour one{distance(poses_[k], poses_[j]), static_cast<std::ptrdiff_t>(j)};
      if (best.at < 0 || std::pair(one.distance, one.at) < std::pair(best.distance, best.at))
        best = one;
      return true;
    };
    for (std::size_t at = place; at-- > 0 && try_one(along_x_[at]);) {
    }
    for (std::size_t at = place + 1; at < along_x_.size() && try_one(along_x_[at]); ++at) {
    }
    nearest_[k] = best;
  }

  double angle_;
  std::vector<int> nodes_;  ///< rising
  std::vector<Pose> poses_;
  std::vector<Neighbour> nearest_;
  std::vector<std::size_t> along_x_;  ///< places in `nodes_`, by rising x
};

}  // namespace

std::vector<int> Nearest::choose(const Graph& graph, std::span<const int> nodes,
                                 Sparsifier& sparsifier, int count) {
  std::vector<bool> few(graph.variable_count()), may(graph.variable_count());
  const WorkGraph work(graph);
  for (const int v : nodes) {
    may[v] = true;
    few[v] = static_cast<int>(std::ssize(work.blanket({&v, 1}))) <= neighbours_;
  }
  // Of two nodes the divergence is computed when they are compared; where many are to leave, that
  // of all at once, since each call takes time in proportion to the graph.
  constexpr int kMany = 8;
  constexpr double kUnknown = std::numeric_limits<double>::infinity();
  std::vector<double> divergence(graph.variable_count(), kUnknown);
  const auto evaluate = [&](const std::vector<int>& of) {
    const std::vector<double> klds = sparsifier.losses(graph, of);
    for (std::size_t k = 0; k < of.size(); ++k) divergence[of[k]] = klds[k];
  };
  if (count > kMany) {
    std::vector<int> cheap(nodes.begin(), nodes.end());
    std::erase_if(cheap, [&](int v) { return !few[v]; });
    evaluate(cheap);
  }
  const bool all = !leaving_ || nodes.size() < 2;
  NearestPairs pairs(graph, angle_, all ? std::vector<bool>(may.size(), true) : may);
  std::vector<int> chosen;
  while (static_cast<int>(std::ssize(chosen)) < count) {
    auto pair = pairs.closest(few);
    if (!pair) pair = pairs.closest(may);
    if (!pair) break;
    auto [leaves, other] = *pair;
    if (may[other] && few[other] == few[leaves]) {
      const int older = std::min(leaves, other), newer = std::max(leaves, other);
      if (count <= kMany) evaluate({older, newer});
      leaves = divergence[newer] < divergence[older] ? newer : older;
    }
    chosen.push_back(leaves);
    may[leaves] = few[leaves] = false;
    pairs.remove(leaves);
  }
  return chosen;
}

std::vector<int> Coverage::select(const Graph& graph, std::span<const int> nodes,
                                  Sparsifier& /*sparsifier*/) {
  std::vector<bool> may(graph.variable_count());
  for (const int v : nodes) may[v] = true;
  using Cell = std::array<std::int64_t, 3>;
  std::map<Cell, std::vector<Pose>> kept;
  const auto cell = [&](const Pose& pose) {
    Cell at{};
    for (std::size_t k = 0; k < 3; ++k)
      at[k] = static_cast<std::int64_t>(std::floor(pose.t[static_cast<int>(k)] / distance_));
    return at;
  };
  const auto covered = [&](const Pose& pose) {
    const Cell at = cell(pose);
    for (std::int64_t x = -1; x <= 1; ++x) {
      for (std::int64_t y = -1; y <= 1; ++y) {
        for (std::int64_t z = -1; z <= 1; ++z) {
          const auto there = kept.find({at[0] + x, at[1] + y, at[2] + z});
          if (there == kept.end()) continue;
          for (const Pose& other : there->second) {
            const Eigen::Vector3d apart = pose.t - other.t;
            if (std::hypot(apart[0], apart[1], apart[2]) < distance_ &&
                rotation_angle(pose.R.transpose() * other.R) < angle_) {
              return true;
            }
          }
        }
      }
    }
    return false;
  };
  std::vector<int> chosen;
  for (int v = 0; v < graph.variable_count(); ++v) {
    if (!has_position(graph.type(v))) {
      if (!may[v]) continue;
      throw Error(ErrorCode::usage,
                  "selection coverage: " + graph.describe_variable(v) + " has no position");
    }
    const Pose pose = pose_of(graph.type(v), graph.state(v));
    if (may[v] && covered(pose)) {
      chosen.push_back(v);
    } else {
      kept[cell(pose)].push_back(pose);
    }
  }
  return chosen;
}

}  // namespace cairn::sparsify
