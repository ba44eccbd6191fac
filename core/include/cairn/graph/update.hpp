// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "cairn/graph/elements.hpp"

namespace cairn {

class Information;

/// A factor within an estimator: numbered in the order of addition, from 0, never used twice.
using FactorId = std::int64_t;

/// A factor that gets another measurement and, unless empty, another information matrix.
struct ChangedFactor {
  FactorId factor = 0;
  std::vector<double> measurement;
  std::vector<double> information;
};

/// What happened since the last update. Applied in this order: variables, factors, changed,
/// marginalized, removed factors, removed variables.
struct GraphUpdate {
  std::vector<Variable> variables;
  std::vector<Factor> factors;
  std::vector<ChangedFactor> changed;
  /// Variables that leave, and whose information stays: their factors are replaced by a
  /// `MarginalPrior` on their neighbours, linearised at the current estimate.
  std::vector<Id> marginalized;
  std::vector<FactorId> removed_factors;
  /// Variables that leave with all factors on them.
  std::vector<Id> removed_variables;

  // Values: defined in cairn/typed/build.hpp ------------------------------------------------------
  /// A variable with an initial estimate, such as a `Pose2`.
  template <class T>
  void add(Id id, const T& value);
  /// A variable that a measurement of this update places: add<Pose2>(3).
  template <class T>
  void add(Id id);
  /// A measurement, such as a `Between`, with its information and, unless null, a loss of its own.
  template <class M>
  void add(const M& measurement, const Information& information,
           std::shared_ptr<const Loss> loss = nullptr);

  bool empty() const {
    return variables.empty() && factors.empty() && changed.empty() && marginalized.empty() &&
           removed_factors.empty() && removed_variables.empty();
  }
};

}  // namespace cairn
