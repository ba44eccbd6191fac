// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <numeric>
#include <utility>
#include <vector>

namespace cairn {

/// Sets of the numbers 0 … n − 1 that are joined one by one, by path halving: the components of a
/// graph while edges are added.
class DisjointSets {
 public:
  explicit DisjointSets(int size) : parent_(size) { std::iota(parent_.begin(), parent_.end(), 0); }
  /// One number of the set, the same for all in it until the next `join`.
  int find(int k) {
    while (parent_[k] != k) k = std::exchange(parent_[k], parent_[parent_[k]]);
    return k;
  }
  /// Whether the two were in different sets.
  bool join(int a, int b) {
    a = find(a);
    b = find(b);
    parent_[b] = a;
    return a != b;
  }

 private:
  std::vector<int> parent_;
};

}  // namespace cairn
