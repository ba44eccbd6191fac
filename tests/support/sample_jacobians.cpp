// SPDX-License-Identifier: BSD-3-Clause
#include "support/sample_jacobians.hpp"

#include <vector>

#include "support/sample_matrices.hpp"

namespace cairn::test {

JacobianStructure jacobian_structure(const BlockStructure& s) {
  std::vector<std::int32_t> row_sizes, columns;
  std::vector<std::int64_t> row_begin{0};
  for (std::int32_t j = 0; j < s.blocks(); ++j) {
    for (std::int64_t e = s.column_begin()[j]; e < s.column_begin()[j + 1]; ++e) {
      const std::int32_t i = s.rows()[e];
      columns.push_back(i);
      if (i != j) columns.push_back(j);
      row_sizes.push_back(i == j ? s.block_size(j) : 3);
      row_begin.push_back(static_cast<std::int64_t>(columns.size()));
    }
  }
  return {std::move(row_sizes),
          {s.sizes().begin(), s.sizes().end()},
          std::move(row_begin),
          std::move(columns)};
}

void fill_full_rank(JacobianMatrix& J, std::uint64_t seed, double prior) {
  const JacobianStructure& s = J.structure();
  Random random(seed);
  for (double& value : J.values()) value = random();
  for (double& value : J.residual()) value = random();
  for (int row = 0; row < s.block_rows(); ++row) {
    const std::int64_t e = s.row_begin()[row];
    if (s.row_begin()[row + 1] != e + 1) continue;
    const int n = s.row_sizes()[row];
    Eigen::Map<Eigen::MatrixXd>(J.block(e), n, n).diagonal().array() += prior;
  }
}

Eigen::MatrixXd dense(const JacobianMatrix& J) {
  const JacobianStructure& s = J.structure();
  Eigen::MatrixXd whole = Eigen::MatrixXd::Zero(s.rows(), s.size());
  for (int row = 0; row < s.block_rows(); ++row) {
    for (std::int64_t e = s.row_begin()[row]; e < s.row_begin()[row + 1]; ++e) {
      const int column = s.columns()[e];
      whole.block(s.row_offsets()[row], s.column_offsets()[column], s.row_sizes()[row],
                  s.column_sizes()[column]) =
          Eigen::Map<const Eigen::MatrixXd>(J.block(e), s.row_sizes()[row],
                                            s.column_sizes()[column]);
    }
  }
  return whole;
}

}  // namespace cairn::test
