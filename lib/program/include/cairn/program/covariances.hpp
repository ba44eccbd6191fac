// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include <boost/json/fwd.hpp>

#include "cairn/graph/graph.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/registry.hpp"

namespace cairn::app {

/// A linear solver that can give covariances, or determinants.
struct CovarianceSolver {
  std::string name;  ///< as on the command line
  std::unique_ptr<LinearSolver> solver;
};

/// Makes a linear solver, before any work is done. Throws `Error` (usage) if it cannot give
/// covariances, naming those that can.
CovarianceSolver make_covariance_solver(const std::string& name, Registry& registry);

/// The same of one that has determinants; with `covariances` it must have both abilities.
CovarianceSolver make_determinant_solver(const std::string& name, Registry& registry,
                                         bool covariances);

/// A second one of what an optimizer solves with. Throws `Error` (usage) also for an optimizer that
/// brings linear solvers of its own.
CovarianceSolver covariance_solver_of(const ComponentSpec& optimizer, Registry& registry);

/// Diagonal blocks of Σ at a graph's states, as of `GraphMarginals`.
struct DiagonalCovariances {
  bool there = false;
  std::string why_not;  ///< H could not be factorised; or empty
  std::string linear_solver;
  std::vector<double> blocks;
  double linearize = 0.0, factorize = 0.0, marginals = 0.0;  ///< [s]; analysis with the second

  double seconds() const { return linearize + factorize + marginals; }
};
DiagonalCovariances diagonal_covariances(const Graph& graph, CovarianceSolver& solver);

/// {"linear_solver", "seconds", "blocks": [{"id", "covariance"}, …]}, or null where there are none.
boost::json::value to_json(const DiagonalCovariances& covariances, const Graph& graph);

/// A matrix, given by columns, as a list of rows.
boost::json::array rows_json(std::span<const double> matrix, int rows, int columns);

}  // namespace cairn::app
