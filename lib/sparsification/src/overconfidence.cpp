// SPDX-License-Identifier: BSD-3-Clause
#include "overconfidence.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <utility>

#include <Eigen/Core>

#include "cairn/graph/gauge.hpp"
#include "cairn/linear/linearizer.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/eigenvalues.hpp"

namespace cairn {
namespace {

using Vector = Eigen::VectorXd;

std::span<const double> view(const Vector& x) {
  return {x.data(), static_cast<std::size_t>(x.size())};
}
std::span<double> view(Vector& x) { return {x.data(), static_cast<std::size_t>(x.size())}; }

/// H of a graph at its states, and which columns are a variable's.
class LinearizedAt {
 public:
  LinearizedAt(const Graph& graph, std::vector<bool> held)
      : linearizer_(graph, std::move(held)), H_(linearizer_.structure()) {
    Vector g(size());
    linearizer_.linearize(graph.values(), H_, view(g));
  }
  Eigen::Index size() const { return linearizer_.structure().size(); }
  const BlockMatrix& H() const { return H_; }
  const BlockStructure& structure() const { return linearizer_.structure(); }
  Vector times(const Vector& x) const {
    Vector y(x.size());
    H_.multiply(view(x), view(y));
    return y;
  }
  /// The columns of variables, one after the other; none of those that are constant.
  std::vector<Eigen::Index> columns(const std::vector<int>& variables) const {
    std::vector<Eigen::Index> all;
    for (const int v : variables) {
      const int block = linearizer_.block_of(v);
      for (int k = 0; block >= 0 && k < structure().block_size(block); ++k)
        all.push_back(structure().offsets()[block] + k);
    }
    return all;
  }

 private:
  Linearizer linearizer_;
  BlockMatrix H_;
};

/// By Lanczos' recursion, whose Ritz values approach the ends of the spectrum first; they are never
/// below it. Vectors are not kept: lost orthogonality repeats eigenvalues, and adds none. Ends
/// where the residual shows an eigenvalue within a millionth of itself, or within rounding of the
/// largest.
double least_eigenvalue(Eigen::Index n, const std::function<Vector(const Vector&)>& multiply) {
  constexpr int kMost = 600;
  std::vector<double> diagonal, beside;
  Vector before = Vector::Zero(n), v(n);
  for (Eigen::Index k = 0; k < n; ++k)
    v[k] = 1.0 + 0.5 * std::sin(1.0 + 1.7 * static_cast<double>(k));
  v.normalize();
  const int most = static_cast<int>(std::min<Eigen::Index>(n, kMost));
  for (int k = 1;; ++k) {
    Vector w = multiply(v);
    diagonal.push_back(v.dot(w));
    w -= diagonal.back() * v;
    if (k > 1) w -= beside.back() * before;
    const double next = w.norm();
    if (k == most || next == 0.0 || (k & (k - 1)) == 0) {
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> ritz;
      ritz.computeFromTridiagonal(Eigen::Map<const Vector>(diagonal.data(), k),
                                  Eigen::Map<const Vector>(beside.data(), k - 1));
      const double least = ritz.eigenvalues()[0];
      const double norm = ritz.eigenvalues().cwiseAbs().maxCoeff();
      const double residual = next * std::abs(ritz.eigenvectors()(k - 1, 0));
      if (k == most || residual <= std::max(1e-6 * std::abs(least), 1e-11 * norm)) return least;
    }
    beside.push_back(next);
    before = std::exchange(v, w / next);
  }
}

}  // namespace

double least_eigenvalue_of_difference(const Graph& p, const Graph& q, const std::vector<int>& at,
                                      LinearSolver& solver) {
  const LinearizedAt of_p(p, resolve_gauge(p).held), of_q(q, resolve_gauge(q).held);
  std::vector<int> order(q.variable_count()), left;
  for (int v = 0; v < q.variable_count(); ++v) order[v] = v;
  std::vector<bool> held = resolve_gauge(p).held, kept(p.variable_count());
  for (const int v : at) kept[v] = held[v] = true;
  for (int v = 0; v < p.variable_count(); ++v) {
    if (!kept[v]) left.push_back(v);
  }
  const std::vector<Eigen::Index> columns_q = of_q.columns(order), columns_p = of_p.columns(at);
  const std::vector<Eigen::Index> removed = of_p.columns(left);
  if (columns_q.empty()) return 0.0;
  const LinearizedAt of_removed(p, std::move(held));
  if (!removed.empty()) {
    solver.analyze(of_removed.structure());
    if (!solver.factorize(of_removed.H()).ok)
      throw Error(ErrorCode::numerical, "the nodes that were taken out are not determined");
  }
  // Λ v = H_kk v − H_kr H_rr⁻¹ H_rk v, by two products with H.
  const auto multiply = [&](const Vector& v) {
    Vector x = Vector::Zero(of_p.size());
    x(columns_p) = v;
    Vector y = of_p.times(x);
    if (!removed.empty()) {
      const Vector right = y(removed);
      Vector solution(right.size());
      solver.solve(view(right), view(solution));
      x(removed) = -solution;
      y = of_p.times(x);
    }
    Vector z(of_q.size());
    z(columns_q) = v;
    const Vector claimed = of_q.times(z);
    return Vector(y(columns_p) - claimed(columns_q));
  };
  return least_eigenvalue(std::ssize(columns_q), multiply);
}

}  // namespace cairn
