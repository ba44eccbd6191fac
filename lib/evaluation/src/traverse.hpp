// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <vector>

#include <Eigen/Core>

#include "cairn/graph/graph.hpp"

namespace cairn {

/// Measurements that lead from variables whose place is known to others: what surveyors call a
/// traverse. Each step places a variable by a factor whose other variables come before it, and the
/// closing factors, between variables that have been placed, say whether all fits.
struct Traverse {
  struct Step {
    int variable = 0;
    int factor = -1;  ///< −1: fixed, or `loose`
  };
  std::vector<Step> steps;
  std::vector<int> closing;
  int loose = -1;  ///< the variable that is where the closing factors fit best, −1: there is none
  std::vector<int> known;  ///< variables: those without a step before them, rising

  std::vector<int> factors() const;  ///< all, rising; without those that place what is known
};

/// By how much a traverse does not close.
///
/// To first order its closing factors have the residual b + Σ_v A_v δ_v + n at its end, δ_v being
/// how far variable v of those known is from where it should be, and n what the noise of all
/// factors makes of it. P is the information of that, without what `loose` takes up.
struct Misclosure {
  int freedoms = 0;  ///< of chi2; 0: nothing can be said
  /// The least Σ‖r‖² of all factors of the traverse, where that is implausible; else an upper bound
  /// of it.
  double chi2 = 0.0;
  Eigen::VectorXd b;
  Eigen::MatrixXd P;
  std::map<int, Eigen::MatrixXd> A;           ///< by variable
  std::map<int, std::vector<double>> states;  ///< of the variables, each where its step places it

  bool is_plausible() const;
  /// What its chi2 would be, were variable v of those known moved by δ.
  double chi2_after(int v, const Eigen::VectorXd& delta) const;
};

/// Takes time in proportion to the number of steps. The noise of any step, of headings above all,
/// is taken as large as it has to be: angles are not linear. What factors throw passes.
Misclosure misclosure(const Graph& graph, const Traverse& traverse);

}  // namespace cairn
