// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sparsification/measures.hpp"

#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <Eigen/Core>

#include "cairn/geometry/pose.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/linear/graph_marginals.hpp"
#include "cairn/linear/normal_equations.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

using Block = Eigen::Map<const Eigen::MatrixXd>;

/// H of a graph at its states, factorised.
class Gaussian {
 public:
  Gaussian(const Graph& graph, LinearSolver& solver, const char* what) : equations_(graph, solver) {
    auto* determinant = query<LogDeterminant>(solver);
    if (!determinant) throw Error(ErrorCode::usage, "the linear solver does not give determinants");
    if (equations_.size() == 0) return;
    equations_.linearize(graph.values());
    if (const Factorization f = equations_.factorize(); !f.ok)
      throw Error(ErrorCode::numerical, fmt::format("{}: {}", what, equations_.explain(f)));
    log_determinant_ = determinant->log_determinant();
  }
  double log_determinant() const { return log_determinant_; }
  std::int64_t size() const { return equations_.size(); }
  const BlockMatrix& H() const { return equations_.H(); }
  int variable_of(int block) const { return equations_.linearizer().variable_of(block); }

 private:
  NormalEquations equations_;
  double log_determinant_ = 0.0;
};

/// The nodes of `sparse` in `original`.
std::vector<int> partners(const Graph& original, const Graph& sparse) {
  std::vector<int> at;
  for (int v = 0; v < sparse.variable_count(); ++v) {
    const auto there = original.find(sparse.id(v));
    if (!there || original.type(*there).tag() != sparse.type(v).tag())
      throw Error(ErrorCode::input,
                  fmt::format("{} is not in the original graph", sparse.describe_variable(v)));
    at.push_back(*there);
  }
  return at;
}

/// δ_v with sparse = original ⊕ δ, a node's tangent after the other's; and the RMS of positions.
struct Shift {
  std::vector<Eigen::VectorXd> tangent;
  double rmse = 0.0;
};

Shift shift(const Graph& original, const Graph& sparse, const std::vector<int>& at) {
  Shift result;
  double squares = 0.0;
  int positions = 0;
  for (int v = 0; v < sparse.variable_count(); ++v) {
    const VariableType& type = sparse.type(v);
    Eigen::VectorXd delta(type.tangent_size());
    // Both are seen from q, whose H it is multiplied with.
    type.local(1, sparse.state(v).data(), original.state(at[v]).data(), delta.data());
    result.tangent.push_back(std::move(delta));
    if (!has_position(type)) continue;
    const Eigen::Vector3d p = position(type, original.state(at[v]));
    const Eigen::Vector3d q = position(type, sparse.state(v));
    for (int k = 0; k < 3; ++k) squares += (p[k] - q[k]) * (p[k] - q[k]);
    ++positions;
  }
  result.rmse =
      positions > 0 ? std::sqrt(squares / positions) : std::numeric_limits<double>::quiet_NaN();
  return result;
}

}  // namespace

SparsificationError sparsification_error(const Graph& original, const Graph& sparse,
                                         LinearSolver& solver) {
  const std::vector<int> at = partners(original, sparse);
  Graph p = original.clone(), q = sparse.clone();
  for (const int v : resolve_gauge(sparse).anchored) {
    q.set_fixed(v);
    p.set_fixed(at[v]);
  }
  SparsificationError error;
  const Shift moved = shift(original, sparse, at);
  error.rmse = moved.rmse;

  // q: Λ̆ and its determinant. Its blocks are kept, since the solver serves three graphs in turn.
  struct Entry {
    int row, column;  ///< variables of q
    Eigen::MatrixXd value;
  };
  std::vector<Entry> entries;
  double log_q = 0.0;
  std::int64_t d = 0;
  {
    const Gaussian sparse_gaussian(q, solver, "the sparse graph");
    log_q = sparse_gaussian.log_determinant();
    d = sparse_gaussian.size();
    if (d == 0) return error;
    const BlockMatrix& H = sparse_gaussian.H();
    const BlockStructure& structure = H.structure();
    for (int c = 0; c < structure.blocks(); ++c) {
      for (auto k = structure.column_begin()[c]; k < structure.column_begin()[c + 1]; ++k) {
        const int r = structure.rows()[k];
        entries.push_back({sparse_gaussian.variable_of(r), sparse_gaussian.variable_of(c),
                           Block(H.block(k), structure.block_size(r), structure.block_size(c))});
      }
    }
  }
  // p: ln |Λ of the kept| = ln |Λ| − ln |Λ_rr|, r those that were taken out.
  double log_p = 0.0;
  {
    Graph removed = p.clone();
    for (const int v : at) removed.set_fixed(v);
    log_p -= Gaussian(removed, solver, "the nodes that were taken out").log_determinant();
  }
  log_p += Gaussian(p, solver, "the original graph").log_determinant();
  GraphMarginals marginals(p, solver);
  if (const Factorization f = marginals.factorize(); !f.ok)
    throw Error(ErrorCode::numerical, marginals.explain(f));
  std::vector<std::pair<int, int>> pairs;
  pairs.reserve(entries.size());
  for (const Entry& entry : entries) pairs.emplace_back(at[entry.row], at[entry.column]);
  const std::vector<double> sigma = marginals.blocks(pairs);
  double trace = 0.0;
  const double* block = sigma.data();
  for (const Entry& entry : entries) {
    const auto rows = entry.value.rows(), columns = entry.value.cols();
    const double twice = entry.row == entry.column ? 1.0 : 2.0;
    trace += twice * entry.value.cwiseProduct(Block(block, rows, columns)).sum();
    error.mean +=
        0.5 * twice * moved.tangent[entry.row].dot(entry.value * moved.tangent[entry.column]);
    block += rows * columns;
  }
  error.covariance = 0.5 * (trace - log_q + log_p - static_cast<double>(d));
  error.kld = error.covariance + error.mean;
  return error;
}

}  // namespace cairn
