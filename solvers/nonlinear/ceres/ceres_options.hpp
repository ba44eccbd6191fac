// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <ceres/solver.h>

#include "cairn/plugin/option_fields.hpp"

namespace cairn {

/// Options of the optimizer `ceres`. Ceres' own parsers take its own names; those names are the
/// choices.
struct CeresOptions {
  std::string linear_solver_type = "sparse_normal_cholesky";
  std::string sparse_library = "suite_sparse";
  double initial_radius = 1e4;  ///< of the trust region

  static auto fields() {
    using O = CeresOptions;
    return OptionFields<O>()
        .choice("linear_solver_type", &O::linear_solver_type,
                {"sparse_normal_cholesky", "dense_normal_cholesky", "dense_qr", "dense_schur",
                 "sparse_schur", "iterative_schur", "cgnr"},
                "Ceres' linear solver")
        .choice("sparse_library", &O::sparse_library, {"suite_sparse", "cx_sparse", "eigen_sparse"},
                "Ceres' sparse linear algebra")
        .real("initial_radius", &O::initial_radius, 1e-30, 1e30,
              "of the trust region: damping begins at its inverse");
  }
};

/// The same as Ceres' own options. Throws `Error` (usage) for a combination that Ceres does not
/// accept, with Ceres' own words.
ceres::Solver::Options ceres_solver_options(const CeresOptions& options);

}  // namespace cairn
