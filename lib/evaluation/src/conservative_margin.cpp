// SPDX-License-Identifier: BSD-3-Clause
#include "conservative_margin.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <span>
#include <utility>

#include <fmt/core.h>
#include <Eigen/Core>

#include "cairn/graph/gauge.hpp"
#include "cairn/linear/linearizer.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/eigenvalues.hpp"

namespace cairn {
namespace {

using Vector = Eigen::VectorXd;
using Block = Eigen::Map<Eigen::MatrixXd>;
using ConstBlock = Eigen::Map<const Eigen::MatrixXd>;

/// The first shift, as a part of the largest diagonal entry, and what it grows by.
constexpr double kShift = 1e-9, kGrowth = 32.0;
constexpr int kShifts = 8;
constexpr int kLanczosSteps = 300;
/// Of the residual, as a part of the eigenvalue: where the iteration ends, and after the last step.
constexpr double kAccuracy = 1e-9, kAcceptable = 1e-3;

/// The exponent of the power of two nearest to the largest diagonal entry of a graph's H.
int exponent_of(const Vector& diagonal) {
  constexpr int kLargest = 1000;  // a power of two and its inverse are numbers
  const double largest = diagonal.size() > 0 ? diagonal.maxCoeff() : 0.0;
  return largest > 0.0 && std::isfinite(largest)
             ? std::clamp(std::ilogb(largest), -kLargest, kLargest)
             : 0;
}

/// H of a graph at its states.
struct LinearizedAt {
  explicit LinearizedAt(const Graph& graph)
      : linearizer(graph, resolve_gauge(graph).held), H(linearizer.structure()) {
    std::vector<double> g(static_cast<std::size_t>(linearizer.structure().size()));
    linearizer.linearize(graph.values(), H, g);
  }
  Linearizer linearizer;
  BlockMatrix H;
};

/// M = H − Λ̆ of the original graph's H, with Λ̆ in the rows of the nodes that are kept. Its Schur
/// complement on these is Λ − Λ̆, so (M + sE)⁻¹ has (Λ − Λ̆ + sI)⁻¹ in it, E being the identity on
/// the kept nodes. Where the others are determined, M + sE is positive definite if and only if Λ −
/// Λ̆ + sI is. All is divided by a power of two near the largest entry of H, which costs no digit:
/// of an inverse near 1e200 the squares would be no numbers.
class Difference {
 public:
  Difference(const Graph& p, const Graph& q, const std::vector<int>& at) {
    const LinearizedAt original(p), sparse(q);
    const BlockStructure &of_p = original.linearizer.structure(),
                         &of_q = sparse.linearizer.structure();
    std::vector<std::int32_t> partner;  // by block of q
    for (int block = 0; block < of_q.blocks(); ++block)
      partner.push_back(original.linearizer.block_of(at[sparse.linearizer.variable_of(block)]));
    std::vector<std::pair<std::int32_t, std::int32_t>> entries;
    for_blocks(of_p, [&](int r, int c, std::int64_t) { entries.emplace_back(r, c); });
    for_blocks(of_q,
               [&](int r, int c, std::int64_t) { entries.emplace_back(partner[r], partner[c]); });
    structure_ = BlockStructure({of_p.sizes().begin(), of_p.sizes().end()}, std::move(entries));
    M_ = BlockMatrix(structure_);
    diagonal_.resize(structure_.size());
    original.H.diagonal({diagonal_.data(), static_cast<std::size_t>(diagonal_.size())});
    exponent_ = exponent_of(diagonal_);
    const double unit = std::ldexp(1.0, -exponent_);
    for_blocks(of_p, [&](int r, int c, std::int64_t k) { add(unit, original.H, k, r, c, r, c); });
    M_.diagonal({diagonal_.data(), static_cast<std::size_t>(diagonal_.size())});
    for_blocks(of_q, [&](int r, int c, std::int64_t k) {
      add(-unit, sparse.H, k, r, c, partner[r], partner[c]);
    });
    for (const std::int32_t block : partner) {
      for (auto k = structure_.offsets()[block]; k < structure_.offsets()[block + 1]; ++k)
        kept_.push_back(k);
    }
  }

  /// Coordinates of the kept nodes.
  const std::vector<Eigen::Index>& kept() const { return kept_; }
  Eigen::Index size() const { return structure_.size(); }
  const BlockStructure& structure() const { return structure_; }
  /// Largest diagonal entry of H, in units of 2^exponent.
  double scale() const { return diagonal_.maxCoeff(); }
  int exponent() const { return exponent_; }
  BlockMatrix shifted(double s) const {
    BlockMatrix shifted = M_;
    Vector diagonal(size());
    const std::span<double> view(diagonal.data(), static_cast<std::size_t>(diagonal.size()));
    shifted.diagonal(view);
    for (const Eigen::Index k : kept_) diagonal[k] += s;
    shifted.set_diagonal(view);
    return shifted;
  }

 private:
  template <class Visit>
  static void for_blocks(const BlockStructure& structure, const Visit& visit) {
    for (int c = 0; c < structure.blocks(); ++c) {
      for (auto k = structure.column_begin()[c]; k < structure.column_begin()[c + 1]; ++k)
        visit(structure.rows()[k], c, k);
    }
  }
  /// Adds a multiple of entry k of H, which is at (r, c) there, at (row, column).
  void add(double factor, const BlockMatrix& H, std::int64_t k, int r, int c, std::int32_t row,
           std::int32_t column) {
    const ConstBlock value(H.block(k), H.structure().block_size(r), H.structure().block_size(c));
    Block to(M_.block(structure_.find(std::max(row, column), std::min(row, column))),
             structure_.block_size(std::max(row, column)),
             structure_.block_size(std::min(row, column)));
    if (row >= column) {
      to += factor * value;
    } else {
      to += factor * value.transpose();
    }
  }

  BlockStructure structure_;
  BlockMatrix M_;
  Vector diagonal_;
  int exponent_ = 0;
  std::vector<Eigen::Index> kept_;
};

/// The largest eigenvalue of a positive definite matrix by Lanczos' recursion. Vectors are not
/// kept: lost orthogonality repeats eigenvalues and adds none, but it may take more than `n` steps
/// then.
double largest_eigenvalue(Eigen::Index n, const std::function<Vector(const Vector&)>& multiply) {
  std::vector<double> diagonal, beside;
  Vector before = Vector::Zero(n), v(n);
  for (Eigen::Index k = 0; k < n; ++k)
    v[k] = 1.0 + 0.5 * std::sin(1.0 + 1.7 * static_cast<double>(k));
  v.normalize();
  for (int k = 1;; ++k) {
    Vector w = multiply(v);
    diagonal.push_back(v.dot(w));
    w -= diagonal.back() * v;
    if (k > 1) w -= beside.back() * before;
    const double next = w.norm();
    // Eigen's iteration would not end.
    if (!std::isfinite(next) || !std::isfinite(diagonal.back()))
      throw Error(ErrorCode::numerical, "Lanczos' method met a number that is not finite");
    const bool last = k == kLanczosSteps || next == 0.0;
    if (last || k == n || k % 10 == 0) {
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> ritz;
      ritz.computeFromTridiagonal(Eigen::Map<const Vector>(diagonal.data(), k),
                                  Eigen::Map<const Vector>(beside.data(), k - 1));
      const double largest = ritz.eigenvalues()[k - 1];
      const double residual = next * std::abs(ritz.eigenvectors()(k - 1, k - 1));
      if (residual <= kAccuracy * largest || next == 0.0) return largest;
      if (last) {
        if (residual <= kAcceptable * largest) return largest;
        throw Error(ErrorCode::numerical,
                    fmt::format("Lanczos' method has not converged in {} steps", kLanczosSteps));
      }
    }
    beside.push_back(next);
    before = std::exchange(v, w / next);
  }
}

}  // namespace

double least_eigenvalue_of_difference(const Graph& p, const Graph& q, const std::vector<int>& at,
                                      LinearSolver& solver) {
  const Difference difference(p, q, at);
  const std::vector<Eigen::Index>& kept = difference.kept();
  if (kept.empty()) return 0.0;
  solver.analyze(difference.structure());
  double s = kShift * difference.scale();
  for (int tries = 0; !solver.factorize(difference.shifted(s)).ok; ++tries, s *= kGrowth) {
    if (tries == kShifts) {
      throw Error(ErrorCode::numerical,
                  "the nodes that were taken out are not determined by the original graph");
    }
  }
  Vector x(difference.size());
  const double largest = largest_eigenvalue(std::ssize(kept), [&](const Vector& v) {
    x.setZero();
    x(kept) = v;
    const std::span<double> view(x.data(), static_cast<std::size_t>(x.size()));
    solver.solve(view, view);
    return Vector(x(kept));
  });
  return std::ldexp(1.0 / largest - s, difference.exponent());
}

}  // namespace cairn
