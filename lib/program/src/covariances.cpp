// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/covariances.hpp"

#include <chrono>

#include <fmt/core.h>
#include <boost/json/object.hpp>

#include "cairn/linear/graph_marginals.hpp"
#include "cairn/linear/marginals.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/problem_setup.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

using Ability = bool (*)(LinearSolver&);

bool has_marginals(LinearSolver& solver) { return query<Marginals>(solver); }
bool has_determinant(LinearSolver& solver) { return query<LogDeterminant>(solver); }
bool has_both(LinearSolver& solver) { return has_marginals(solver) && has_determinant(solver); }

std::vector<std::string> solvers_that_can(Registry& registry, Ability can = has_marginals) {
  std::vector<std::string> names;
  for (const std::string& name : registry.names(LinearSolver::kKind)) {
    try {
      if (can(*registry.make<LinearSolver>(name))) names.push_back(name);
    } catch (const Error&) {
      // A plugin that cannot be loaded is nothing to recommend.
    }
  }
  return names;
}

}  // namespace

CovarianceSolver make_covariance_solver(const std::string& name, Registry& registry) {
  CovarianceSolver made{name, registry.make<LinearSolver>(name)};
  if (query<Marginals>(*made.solver)) return made;
  throw Error(ErrorCode::usage,
              fmt::format("linear solver '{}' gives no covariances: it lacks the ability '{}', "
                          "since it does not solve exactly; these have: {}",
                          name, Marginals::kAbility, joined(solvers_that_can(registry), ", ")));
}

CovarianceSolver make_determinant_solver(const std::string& name, Registry& registry,
                                         bool covariances) {
  const Ability can = covariances ? has_both : has_determinant;
  CovarianceSolver made{name, registry.make<LinearSolver>(name)};
  if (can(*made.solver)) return made;
  throw Error(
      ErrorCode::usage,
      fmt::format("linear solver '{}' gives no {}; these do: {}", name,
                  covariances ? "determinants and covariances (abilities 'log_determinant' and "
                                "'marginals')"
                              : "determinants (ability 'log_determinant')",
                  joined(solvers_that_can(registry, can), ", ")));
}

CovarianceSolver covariance_solver_of(const ComponentSpec& optimizer, Registry& registry) {
  const auto name = optimizer.values.find(kLinearSolverOption);
  if (takes_linear_solver(registry, optimizer) && name != optimizer.values.end())
    return make_covariance_solver(name->second, registry);
  throw Error(ErrorCode::usage,
              fmt::format("optimizer '{}' solves with linear solvers of its own, which give no "
                          "covariances; take another optimizer, with one of {}, or write the "
                          "estimate with -o and run cairn marginals on that with --as-given",
                          optimizer.name, joined(solvers_that_can(registry), ", ")));
}

DiagonalCovariances diagonal_covariances(const Graph& graph, CovarianceSolver& solver) {
  DiagonalCovariances result;
  result.linear_solver = solver.name;
  GraphMarginals marginals(graph, *solver.solver);
  const Factorization factorization = marginals.factorize();
  result.linearize = marginals.seconds().linearize;
  result.factorize = marginals.seconds().analyze + marginals.seconds().factorize;
  if (!factorization.ok) {
    result.why_not = marginals.explain(factorization);
    return result;
  }
  const auto begin = std::chrono::steady_clock::now();
  result.blocks = marginals.diagonal();
  result.marginals = marginals.diagonal_seconds() + seconds_since(begin);
  result.there = true;
  return result;
}

json::value to_json(const DiagonalCovariances& covariances, const Graph& graph) {
  if (!covariances.there) return nullptr;
  json::array blocks;
  std::span<const double> rest = covariances.blocks;
  for (int v = 0; v < graph.variable_count(); ++v) {
    const int size = graph.type(v).tangent_size();
    blocks.push_back({{"id", graph.id(v)}, {"covariance", rows_json(rest, size, size)}});
    rest = rest.subspan(static_cast<std::size_t>(size) * static_cast<std::size_t>(size));
  }
  return {{"linear_solver", covariances.linear_solver},
          {"seconds",
           {{"linearize", covariances.linearize},
            {"factorize", covariances.factorize},
            {"marginals", covariances.marginals}}},
          {"blocks", std::move(blocks)}};
}

json::array rows_json(std::span<const double> matrix, int rows, int columns) {
  json::array all;
  for (int r = 0; r < rows; ++r) {
    json::array row;
    for (int c = 0; c < columns; ++c)
      row.push_back(matrix[static_cast<std::size_t>(c) * static_cast<std::size_t>(rows) +
                           static_cast<std::size_t>(r)]);
    all.push_back(std::move(row));
  }
  return all;
}

}  // namespace cairn::app
