// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <ceres/solver.h>

#include "cairn/plugin/option_fields.hpp"

namespace cairn {

/// Options of the optimizer `ceres_line_search`; the choices are Ceres' own names.
struct LineSearchOptions {
  std::string direction = "lbfgs";
  std::string line_search = "wolfe";
  std::string conjugate_gradient = "fletcher_reeves";
  int rank = 20;                         ///< pairs of steps and gradients that L-BFGS keeps
  std::string scaling = "block_jacobi";  ///< coordinates in which Ceres works
  int max_size = 3000;                   ///< unknowns, with the dense matrix of BFGS

  static auto fields() {
    using O = LineSearchOptions;
    return OptionFields<O>()
        .choice("direction", &O::direction,
                {"lbfgs", "bfgs", "nonlinear_conjugate_gradient", "steepest_descent"},
                "search direction")
        .choice(
            "line_search", &O::line_search, {"wolfe", "armijo"},
            "what a step must fulfil: the strong Wolfe conditions, or sufficient decrease alone "
            "(for conjugate_gradient and steepest_descent)")
        .choice("conjugate_gradient", &O::conjugate_gradient,
                {"fletcher_reeves", "polak_ribiere", "hestenes_stiefel"},
                "formula of direction=nonlinear_conjugate_gradient")
        .integer("rank", &O::rank, 1, 1e6,
                 "pairs of steps and gradients that direction=lbfgs keeps")
        .choice(
            "scaling", &O::scaling, {"block_jacobi", "none"},
            "coordinates: the diagonal blocks of H become unit matrices at the initial estimate, "
            "or as they are, in metres and radians")
        .integer("max_size", &O::max_size, 1, 1e6,
                 "direction=bfgs keeps a dense matrix, and refuses more unknowns than this");
  }
};

/// The same as Ceres' own options. Throws `Error` (usage) for a combination that Ceres does not
/// accept (L-BFGS and BFGS need the Wolfe conditions).
ceres::Solver::Options line_search_solver_options(const LineSearchOptions& options);

}  // namespace cairn
