// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "problem.hpp"

namespace cairn::incremental {

/// New poses whose factors are not admitted yet: meanwhile each moves with the first other pose
/// that a factor joins it with.
class Followers {
 public:
  /// x_v at the estimate that is to be seen.
  using StateOf = std::function<std::vector<double>(std::int32_t v)>;

  /// A factor has been added that is to wait.
  void note(const Problem& problem, int f, const StateOf& x);
  /// Puts all where the poses that they follow have moved to.
  void place(Problem& problem) const;
  void clear() { followers_.clear(); }

 private:
  struct Follower {
    std::int32_t variable, leader;
    std::vector<double> relative;  ///< x_leader⁻¹ x_variable, both of one Lie group
  };
  bool contain(std::int32_t v) const;

  std::vector<Follower> followers_;
};

}  // namespace cairn::incremental
