// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "draft.hpp"

namespace cairn::formats {

/// Variables that are one (TORO's `EQUIV a b`). Of those that are one the smallest id stays: it is
/// what factors on any of them are on, and what is fixed if any of them is. A relative measurement
/// between two that are one measures nothing that could change, and is left out; all is noted.
class Equivalences {
 public:
  void add(Id a, Id b, std::int64_t line) { pairs_.push_back({a, b, line}); }
  /// To be called before `Draft::build`. Throws `Error` (input) where one is not in the file, or of
  /// another type than the other.
  void apply(Draft& draft);

 private:
  struct Pair {
    Id a, b;
    std::int64_t line;
  };

  Id root(Id id);
  void join(const Pair& pair);
  void check(Draft& draft) const;
  void rename(Draft& draft);
  void drop_loops(Draft& draft);

  std::vector<Pair> pairs_;
  std::map<Id, Id> parent_;
};

}  // namespace cairn::formats
