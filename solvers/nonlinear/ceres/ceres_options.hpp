// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include <ceres/loss_function.h>
#include <ceres/solver.h>

#include "cairn/plugin/option_fields.hpp"

namespace cairn {

/// Loss functions of Ceres itself.
struct CeresLoss {
  std::string name = "none";
  double scale = 1.0;  ///< residual norm at which the loss turns robust

  static auto fields() {
    return OptionFields<CeresLoss>()
        .choice("loss", &CeresLoss::name,
                {"none", "huber", "soft_l_one", "cauchy", "arctan", "tukey"},
                "a loss of Ceres' own, for graphs that have none")
        .real("loss_scale", &CeresLoss::scale, 1e-30, 1e30,
              "whitened residual norm at which that loss turns robust");
  }
};

/// Options of the optimizer `ceres`. Ceres' own parsers take its own names; those names are the
/// choices.
struct CeresOptions {
  std::string linear_solver_type = "sparse_normal_cholesky";
  std::string sparse_library = "suite_sparse";
  std::string trust_region = "levenberg_marquardt";
  std::string dogleg = "traditional_dogleg";
  double initial_radius = 1e4;  ///< of the trust region
  CeresLoss loss{};

  static auto fields() {
    using O = CeresOptions;
    return OptionFields<O>()
        .choice("linear_solver_type", &O::linear_solver_type,
                {"sparse_normal_cholesky", "dense_normal_cholesky", "dense_qr", "dense_schur",
                 "sparse_schur", "iterative_schur", "cgnr"},
                "Ceres' linear solver")
        .choice("sparse_library", &O::sparse_library, {"suite_sparse", "cx_sparse", "eigen_sparse"},
                "Ceres' sparse linear algebra")
        .choice("trust_region", &O::trust_region, {"levenberg_marquardt", "dogleg"},
                "trust region method")
        .choice("dogleg", &O::dogleg, {"traditional_dogleg", "subspace_dogleg"}, "kind of dogleg")
        .real("initial_radius", &O::initial_radius, 1e-30, 1e30,
              "of the trust region: damping begins at its inverse")
        .part(&O::loss);
  }
};

/// The same as Ceres' own options. Throws `Error` (usage) for a combination that Ceres does not
/// accept, with Ceres' own words.
ceres::Solver::Options ceres_solver_options(const CeresOptions& options);

/// Null for "none".
std::unique_ptr<ceres::LossFunction> make_ceres_loss(const CeresLoss& loss);

}  // namespace cairn
