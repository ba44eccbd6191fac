// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "problem.hpp"

namespace cairn::incremental {

/// New poses whose factors are not admitted yet: meanwhile each moves with the first other pose
/// that a factor joins it with.
class PendingPoses {
 public:
  /// x_v at the estimate that is to be seen.
  using StateOf = std::function<std::vector<double>(std::int32_t v)>;

  /// A factor has been added that is to wait.
  void note(const Problem& problem, int f, const StateOf& x);
  /// Moves all with the poses that they are joined with.
  void place(Problem& problem) const;
  void clear() { pending_.clear(); }

 private:
  struct Pending {
    std::int32_t variable, reference;
    std::vector<double> relative;  ///< x_reference⁻¹ x_variable, both of one Lie group
  };
  bool contains(std::int32_t v) const;

  std::vector<Pending> pending_;
};

}  // namespace cairn::incremental
