// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sparsification/connectivity.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include <Eigen/Core>

#include "cairn/graph/disjoint_sets.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/eigenvalues.hpp"

namespace cairn {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Vectors before Lanczos' method begins again at the best, and how often it does.
constexpr int kBasis = 40, kRestarts = 60;
/// Of the residual, as a part of the eigenvalue: the error of the eigenvalue goes with its square.
constexpr double kAccuracy = 1e-7;

/// Some vector of mean zero that is orthogonal to nothing in particular.
VectorXd some_vector(Eigen::Index n) {
  VectorXd v(n);
  for (Eigen::Index k = 0; k < n; ++k) v[k] = std::sin(1.0 + 1.7 * static_cast<double>(k));
  v.array() -= v.mean();
  return v.normalized();
}

/// The variables at the ends of edges, rising.
std::vector<int> ends_of(std::span<const RelativeEdge> edges) {
  std::vector<int> nodes;
  for (const RelativeEdge& edge : edges)
    nodes.insert(nodes.end(), edge.variables.begin(), edge.variables.end());
  std::ranges::sort(nodes);
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  return nodes;
}

std::vector<FiedlerSolver::Edge> numbered(std::span<const RelativeEdge> edges) {
  const std::vector<int> nodes = ends_of(edges);
  const auto number = [&](int v) {
    return static_cast<int>(std::ranges::lower_bound(nodes, v) - nodes.begin());
  };
  std::vector<FiedlerSolver::Edge> all;
  for (const RelativeEdge& edge : edges)
    all.push_back({number(edge.variables[0]), number(edge.variables[1])});
  return all;
}

}  // namespace

FiedlerSolver::FiedlerSolver(int nodes, std::vector<Edge> edges, LinearSolver& solver)
    : nodes_(nodes), edges_(std::move(edges)), solver_(&solver) {
  if (nodes < 2)
    throw Error(ErrorCode::input, "algebraic connectivity: there are less than two poses");
  DisjointSets sets(nodes);
  int components = nodes;
  std::vector<std::pair<std::int32_t, std::int32_t>> pairs;
  for (const auto& [a, b] : edges_) {
    components -= sets.join(a, b);
    if (a != 0 && b != 0) pairs.emplace_back(a - 1, b - 1);
  }
  if (components > 1) {
    throw Error(ErrorCode::input,
                "algebraic connectivity: the relative factors leave the poses in " +
                    std::to_string(components) + " components, which makes it zero");
  }
  structure_ = BlockStructure(std::vector<std::int32_t>(static_cast<std::size_t>(nodes) - 1, 1),
                              std::move(pairs));
  L_ = BlockMatrix(structure_);
  for (const auto& [a, b] : edges_) {
    const int low = std::min(a, b) - 1, high = std::max(a, b) - 1;
    entries_.push_back({a == 0 ? -1 : structure_.find(a - 1, a - 1),
                        b == 0 ? -1 : structure_.find(b - 1, b - 1),
                        low < 0 ? -1 : structure_.find(high, low)});
  }
  solver_->analyze(structure_);
}

FiedlerSolver::FiedlerSolver(std::span<const RelativeEdge> edges, LinearSolver& solver)
    : FiedlerSolver(static_cast<int>(std::ssize(ends_of(edges))), numbered(edges), solver) {}

void FiedlerSolver::factorize(std::span<const double> weights) {
  L_.set_zero();
  for (std::size_t k = 0; k < edges_.size(); ++k) {
    const auto& [a, b, off] = entries_[k];
    if (a >= 0) *L_.block(a) += weights[k];
    if (b >= 0) *L_.block(b) += weights[k];
    if (off >= 0) *L_.block(off) -= weights[k];
  }
  if (!solver_->factorize(L_).ok) {
    throw Error(ErrorCode::numerical,
                "algebraic connectivity: the factors that are left do not connect all poses");
  }
}

void FiedlerSolver::multiply_inverse(std::vector<double>& x) {
  const std::span<double> grounded = std::span(x).subspan(1);
  solver_->solve(grounded, grounded);
  x.front() = 0.0;
  Eigen::Map<VectorXd> all(x.data(), nodes_);
  all.array() -= all.mean();
}

double FiedlerSolver::quotient(std::span<const double> weights, std::span<const double> v) const {
  double sum = 0.0;
  for (std::size_t k = 0; k < edges_.size(); ++k) {
    const double apart = v[edges_[k][0]] - v[edges_[k][1]];
    sum += weights[k] * apart * apart;
  }
  return sum;
}

bool FiedlerSolver::improve(std::vector<double>& v) {
  const int most = std::min(kBasis, nodes_ - 1);
  Eigen::Map<VectorXd> best(v.data(), nodes_);
  MatrixXd basis(nodes_, most), T = MatrixXd::Zero(most, most);
  basis.col(0) = best.normalized();
  std::vector<double> image(v.size());
  Eigen::Map<VectorXd> w(image.data(), nodes_);
  for (int k = 0;; ++k) {
    w = basis.col(k);
    multiply_inverse(image);
    T(k, k) = basis.col(k).dot(w);
    for (int twice = 0; twice < 2; ++twice) {
      for (int j = 0; j <= k; ++j) w -= basis.col(j).dot(w) * basis.col(j);
    }
    const double next = w.norm();
    const Eigen::SelfAdjointEigenSolver<MatrixXd> ritz(MatrixXd(T.topLeftCorner(k + 1, k + 1)));
    const double residual = next * std::abs(ritz.eigenvectors()(k, k));
    const bool converged = residual <= kAccuracy * ritz.eigenvalues()[k];
    if (converged || k + 1 == most) {
      best.setZero();
      for (int j = 0; j <= k; ++j) best += ritz.eigenvectors()(j, k) * basis.col(j);
      best.array() -= best.mean();
      best.normalize();
      return converged || most == nodes_ - 1;  // all there is
    }
    T(k + 1, k) = T(k, k + 1) = next;
    basis.col(k + 1) = w / next;
  }
}

const FiedlerPair& FiedlerSolver::solve(std::span<const double> weights) {
  factorize(weights);
  VectorXd start = some_vector(nodes_);
  // A little of everything stays, in case the vector before is orthogonal to this one.
  if (!pair_.vector.empty())
    start = 1e-3 * start + Eigen::Map<const VectorXd>(pair_.vector.data(), nodes_);
  pair_.vector.assign(start.begin(), start.end());
  for (int restart = 0; restart < kRestarts; ++restart) {
    if (!improve(pair_.vector)) continue;
    pair_.value = quotient(weights, pair_.vector);
    return pair_;
  }
  throw Error(ErrorCode::numerical, "algebraic connectivity: Lanczos' method does not converge");
}

}  // namespace cairn
