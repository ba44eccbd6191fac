// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "cairn/types/factor_type.hpp"
#include "cairn/types/loss.hpp"
#include "cairn/types/variable_type.hpp"

namespace cairn {

/// The name of a variable in a file: unique within a graph, not necessarily contiguous.
using Id = std::int64_t;

/// A variable as a value: what is needed to add it to a graph or an estimator.
struct Variable {
  std::shared_ptr<const VariableType> type;
  Id id = 0;
  /// Initial estimate, ambient_size doubles. In a `GraphUpdate` it may be empty: the first of the
  /// update's factors that can (`FactorType::propagate`) computes it from the current estimate of
  /// the other variables.
  std::vector<double> state = {};
  bool fixed = false;
};

/// A factor as a value: a measurement on variables named by their ids.
struct Factor {
  std::shared_ptr<const FactorType> type;
  std::vector<Id> variables;
  std::vector<double> measurement;  ///< measurement_size doubles
  /// Upper triangle row by row, n(n+1)/2 doubles for a residual of n; positive semidefinite.
  std::vector<double> information;
  /// Robust loss of this factor; null: none, or what the graph's or the estimator's rule says.
  std::shared_ptr<const Loss> loss = nullptr;
};

}  // namespace cairn
