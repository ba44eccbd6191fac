// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/information/graph_information.hpp"

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>

#include <fmt/core.h>

#include "cairn/information/gaussian.hpp"
#include "cairn/linear/normal_equations.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

using Eigen::MatrixXd;

/// The variables of a set that have coordinates.
std::vector<int> free_of(const Graph& graph, const GraphMarginals& marginals,
                         std::span<const int> variables) {
  std::vector<int> free, sorted(variables.begin(), variables.end());
  std::ranges::sort(sorted);
  if (const auto twice = std::ranges::adjacent_find(sorted); twice != sorted.end()) {
    throw Error(ErrorCode::usage, fmt::format("{} is named twice in a set, or is in both of two",
                                              graph.describe_variable(*twice)));
  }
  for (const int v : variables) {
    if (!marginals.gauge().held[static_cast<std::size_t>(v)]) free.push_back(v);
  }
  return free;
}

/// The pairs of variables whose blocks make up the upper part of their joint covariance.
void add_pairs(std::span<const int> variables, std::vector<std::pair<int, int>>& pairs) {
  for (std::size_t j = 0; j < variables.size(); ++j) {
    for (std::size_t i = 0; i <= j; ++i) pairs.emplace_back(variables[i], variables[j]);
  }
}

Eigen::Index coordinates_of(const Graph& graph, std::span<const int> variables) {
  Eigen::Index sum = 0;
  for (const int v : variables) sum += graph.type(v).tangent_size();
  return sum;
}

/// Puts the joint covariance together from these blocks, in the order of `add_pairs`, and takes
/// them off the front.
MatrixXd assembled(const Graph& graph, std::span<const int> variables,
                   std::span<const double>& blocks) {
  const Eigen::Index size = coordinates_of(graph, variables);
  MatrixXd S(size, size);
  Eigen::Index column = 0;
  for (std::size_t j = 0; j < variables.size(); ++j) {
    const Eigen::Index columns = graph.type(variables[j]).tangent_size();
    Eigen::Index row = 0;
    for (std::size_t i = 0; i <= j; ++i) {
      const Eigen::Index rows = graph.type(variables[i]).tangent_size();
      const Eigen::Map<const MatrixXd> block(blocks.data(), rows, columns);
      S.block(row, column, rows, columns) = block;
      if (i != j) S.block(column, row, columns, rows) = block.transpose();
      blocks = blocks.subspan(static_cast<std::size_t>(rows * columns));
      row += rows;
    }
    column += columns;
  }
  return S;
}

std::vector<int> joined(std::span<const int> a, std::span<const int> b) {
  std::vector<int> all(a.begin(), a.end());
  all.insert(all.end(), b.begin(), b.end());
  return all;
}

}  // namespace

GraphEntropy entropy(const Graph& graph, LinearSolver& solver) {
  const auto* determinant = query<LogDeterminant>(solver);
  if (!determinant) {
    throw Error(ErrorCode::usage,
                "entropy: this linear solver lacks the ability 'log_determinant'; block_cholesky "
                "has it");
  }
  GraphEntropy result;
  const auto check = [](const auto& system, const Factorization& f) {
    if (!f.ok) throw Error(ErrorCode::numerical, fmt::format("no entropy: {}", system.explain(f)));
  };
  if (query<Marginals>(solver)) {  // which tell a matrix that is singular to rounding
    GraphMarginals marginals(graph, solver);
    result.size = marginals.size();
    check(marginals, marginals.factorize());
  } else {
    NormalEquations equations(graph, solver);
    result.size = equations.size();
    if (result.size > 0) {
      equations.linearize(graph.values());
      check(equations, equations.factorize());
    }
  }
  if (result.size == 0) return result;
  result.log_determinant = determinant->log_determinant();
  result.entropy = entropy_of_information(result.size, result.log_determinant);
  return result;
}

MatrixXd joint_covariance(const Graph& graph, GraphMarginals& marginals,
                          std::span<const int> variables) {
  const std::vector<int> free = free_of(graph, marginals, variables);
  std::vector<std::pair<int, int>> pairs;
  add_pairs(free, pairs);
  const std::vector<double> blocks = marginals.blocks(pairs);
  std::span<const double> rest = blocks;
  return assembled(graph, free, rest);
}

double entropy(const Graph& graph, GraphMarginals& marginals, std::span<const int> variables) {
  return entropy(joint_covariance(graph, marginals, variables));
}

double conditional_entropy(const Graph& graph, GraphMarginals& marginals, std::span<const int> a,
                           std::span<const int> b) {
  const MatrixXd joint = joint_covariance(graph, marginals, joined(a, b));
  return conditional_entropy(joint,
                             static_cast<int>(coordinates_of(graph, free_of(graph, marginals, a))));
}

std::vector<double> mutual_information(const Graph& graph, GraphMarginals& marginals,
                                       std::span<const VariableSets> sets) {
  std::vector<std::vector<int>> joint;
  std::vector<std::pair<int, int>> pairs;
  for (const VariableSets& s : sets) {
    joint.push_back(free_of(graph, marginals, joined(s.a, s.b)));
    add_pairs(joint.back(), pairs);
  }
  const std::vector<double> blocks = marginals.blocks(pairs);
  std::span<const double> rest = blocks;
  std::vector<double> nats;
  for (std::size_t k = 0; k < sets.size(); ++k) {
    const MatrixXd S = assembled(graph, joint[k], rest);
    nats.push_back(mutual_information(
        S, static_cast<int>(coordinates_of(graph, free_of(graph, marginals, sets[k].a)))));
  }
  return nats;
}

}  // namespace cairn
