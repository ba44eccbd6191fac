// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "cairn/io/random_numbers.hpp"
#include "cairn/planning/free_space.hpp"
#include "cairn/planning/point_buckets.hpp"

namespace cairn {

/// What a tree of paths makes small: any function of a whole path, which is known by a state at its
/// end.
///
/// - `root(point)`: the state of the path that is this point alone.
/// - `extended(state, from, to, before)`: that of a path which goes on by the segment from its end
///   to a point. `before`, if not null, is the state of another path whose last segment is the
///   same: what depends on the segment alone may be taken from it.
/// - `adopted(state, parent)`: the same, for a state that becomes part of the tree: what only paths
///   that go on from it need can be left to this call.
/// - `value(state)`: the cost; the least is best.
template <class Cost>
concept PathCost = requires(Cost& cost, const typename Cost::State& state, typename Cost::State own,
                            const typename Cost::State* before, const Eigen::Vector2d& point) {
  { cost.root(point) } -> std::same_as<typename Cost::State>;
  { cost.extended(state, point, point, before) } -> std::same_as<typename Cost::State>;
  { cost.adopted(std::move(own), state) } -> std::same_as<typename Cost::State>;
  { cost.value(state) } -> std::convertible_to<double>;
};

/// The length of a path [m].
struct PathLength {
  using State = double;
  State root(const Eigen::Vector2d&) const { return 0.0; }
  State extended(State length, const Eigen::Vector2d& from, const Eigen::Vector2d& to,
                 const State*) const {
    return length + (to - from).norm();
  }
  State adopted(State length, State) const { return length; }
  double value(State length) const { return length; }
};

struct RrtStarOptions {
  double step = 0.5;   ///< by which the tree grows towards a sample at most [m]
  double reach = 1.0;  ///< r_max: largest distance of nodes that are joined [m], at least the step
};

/// A tree of paths for a round body over known floor, rooted at where it is (RRT*: S. Karaman and
/// E. Frazzoli, Sampling-based algorithms for optimal motion planning, IJRR 2011), for any cost of
/// a whole path (thesis, 5.4.4).
///
/// A sample of the free space is approached by a step from the nearest node; where an obstacle is
/// in between, from the first node that is met on the way back from the sample over the cells, so
/// that the tree comes through doors as well. The new node's parent
/// is the one, of the nodes within r_n, by which its path costs least; then those nodes get the new
/// one as their parent whose paths then cost less, and the costs of all their descendants are
/// computed anew: each when it is asked for, since most change several times before. r_n = min(γ
/// (ln n / n)^{1/2}, r_max) with n nodes, and γ from the free area as asymptotic optimality asks,
/// for the two dimensions of a position (thesis: exponent 1/3, for three). For costs that do not
/// add up along a path no optimality holds.
template <PathCost Cost>
class RrtStar {
 public:
  struct Node {
    Eigen::Vector2d point;  ///< [m]
    int parent = -1;
    std::vector<int> children = {};
    typename Cost::State state;
    bool outdated = false;  ///< the state is that of a former path to it; never where others see it
  };

  /// `space` and `cost` must outlive it. The tree begins with `space.entry()`, which must not be
  /// empty.
  RrtStar(const FreeSpace& space, Cost& cost, const RrtStarOptions& options)
      : space_(space),
        cost_(cost),
        step_(options.step),
        reach_(std::max(options.reach, options.step)),
        gamma_(2.0 * std::sqrt(1.5 * space.area() / std::numbers::pi)),
        points_(corner(space, 0.0), corner(space, 1.0), std::max(options.step, 0.05)) {
    const std::vector<Eigen::Vector2d>& entry = space.entry();
    points_.add(entry.front());
    nodes_.push_back({.point = entry.front(), .state = cost_.root(entry.front())});
    for (std::size_t k = 1; k < entry.size(); ++k) {
      const int last = size() - 1;
      add(entry[k], last, extended(last, entry[k], nullptr));
    }
  }

  /// Grows the tree towards a point. The number of the new node; −1: nothing could be added.
  int extend(const Eigen::Vector2d& sample) {
    int nearest = points_.nearest(sample);
    const Eigen::Vector2d from = at(nearest).point, apart = sample - from;
    const double distance = apart.norm();
    if (distance == 0.0) return -1;
    Eigen::Vector2d point = distance <= step_ ? sample : from + apart * (step_ / distance);
    if (!space_.is_clear(from, point)) {
      nearest = -1;
      space_.trace_back(sample, [&](const Eigen::Vector2d& middle) {
        const int node = points_.nearest(middle);
        if ((at(node).point - middle).norm() > step_ || !space_.is_clear(at(node).point, middle))
          return true;
        nearest = node;
        point = middle;
        return false;
      });
      if (nearest < 0) return -1;
    }
    find_near(point, nearest);
    int parent = -1;
    typename Cost::State best = at(nearest).state;  // replaced below
    double least = std::numeric_limits<double>::infinity();
    for (const int near : near_) {
      auto state = extended(near, point, nullptr);
      const double value = cost_.value(state);
      if (parent >= 0 && !(value < least)) continue;
      parent = near;
      least = value;
      best = std::move(state);
    }
    const int added = add(point, parent, std::move(best));
    for (const int near : near_) {
      if (near != parent) rewire(near, added);
    }
    return added;
  }

  /// Adds nodes at random until there are `density` of them per m² of free space, or `seconds` are
  /// over, or `interrupt`, if not null, is true. False: it was one of the latter two, so that the
  /// tree depends on the clock. The time is for the states of all nodes as well.
  bool grow(RandomNumbers& random, double density,
            double seconds = std::numeric_limits<double>::infinity(),
            const std::atomic<bool>* interrupt = nullptr) {
    using Clock = std::chrono::steady_clock;
    const Clock::time_point start = Clock::now();
    const double wanted = std::ceil(density * space_.area());
    constexpr double kMostTries = 20.0;  // per node: space whose parts no segment joins stays empty
    for (double tries = kMostTries * wanted; size() < wanted && tries > 0.0; --tries) {
      if (interrupt && interrupt->load(std::memory_order_relaxed)) return false;
      if (std::isfinite(seconds)) {
        const double passed = std::chrono::duration<double>(Clock::now() - start).count();
        // And what the paths will take that are not up to date.
        if (passed * (evaluated_ + outdated_) > seconds * std::max(evaluated_, 1)) return false;
      }
      extend(space_.sample(random));
    }
    return true;
  }

  int size() const { return static_cast<int>(nodes_.size()); }
  const std::vector<Node>& nodes() const {
    for (int node = 0; outdated_ > 0 && node < size(); ++node) update(node);
    return nodes_;
  }
  double value(int node) const {
    update(node);
    return cost_.value(at(node).state);
  }
  /// From the root to a node, both included.
  std::vector<int> path(int node) const {
    std::vector<int> path;
    for (; node >= 0; node = at(node).parent) path.push_back(node);
    std::ranges::reverse(path);
    return path;
  }
  /// The node from which a path to a point of the space costs least, of those within `r_max`; −1:
  /// none can be joined with it.
  int best_before(const Eigen::Vector2d& point) {
    points_.within(point, reach_, near_);
    int best = -1;
    double least = std::numeric_limits<double>::infinity();
    for (const int near : near_) {
      if (!space_.is_clear(at(near).point, point)) continue;
      const double value = cost_.value(extended(near, point, nullptr));
      if (best >= 0 && !(value < least)) continue;
      best = near;
      least = value;
    }
    return best;
  }

 private:
  static Eigen::Vector2d corner(const FreeSpace& space, double part) {
    const GridFrame& frame = space.map().frame;
    Eigen::Vector2d low = frame.to_world({0.0, 0.0}), high = low;
    for (const Eigen::Vector2d& cells :
         {Eigen::Vector2d(frame.width, 0.0), Eigen::Vector2d(0.0, frame.height),
          Eigen::Vector2d(frame.width, frame.height)}) {
      low = low.cwiseMin(frame.to_world(cells));
      high = high.cwiseMax(frame.to_world(cells));
    }
    return part == 0.0 ? low : high;
  }

  Node& at(int node) const { return nodes_[static_cast<std::size_t>(node)]; }

  /// Nodes that a segment joins with a point, the nearest one among them.
  void find_near(const Eigen::Vector2d& point, int nearest) {
    const double n = size();
    const double radius = std::min(gamma_ * std::sqrt(std::log(n) / n), reach_);
    points_.within(point, radius, near_);
    std::erase_if(near_, [&](int near) {
      return near == nearest || !space_.is_clear(at(near).point, point);
    });
    near_.insert(near_.begin(), nearest);
  }

  int add(const Eigen::Vector2d& point, int parent, typename Cost::State state) {
    const int added = size();
    points_.add(point);
    nodes_.push_back({.point = point,
                      .parent = parent,
                      .state = cost_.adopted(std::move(state), at(parent).state)});
    at(parent).children.push_back(added);
    return added;
  }

  bool is_ancestor(int ancestor, int node) const {
    while (node >= 0 && node != ancestor) node = at(node).parent;
    return node >= 0;
  }

  void rewire(int node, int parent) {
    // A cost that is no metric may be less by way of a descendant.
    if (is_ancestor(node, parent)) return;
    auto state = extended(parent, at(node).point, nullptr);
    if (!(cost_.value(state) < value(node))) return;
    std::erase(at(at(node).parent).children, node);
    at(node).parent = parent;
    at(node).state = cost_.adopted(std::move(state), at(parent).state);
    at(parent).children.push_back(node);
    outdate_descendants(node);
  }

  /// The state of the path by way of a node.
  typename Cost::State extended(int node, const Eigen::Vector2d& to,
                                const typename Cost::State* before) const {
    update(node);
    ++evaluated_;
    return cost_.extended(at(node).state, at(node).point, to, before);
  }

  /// Where a node is outdated all behind it are.
  void outdate_descendants(int node) {
    open_.assign(1, node);
    while (!open_.empty()) {
      const Node& above = at(open_.back());
      open_.pop_back();
      for (const int child : above.children) {
        if (std::exchange(at(child).outdated, true)) continue;
        ++outdated_;
        open_.push_back(child);
      }
    }
  }

  void update(int node) const {
    if (!at(node).outdated) return;
    std::vector<int> outdated;
    for (; at(node).outdated; node = at(node).parent) outdated.push_back(node);
    for (; !outdated.empty(); outdated.pop_back()) {
      Node& below = at(outdated.back());
      below.outdated = false;
      --outdated_;
      auto state = extended(below.parent, below.point, &below.state);
      below.state = cost_.adopted(std::move(state), at(below.parent).state);
    }
  }

  const FreeSpace& space_;
  Cost& cost_;
  double step_, reach_, gamma_;
  PointBuckets points_;
  mutable std::vector<Node> nodes_;
  std::vector<int> near_, open_;              ///< of the newest point
  mutable int outdated_ = 0, evaluated_ = 0;  ///< nodes; paths, so far
};

}  // namespace cairn
