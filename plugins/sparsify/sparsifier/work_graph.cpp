// SPDX-License-Identifier: BSD-3-Clause
#include "work_graph.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/cholesky.hpp"
#include "dense/lu.hpp"
#include "dense/products.hpp"

namespace cairn::sparsify {

WorkGraph::WorkGraph(const Graph& graph)
    : graph_(&graph), on_(graph.variable_count()), gone_(graph.variable_count()) {
  const std::vector<double> norms = squared_norms(graph);
  for (int f = 0; f < graph.factor_count(); ++f) {
    const auto [pool, entry] = graph.ref(f);
    const FactorPool& of = graph.factor_pools()[pool];
    const auto variables = graph.factor_variables(f);
    const auto z = graph.measurement(f);
    const auto information = graph.information(f), root = graph.sqrt_information(f);
    WorkFactor factor{.type = of.type,
                      .variables = {variables.begin(), variables.end()},
                      .measurement = {z.begin(), z.end()},
                      .information = {information.begin(), information.end()},
                      .sqrt_information = {root.begin(), root.end()},
                      .position = f};
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
  for (const int v : factors_[f].variables) {
    const auto place = std::ranges::lower_bound(on_[v], f);  // they rise
    if (place != on_[v].end() && *place == f) on_[v].erase(place);
  }
}

void WorkGraph::add(std::shared_ptr<const FactorType> type, std::vector<int> variables,
                    std::vector<double> measurement, std::vector<double> information) {
  std::vector<double> root(information.size());
  if (!square_root(information, type->residual_size(), root))
    throw Error(ErrorCode::numerical, "an information matrix is not positive semidefinite");
  const int f = factor_count();
  for (const int v : variables) on_[v].push_back(f);
  factors_.push_back({.type = std::move(type),
                      .variables = std::move(variables),
                      .measurement = std::move(measurement),
                      .information = std::move(information),
                      .sqrt_information = std::move(root)});
}

void WorkGraph::add_prior(const std::shared_ptr<const FactorType>& type, int variable,
                          std::vector<double> measurement, std::vector<double> information) {
  add(type, {variable}, std::move(measurement), std::move(information));
  std::vector<int> same;
  for (const int f : on_[variable]) {
    if (factors_[f].type->tag() == type->tag()) same.push_back(f);
  }
  if (same.size() < 2) return;
  const VariableType& of = graph_->type(variable);
  const int n = of.tangent_size();
  const double* x[] = {graph_->state(variable).data()};
  Eigen::MatrixXd J(n, n), H = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd r(n), g = Eigen::VectorXd::Zero(n);
  double* out[] = {J.data()};
  for (const int f : same) {
    const WorkFactor& factor = factors_[f];
    factor.type->evaluate(x, factor.measurement.data(), factor.sqrt_information.data(), r.data(),
                          out);
    dense::add_product_of_transpose(J, J, H);
    g -= J.transpose() * r;
  }
  const Eigen::LLT<Eigen::MatrixXd> llt(H);
  if (llt.info() != Eigen::Success) return;  // together they leave something open, too
  const Eigen::VectorXd step = llt.solve(g);
  const std::int64_t offset = 0;
  std::vector<double> z(graph_->state(variable).size());
  of.retract(1, x[0], &offset, step.data(), z.data());
  type->normalize(z.data());
  type->evaluate(x, z.data(), pack(Eigen::MatrixXd::Identity(n, n)).data(), r.data(), out);
  const Eigen::PartialPivLU<Eigen::MatrixXd> lu(J.transpose());
  const Eigen::MatrixXd half = lu.solve(H);  // J⁻ᵀ H
  const Eigen::MatrixXd Omega = lu.solve(Eigen::MatrixXd(half.transpose()));
  for (const int f : same) remove_factor(f);
  add(type, {variable}, std::move(z), pack(0.5 * (Omega + Omega.transpose())));
}

}  // namespace cairn::sparsify
