// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <numeric>
#include <utility>
#include <vector>

namespace cairn {

/// Sets of the numbers 0 … n − 1 that are joined one by one, by path halving: the components of a
/// graph while edges are added. A set is named by the smallest of its numbers.
class DisjointSets {
 public:
  explicit DisjointSets(int size) : parent_(size) { std::iota(parent_.begin(), parent_.end(), 0); }
  /// The smallest number of the set.
  int find(int k) {
    while (parent_[k] != k) k = std::exchange(parent_[k], parent_[parent_[k]]);
    return k;
  }
  /// Whether the two were in different sets.
  bool join(int a, int b) {
    if (parent_[a] == parent_[b]) return false;  // most have been joined before
    a = find(a);
    b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
    return a != b;
  }

 private:
  std::vector<int> parent_;
};

}  // namespace cairn
