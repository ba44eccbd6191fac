// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace cairn::incremental {

/// Some of the variables, each once, in the order in which they have come.
class VariableSet {
 public:
  /// There is one variable more, which is not in the set.
  void add_variable() { contains_.push_back(0); }
  bool contains(std::int32_t v) const { return contains_[v] != 0; }
  void insert(std::int32_t v) {
    if (!std::exchange(contains_[v], 1)) list_.push_back(v);
  }
  void clear() {
    for (const std::int32_t v : list_) contains_[v] = 0;
    list_.clear();
  }
  const std::vector<std::int32_t>& list() const { return list_; }

 private:
  std::vector<std::int32_t> list_;
  std::vector<std::uint8_t> contains_;  // by variable
};

}  // namespace cairn::incremental
