// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <span>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "models.hpp"
#include "states.hpp"

namespace cairn::incremental {

/// What the cost of some factors, a part of chi2, may be off by rounding.
class CostRounding {
 public:
  /// A factor more, that has been linearised.
  void add(const Graph& graph, const States& states, const Models& models, int f);
  /// Factors have gone or changed: it is to be summed anew, since a difference of very unequal
  /// numbers would lose the small ones.
  void forget() { is_known_ = false; }
  bool is_known() const { return is_known_; }
  /// No factors.
  void clear() {
    scale_ = 0.0;
    is_known_ = true;
  }
  double value() const;

 private:
  double scale_of(const Graph& graph, const States& states, const Models& models, int f);
  /// For each coordinate of a variable's steps whether it moves its position, 1 or 0.
  std::span<const double> moves_position(const VariableType& type);

  double scale_ = 0.0;  // sum over the factors
  bool is_known_ = true;
  std::map<const VariableType*, std::vector<double>> moves_position_;
};

}  // namespace cairn::incremental
