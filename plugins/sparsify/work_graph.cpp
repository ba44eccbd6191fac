// SPDX-License-Identifier: BSD-3-Clause
#include "work_graph.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/cholesky.hpp"

namespace cairn::sparsify {

namespace {

/// U with UᵀU = A. Throws `Error` (numerical) unless A is positive definite.
std::vector<double> cholesky_factor(std::span<const double> A, int n) {
  const Eigen::LLT<Eigen::MatrixXd> llt(unpack(A, n));
  Eigen::MatrixXd U = llt.matrixU();
  if (llt.info() != Eigen::Success || !U.allFinite())
    throw Error(ErrorCode::numerical, "an information matrix is not positive definite");
  return pack(U);
}

}  // namespace

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
  std::vector<double> root = cholesky_factor(information, n);
  factors_.push_back({.type = std::move(type),
                      .variables = std::move(variables),
                      .measurement = std::move(measurement),
                      .information = std::move(information),
                      .sqrt_information = std::move(root)});
}

}  // namespace cairn::sparsify
