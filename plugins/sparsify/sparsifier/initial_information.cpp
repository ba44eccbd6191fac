// SPDX-License-Identifier: BSD-3-Clause
#include "initial_information.hpp"

#include <utility>

#include "cairn/runtime/error.hpp"

namespace cairn::sparsify {

void begin(const RecoveryProblem& problem, InitialInformation initial, Approximation& at) {
  const ScaledProblem& scaled = at.problem();
  double rows = 0.0;
  for (int k = 0; k < scaled.factors(); ++k) rows += scaled.size(k);
  const double share = rows > 0.0 ? scaled.rank / rows : 1.0;
  std::vector<Matrix> W;
  for (int k = 0; k < scaled.factors(); ++k) {
    const int m = scaled.size(k);
    const RecoveryProblem::Factor& factor = problem.factors[k];
    if (initial == InitialInformation::odb && !factor.off_diagonal.empty()) {
      const Eigen::Map<const Matrix> guess(factor.off_diagonal.data(), m, m);
      // With something of the other guess, lest Λ̆ be singular where blocks are negative.
      W.push_back(nearest_positive(scaled.scaled(k, guess), 1e-3 * share));
    } else if (initial == InitialInformation::identity || initial == InitialInformation::ffd) {
      W.push_back(scaled.scaled(k, Matrix::Identity(m, m)));
    } else {
      W.push_back(share * Matrix::Identity(m, m));
    }
  }
  if (!at.set(std::move(W))) {
    throw Error(ErrorCode::numerical,
                "the factors of the topology do not determine the relative poses of the nodes");
  }
  if (initial != InitialInformation::ffd) return;
  for (int k = 0; k < scaled.factors(); ++k) at.change(k, at.best(k).W);
}

}  // namespace cairn::sparsify
