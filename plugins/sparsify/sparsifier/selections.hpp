// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/plugin/option_fields.hpp"
#include "cairn/sparsification/selection.hpp"

namespace cairn::sparsify {

struct KeepEveryOptions {
  int every = 2;  ///< one of so many nodes stays

  static auto fields() {
    return OptionFields<KeepEveryOptions>().integer("every", &KeepEveryOptions::every, 1,
                                                    1000000000, "one of so many nodes stays");
  }
};

/// Every N-th node stays, the first of all among them, and the last of the graph; the others leave
/// in their order (T 4.6.4). Counts on where the call before ended, for nodes that come bit by bit.
class KeepEvery final : public NodeSelection {
 public:
  explicit KeepEvery(int every) : every_(every) {}
  std::vector<int> select(const Graph& graph, std::span<const int> nodes,
                          Sparsifier& sparsifier) override;

 private:
  int every_;
  std::int64_t seen_ = 0;
};

/// Options of `least_loss`, `smallest_blanket` and `oldest`.
struct PartOptions {
  double part = 0.5;  ///< of the nodes that may leave

  static auto fields() {
    return OptionFields<PartOptions>().real("part", &PartOptions::part, 0.0, 1.0,
                                            "of the nodes that may leave");
  }
};

/// A selection of as many nodes as are wanted: by `select` a part of those that may leave.
class SelectionByPart : public NodeSelection {
 public:
  explicit SelectionByPart(double part) : part_(part) {}
  std::vector<int> select(const Graph& graph, std::span<const int> nodes,
                          Sparsifier& sparsifier) final;

 private:
  double part_;
};

/// The part of the nodes whose removal increases the divergence least leaves, round by round: in
/// each those with the least divergence that are not neighbours, of an eighth of what is still to
/// leave; then the rest is evaluated again.
class LeastLoss final : public SelectionByPart {
 public:
  using SelectionByPart::SelectionByPart;
  std::vector<int> choose(const Graph& graph, std::span<const int> nodes, Sparsifier& sparsifier,
                          int count) override;
};

/// The part of the nodes with the smallest Markov blankets leaves, always the smallest of what is
/// left; of equals the one that leaves the shortest gap in the order of the nodes, so that chains
/// are thinned out evenly, and gaps of more than 8 only where nothing else may leave. The blanket
/// of a node that leaves is taken to be connected afterwards as a ring.
class SmallestBlanket final : public SelectionByPart {
 public:
  using SelectionByPart::SelectionByPart;
  std::vector<int> choose(const Graph& graph, std::span<const int> nodes, Sparsifier& sparsifier,
                          int count) override;
};

/// The oldest part of the nodes (those that came first) leaves.
class Oldest final : public SelectionByPart {
 public:
  using SelectionByPart::SelectionByPart;
  std::vector<int> choose(const Graph& graph, std::span<const int> nodes, Sparsifier& sparsifier,
                          int count) override;
};

struct NearestOptions {
  double part = 0.5;   ///< of the nodes that may leave
  double angle = 0.0;  ///< [m]
  int neighbours = 14;
  bool leaving = false;  ///< only nodes that may leave count

  static auto fields() {
    using O = NearestOptions;
    return OptionFields<O>()
        .real("part", &O::part, 0.0, 1.0, "of the nodes that may leave")
        .real("angle", &O::angle, 0.0, 1e9,
              "the distance that a difference in orientation of a radian counts for [m]")
        .integer("neighbours", &O::neighbours, 1, 1000000000,
                 "nodes with more neighbours leave only if none with fewer may")
        .boolean("leaving", &O::leaving,
                 "only distances between nodes that may both leave count, so that not those beside "
                 "the newest leave, where the robot is now");
  }
};

/// One by one, of the two nodes nearest to each other the one whose removal increases the
/// divergence less leaves: so those that stay cover the space where the robot was as evenly as
/// their number permits. With `leaving` both of the two may leave: of a map that grows while the
/// newest pose stays in any case, those just behind it would leave first otherwise, and a place
/// that is new would never get a pose that stays. The distance of two nodes is √(‖t_a − t_b‖² +
/// (angle · rotation)²).
class Nearest final : public SelectionByPart {
 public:
  explicit Nearest(const NearestOptions& options)
      : SelectionByPart(options.part),
        angle_(options.angle),
        neighbours_(options.neighbours),
        leaving_(options.leaving) {}
  std::vector<int> choose(const Graph& graph, std::span<const int> nodes, Sparsifier& sparsifier,
                          int count) override;

 private:
  double angle_;
  int neighbours_;
  bool leaving_;
};

struct CoverageOptions {
  double distance = 1.0;  ///< [m]
  double angle = 0.7;     ///< [rad]

  static auto fields() {
    using O = CoverageOptions;
    return OptionFields<O>()
        .real("distance", &O::distance, 1e-9, 1e9, "a node that stays is nearer than this [m]")
        .real("angle", &O::angle, 0.0, 3.15, "and turned by less than this [rad]");
  }
};

/// A node leaves if one that stays is so near, in place and in orientation: what stays covers the
/// same space. In the order of the nodes.
class Coverage final : public NodeSelection {
 public:
  Coverage(double distance, double angle) : distance_(distance), angle_(angle) {}
  std::vector<int> select(const Graph& graph, std::span<const int> nodes,
                          Sparsifier& sparsifier) override;

 private:
  double distance_, angle_;
};

}  // namespace cairn::sparsify
