// SPDX-License-Identifier: BSD-3-Clause
#include "work_graph.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>

#include "cairn/runtime/error.hpp"

namespace cairn::sparsify {

std::vector<double> packed(const Matrix& A) {
  std::vector<double> upper;
  for (Eigen::Index r = 0; r < A.rows(); ++r) {
    for (Eigen::Index c = r; c < A.cols(); ++c) upper.push_back(A(r, c));
  }
  return upper;
}

std::vector<double> packed_root(const Matrix& A) {
  const Eigen::LLT<Matrix> llt(A);
  if (llt.info() != Eigen::Success)
    throw Error(ErrorCode::numerical, "an information matrix is not positive definite");
  return packed(llt.matrixU());
}

Matrix unpacked(std::span<const double> upper, int n) {
  Matrix A(n, n);
  for (int r = 0, k = 0; r < n; ++r) {
    for (int c = r; c < n; ++c, ++k) A(r, c) = A(c, r) = upper[k];
  }
  return A;
}

WorkGraph::WorkGraph(const Graph& graph)
    : graph_(&graph), on_(graph.variable_count()), gone_(graph.variable_count()) {
  const std::vector<double> norms = squared_norms(graph);
  for (int f = 0; f < graph.factor_count(); ++f) {
    const auto [pool, entry] = graph.ref(f);
    const FactorPool& of = graph.factor_pools()[pool];
    const auto variables = graph.factor_variables(f);
    const auto z = graph.measurement(f);
    const auto information = graph.information(f);
    WorkFactor factor{.type = of.type,
                      .variables = {variables.begin(), variables.end()},
                      .measurement = {z.begin(), z.end()},
                      .information = {information.begin(), information.end()},
                      .sqrt_information = {},
                      .position = f};
    const auto count = information.size();
    const double* root = of.sqrt_information.data() + static_cast<std::size_t>(entry) * count;
    factor.sqrt_information.assign(root, root + count);
    if (graph.loss(f)) {
      double weight = 1.0;
      graph.weigh(pool, static_cast<std::size_t>(entry), {&norms[f], 1}, {}, {&weight, 1});
      // A factor without any weight must stay positive definite.
      weight = std::max(weight, 1e-9);
      for (double& x : factor.information) x *= weight;
      for (double& x : factor.sqrt_information) x *= std::sqrt(weight);
    }
    for (const int v : factor.variables) on_[v].push_back(f);
    factors_.push_back(std::move(factor));
  }
}

std::vector<int> WorkGraph::blanket(std::span<const int> variables) const {
  std::vector<int> found;
  for (const int v : variables) {
    for (const int f : on_[v]) {
      const std::vector<int>& of = factors_[f].variables;
      found.insert(found.end(), of.begin(), of.end());
    }
  }
  std::ranges::sort(found);
  found.erase(std::unique(found.begin(), found.end()), found.end());
  std::erase_if(found, [&](int v) { return std::ranges::find(variables, v) != variables.end(); });
  return found;
}

void WorkGraph::remove_factor(int f) {
  factors_[f].there = false;
  for (const int v : factors_[f].variables) std::erase(on_[v], f);
}

void WorkGraph::add(std::shared_ptr<const FactorType> type, std::vector<int> variables,
                    std::vector<double> measurement, std::vector<double> information) {
  const int n = type->residual_size();
  const int f = factor_count();
  for (const int v : variables) on_[v].push_back(f);
  std::vector<double> root = packed_root(unpacked(information, n));
  factors_.push_back({.type = std::move(type),
                      .variables = std::move(variables),
                      .measurement = std::move(measurement),
                      .information = std::move(information),
                      .sqrt_information = std::move(root)});
}

}  // namespace cairn::sparsify
