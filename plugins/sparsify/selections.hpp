// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/sparsification/sparsification.hpp"

namespace cairn::sparsify {

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

/// The part of the nodes whose removal increases the divergence least leaves, round by round: in
/// each those with the least divergence that are not neighbours, of an eighth of what is still to
/// leave; then the rest is evaluated again.
class LeastLoss final : public NodeSelection {
 public:
  explicit LeastLoss(double part) : part_(part) {}
  std::vector<int> select(const Graph& graph, std::span<const int> nodes,
                          Sparsifier& sparsifier) override;

 private:
  double part_;
};

/// The part of the nodes with the smallest Markov blankets leaves, always the smallest of what is
/// left. The blanket of a node that leaves is taken to be connected afterwards as a ring.
class SmallestBlanket final : public NodeSelection {
 public:
  explicit SmallestBlanket(double part) : part_(part) {}
  std::vector<int> select(const Graph& graph, std::span<const int> nodes,
                          Sparsifier& sparsifier) override;

 private:
  double part_;
};

/// The oldest part of the nodes (those that came first) leaves.
class Oldest final : public NodeSelection {
 public:
  explicit Oldest(double part) : part_(part) {}
  std::vector<int> select(const Graph& graph, std::span<const int> nodes,
                          Sparsifier& sparsifier) override;

 private:
  double part_;
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
