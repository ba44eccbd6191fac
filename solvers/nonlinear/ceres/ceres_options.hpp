// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include <ceres/loss_function.h>
#include <ceres/solver.h>

#include "cairn/plugin/options.hpp"

namespace cairn {

/// Loss functions of Ceres itself.
struct CeresLoss {
  std::string name = "none";
  double scale = 1.0;  ///< residual norm at which the loss turns robust
};

OptionTable ceres_option_table();

/// Ceres' options from the table's. Throws `Error` (usage) for a combination that Ceres does not
/// accept, with Ceres' own words.
ceres::Solver::Options ceres_solver_options(const Options& options);

/// Null for "none".
std::unique_ptr<ceres::LossFunction> make_ceres_loss(const CeresLoss& loss);

}  // namespace cairn
