// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/solve/optimizer.hpp"

namespace cairn {

/// Leads `values` away from where factors have residuals that no small motion of their variables
/// lowers, though larger ones do: a direction measured opposite to that of the state, a landmark in
/// the very place from which its bearing and range were measured, a rotation by half a turn in some
/// metrics. The gradient Jᵀr vanishes there, so that an optimizer ends at once, but it is no
/// minimum.
///
/// A variable goes where the measurement puts it (`FactorType::propagate`) if that lowers the sum
/// of the residuals of its factors, and else some way in a direction at random, which `attempt`
/// chooses. Returns the position of the first such factor; nothing where there is none. Takes
/// residuals of all factors but those that cannot be such, and Jacobians of some hundreds.
///
/// @param held by variable: those that stay. @param chi2 at `values`.
std::optional<int> leave_stationary_factors(const Graph& graph, const std::vector<bool>& held,
                                            double chi2, unsigned attempt, Values& values);

/// The times that an optimisation goes on from beside stationary factors.
class Departures {
 public:
  /// Whether to go on, from `values`, that had this chi2 and are beside it now. No more if the last
  /// departure has led to nothing better.
  bool depart(const Graph& graph, const std::vector<bool>& held, double chi2, Values& values);
  /// The same for an initial estimate, which is left only for one with a lower chi2 than it has:
  /// `chi2_of(values)`.
  template <class Chi2>
  bool depart_at_start(const Graph& graph, const std::vector<bool>& held, double chi2,
                       const Chi2& chi2_of, Values& values) {
    Values beside = values;
    Departures first;
    if (!first.depart(graph, held, chi2, beside) || !(chi2_of(beside) < chi2)) return false;
    values = std::move(beside);
    *this = first;
    return true;
  }

  /// What came of it, for the notes; empty if there is nothing to say, as where the run came back
  /// to the same chi2, which shows a minimum after all. `chi2`, `status`: where the last run ended.
  /// Status becomes converged again if that run found nothing and did not end well.
  std::string conclude(const Graph& graph, double best_chi2, double chi2, Status& status) const;

 private:
  unsigned count_ = 0;
  double first_ = 0.0, last_ = 0.0;  // chi2 that was left
  int factor_ = -1;                  // that was stationary at the first time
};

}  // namespace cairn
