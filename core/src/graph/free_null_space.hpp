// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "equilibrated_rows.hpp"

namespace cairn {

/// How a variable moves with one parameter.
struct Column {
  int parameter;
  Eigen::VectorXd delta;
};

/// Parameters that rows have in common, and the sum S = Σ RᵀR of these rows, R = Σ J T over the
/// variables of a factor; `size`, by parameter: what that is at most, Σ Σ Tᵀ D T, D the squared
/// norms of the columns of J, the largest of each unit.
struct Part {
  std::vector<int> parameters;
  Eigen::MatrixXd S;
  Eigen::VectorXd size;
  int added = 0;      ///< factors
  bool dead = false;  ///< all of its parameters are determined
};

/// 1 / √d, 1 for what is zero.
Eigen::VectorXd inverse_root(const Eigen::VectorXd& diagonal);

/// diag(scale) A diag(scale).
Eigen::MatrixXd scaled(const Eigen::MatrixXd& A, const Eigen::VectorXd& scale);

/// What a search along factors leaves: variables that move by parameters, δ = T α.
struct MovingVariables {
  EquilibratedRows& rows;
  std::span<const Part> parts;
  std::span<const int> part_of;                  ///< by parameter
  std::span<const std::vector<Column>> columns;  ///< by variable, of the parts that are not dead
  std::function<std::span<const std::int32_t>(std::int32_t)> factors_of;
};

/// The directions that no row sees, each of few variables; what was found before a Jacobian was not
/// finite is to be thrown away.
std::vector<FreeDirection> free_null_space(const MovingVariables& moving);

}  // namespace cairn
