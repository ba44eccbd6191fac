// SPDX-License-Identifier: BSD-3-Clause
#include "linear_model.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include "cairn/geometry/loop_closures.hpp"
#include "cairn/graph/disjoint_sets.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/linear/jacobian.hpp"
#include "cairn/linear/linearizer.hpp"
#include "cairn/linear/marginals.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/products.hpp"

namespace cairn::edges {
namespace {

using Eigen::MatrixXd;
using Block = Eigen::Map<MatrixXd>;
using ConstBlock = Eigen::Map<const MatrixXd>;

/// Adds weight · AᵀB at (row, column) of the blocks of a matrix, A and B being whitened rows.
void add_product(BlockMatrix& to, int row, int column, double weight, const dense::View& A,
                 const dense::View& B) {
  if (row < column) return;  // the lower triangle alone is stored
  const BlockStructure& structure = to.structure();
  Block(to.block(structure.find(row, column)), A.cols(), B.cols()) +=
      dense::scaled_product_of_transpose(weight, A, B);
}

/// Blocks of one number for the variables that edges join, but for those that are constant, and one
/// of each component without any.
struct Grounded {
  Grounded(const Graph& graph, const std::vector<RelativeEdge>& edges)
      : block(graph.variable_count(), -1) {
    const std::vector<bool> held = resolve_gauge(graph).held;
    DisjointSets joined(graph.variable_count());
    for (const RelativeEdge& edge : edges) joined.join(edge.variables[0], edge.variables[1]);
    std::vector<bool> has_ground(graph.variable_count());
    for (int v = 0; v < graph.variable_count(); ++v) {
      if (held[v]) has_ground[joined.find(v)] = true;
    }
    for (int v = 0; v < graph.variable_count(); ++v) {
      if (!has_ground[joined.find(v)]) {
        has_ground[joined.find(v)] = true;
      } else if (!held[v]) {
        block[v] = blocks++;
      }
    }
  }
  std::vector<int> block;  ///< by variable; −1: grounded
  int blocks = 0;
};

}  // namespace

void LinearModel::add(int k, double weight, BlockMatrix& to) const {
  const CandidateRows& rows = candidates[static_cast<std::size_t>(k)];
  for (std::size_t a = 0; a < 2; ++a) {
    for (std::size_t b = 0; b < 2; ++b) {
      if (rows.blocks[a] < 0 || rows.blocks[b] < 0) continue;
      add_product(to, rows.blocks[a], rows.blocks[b], weight, rows.J[a], rows.J[b]);
    }
  }
}

BlockMatrix LinearModel::information(std::span<const double> weights) const {
  BlockMatrix all = H;
  for (std::size_t k = 0; k < weights.size(); ++k) {
    if (weights[k] != 0.0) add(static_cast<int>(k), weights[k], all);
  }
  return all;
}

LinearModel linear_model(const Graph& graph, std::span<const int> candidates) {
  const Linearizer linearizer(graph, resolve_gauge(graph).held);
  const JacobianEvaluator evaluator(graph, linearizer);
  JacobianMatrix J(evaluator.structure());
  evaluator.evaluate(graph.values(), J);
  const JacobianStructure& rows = J.structure();
  LinearModel model;
  model.structure = std::make_unique<BlockStructure>(linearizer.structure());
  model.H = BlockMatrix(*model.structure);
  model.H.set_zero();
  const auto block = [&](std::int64_t entry, int factor) {
    return ConstBlock(J.block(entry), rows.row_sizes()[factor],
                      rows.column_sizes()[rows.columns()[entry]]);
  };
  for (int f = 0; f < graph.factor_count(); ++f) {
    const std::int64_t begin = rows.row_begin()[f], end = rows.row_begin()[f + 1];
    if (!std::ranges::binary_search(candidates, f)) {
      for (auto a = begin; a < end; ++a) {
        for (auto b = begin; b < end; ++b)
          add_product(model.H, rows.columns()[a], rows.columns()[b], 1.0, block(a, f), block(b, f));
      }
      continue;
    }
    CandidateRows& added = model.candidates.emplace_back();
    added.J.fill(MatrixXd(rows.row_sizes()[f], 0));
    for (auto a = begin; a < end; ++a) {
      added.blocks[static_cast<std::size_t>(a - begin)] = rows.columns()[a];
      added.J[static_cast<std::size_t>(a - begin)] = block(a, f);
    }
  }
  return model;
}

PoseGraphEdges::PoseGraphEdges(const Graph& graph, std::span<const int> candidates) {
  const LoopClosures closures = find_loop_closures(graph);
  std::vector<int> factors = closures.backbone;
  factors.insert(factors.end(), closures.candidates.begin(), closures.candidates.end());
  std::erase_if(factors, [&](int f) { return std::ranges::binary_search(candidates, f); });
  stay = factors.size();
  factors.insert(factors.end(), candidates.begin(), candidates.end());
  all = relative_edges(graph, factors);
}

void PoseGraphEdges::check(EdgeWeight weight) const {
  const auto has_weight = [&](const RelativeEdge& edge) { return edge.weight(weight) > 0.0; };
  if (std::ranges::any_of(std::span(all).subspan(stay), has_weight)) return;
  throw Error(ErrorCode::input, "the relative factors measure no " +
                                    std::string(to_string(weight)) +
                                    ": choose by the other weight");
}

LinearModel laplacian_model(const Graph& graph, std::span<const int> candidates,
                            EdgeWeight weight) {
  const PoseGraphEdges edges(graph, candidates);
  edges.check(weight);
  const Grounded grounded(graph, edges.all);
  std::vector<std::pair<std::int32_t, std::int32_t>> pairs;
  std::vector<CandidateRows> rows;
  for (const RelativeEdge& edge : edges.all) {
    CandidateRows& row = rows.emplace_back();
    for (std::size_t end = 0; end < 2; ++end) {
      row.blocks[end] = grounded.block[edge.variables[end]];
      row.J[end] = MatrixXd::Constant(1, row.blocks[end] < 0 ? 0 : 1,
                                      (end == 0 ? 1.0 : -1.0) * std::sqrt(edge.weight(weight)));
    }
    if (row.blocks[0] >= 0 && row.blocks[1] >= 0) pairs.emplace_back(row.blocks[0], row.blocks[1]);
  }
  LinearModel model;
  model.structure = std::make_unique<BlockStructure>(
      std::vector<std::int32_t>(static_cast<std::size_t>(grounded.blocks), 1), std::move(pairs));
  model.H = BlockMatrix(*model.structure);
  model.H.set_zero();
  model.candidates = std::move(rows);
  for (std::size_t k = 0; k < edges.stay; ++k) model.add(static_cast<int>(k), 1.0, model.H);
  model.candidates.erase(model.candidates.begin(),
                         model.candidates.begin() + static_cast<std::ptrdiff_t>(edges.stay));
  return model;
}

void check_solver(LinearSolver& solver) {
  if (query<Marginals>(solver) && query<LogDeterminant>(solver)) return;
  throw Error(ErrorCode::usage,
              "edge selection: this linear solver lacks the ability 'marginals' or "
              "'log_determinant'; block_cholesky has both");
}

double log_determinant(const BlockMatrix& information, LinearSolver& solver) {
  if (!solver.factorize(information).ok) {
    throw Error(ErrorCode::numerical,
                "edge selection: without the candidates the graph does not determine all "
                "variables to working precision");
  }
  return query<LogDeterminant>(solver)->log_determinant();
}

std::vector<MatrixXd> candidate_covariances(const LinearModel& model, LinearSolver& solver) {
  std::vector<std::pair<std::int32_t, std::int32_t>> pairs;
  std::size_t size = 0;
  for (const CandidateRows& rows : model.candidates) {
    for (std::size_t a = 0; a < 2; ++a) {
      for (std::size_t b = a; b < 2; ++b) {
        if (rows.blocks[a] < 0 || rows.blocks[b] < 0) continue;
        pairs.emplace_back(rows.blocks[a], rows.blocks[b]);
        size += static_cast<std::size_t>(rows.J[a].cols() * rows.J[b].cols());
      }
    }
  }
  std::vector<double> sigma(size);
  query<Marginals>(solver)->blocks(pairs, sigma);
  std::vector<MatrixXd> all;
  const double* next = sigma.data();
  for (const CandidateRows& rows : model.candidates) {
    MatrixXd& S = all.emplace_back(MatrixXd::Zero(rows.J[0].rows(), rows.J[0].rows()));
    for (std::size_t a = 0; a < 2; ++a) {
      for (std::size_t b = a; b < 2; ++b) {
        if (rows.blocks[a] < 0 || rows.blocks[b] < 0) continue;
        const ConstBlock block(next, rows.J[a].cols(), rows.J[b].cols());
        const MatrixXd part =
            dense::product_with_transpose(dense::product(rows.J[a], block), rows.J[b]);
        S += part;
        if (a != b) S += part.transpose();
        next += block.size();
      }
    }
  }
  return all;
}

}  // namespace cairn::edges
