// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "cairn/graph/graph.hpp"
#include "cairn/linear/graph_marginals.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/typed/build.hpp"

/// Marginal covariances by id, as Eigen matrices. All are of the tangent vector δ with x_true =
/// retract(x, δ): for a pose metres along its own axes, then radians. `GraphMarginals` and
/// `Estimator` say what they are relative to.
namespace cairn {
namespace detail {

/// Blocks Σ_ij by id, one after the other, column-major. Throws `Error` (numerical) if H is
/// singular.
CAIRN_API std::vector<double> covariance_blocks(const Graph& graph,
                                                std::span<const std::pair<Id, Id>> pairs,
                                                std::string_view linear_solver, Registry& registry);

inline int tangent_size(const Graph& graph, Id id) {
  return graph.type(index_of(graph, id)).tangent_size();
}

/// The state of an estimator's variable, if it is a `T`.
template <StateValue T>
std::span<const double> state_of(Estimator& estimator, Id id) {
  const std::string_view tag = estimator.type(id)->tag();
  if (tag != T::Traits::kTag) {
    throw Error(ErrorCode::usage, std::string(tag) + " " + id_text(id) + " is not a " +
                                      std::string(T::Traits::kTag) + ", which a " + T::kName +
                                      " is read from");
  }
  return estimator.state(id);
}

}  // namespace detail

/// Σ of each variable of a graph at its present estimate, tangent × tangent. One factorisation for
/// all of them. Throws `Error`: usage for an id that is not there or a linear solver that cannot;
/// numerical, with the reason, if the graph does not determine them.
inline std::vector<Eigen::MatrixXd> covariances(const Graph& graph, std::span<const Id> ids,
                                                std::string_view linear_solver = "block_cholesky",
                                                Registry& registry = default_registry()) {
  std::vector<std::pair<Id, Id>> pairs;
  for (const Id id : ids) pairs.emplace_back(id, id);
  const std::vector<double> blocks =
      detail::covariance_blocks(graph, pairs, linear_solver, registry);
  std::vector<Eigen::MatrixXd> result;
  const double* block = blocks.data();
  for (const Id id : ids) {
    const int n = detail::tangent_size(graph, id);
    result.emplace_back(Eigen::Map<const Eigen::MatrixXd>(block, n, n));
    block += n * n;
  }
  return result;
}

/// Σ_ab of two variables of a graph, tangent of a × tangent of b; as `covariances` otherwise.
inline Eigen::MatrixXd cross_covariance(const Graph& graph, Id a, Id b,
                                        std::string_view linear_solver = "block_cholesky",
                                        Registry& registry = default_registry()) {
  const std::pair<Id, Id> pair(a, b);
  const std::vector<double> block =
      detail::covariance_blocks(graph, {&pair, 1}, linear_solver, registry);
  return Eigen::Map<const Eigen::MatrixXd>(block.data(), detail::tangent_size(graph, a),
                                           detail::tangent_size(graph, b));
}

/// Σ of one variable of a graph. Factorises: for several use `covariances`.
inline Eigen::MatrixXd covariance(const Graph& graph, Id id,
                                  std::string_view linear_solver = "block_cholesky",
                                  Registry& registry = default_registry()) {
  return cross_covariance(graph, id, id, linear_solver, registry);
}

/// The current estimate of one variable of an estimator. Throws `Error` (usage) for an id that is
/// not there, or a variable of another type.
template <StateValue T>
T estimate(Estimator& estimator, Id id) {
  return T::from_state(detail::state_of<T>(estimator, id));
}

/// Σ of one variable of an estimator, which is a `T`; zero if it is constant. Throws `Error`: usage
/// as `estimate`; numerical if H is singular.
template <StateValue T>
auto covariance(Estimator& estimator, Id id) {
  constexpr int kTangent = T::Traits::kTangent;
  [[maybe_unused]] const auto state = detail::state_of<T>(estimator, id);
  Eigen::Matrix<double, kTangent, kTangent> Sigma;
  if (!estimator.covariance(id, id, {Sigma.data(), static_cast<std::size_t>(Sigma.size())})) {
    throw Error(ErrorCode::numerical,
                "the measurements so far do not determine variable " + id_text(id));
  }
  return Sigma;
}

}  // namespace cairn
