// SPDX-License-Identifier: BSD-3-Clause
// Covariances that somebody asks for.
#include <algorithm>
#include <vector>

#include <Eigen/Core>

#include "cairn/linear/graph_marginals.hpp"
#include "dense/products.hpp"
#include "engine.hpp"

namespace cairn::incremental {
namespace {

/// What part of all variables are few rows. A path is much shorter than the tree, but the paths of
/// many rows are most of it.
constexpr std::int64_t kFewRows = 8;

}  // namespace

/// Σ_ab in the variables' frames becomes T_a Σ_ab T_bᵀ: as seen from the poses.
void Engine::as_seen_from(int a, int b, double* block, std::int64_t stride) const {
  const std::int32_t rows = system_.size(a), columns = system_.size(b);
  using Block = Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
  Block sigma(block, rows, columns, Eigen::OuterStride<>(stride));
  std::vector<double> x, T;
  const auto turn = [&](int v, std::int32_t size) {
    T.resize(static_cast<std::size_t>(size) * size);
    states_.frame_to_body(v, x.data(), T.data());
    return Eigen::Map<const Eigen::MatrixXd>(T.data(), size, size);
  };
  const auto away = [&](int v) {
    x.resize(static_cast<std::size_t>(states_.ambient(v)));
    if (tree_.read(v, x.data())) return true;
    std::copy_n(states_.x(v), x.size(), x.begin());
    return states_.away(v);
  };
  if (away(a)) sigma = dense::product(turn(a, rows), sigma);
  if (away(b)) sigma = dense::product_with_transpose(sigma, turn(b, columns));
}

bool Engine::have_digits(int v, std::int32_t first, std::int32_t count, const double* variances,
                         std::int64_t step) const {
  const double* H = system_.diagonal(v);
  const std::int32_t next = system_.size(v) + 1;
  for (std::int32_t k = 0; k < count; ++k) {
    if (variances[k * step] * H[(first + k) * next] > kFewestDigits) return false;
  }
  return true;
}

bool Engine::covariance(int a, int b, double* block) {
  const std::int32_t rows = system_.size(a), columns = system_.size(b);
  if (const double* kept = covariances_.kept(a, b); kept && !broken_) {
    const double* own = a == b ? kept : covariances_.kept(b, b);
    if (own && !have_digits(b, 0, columns, own, columns + 1)) return false;
    std::copy_n(kept, rows * columns, block);
    as_seen_from(a, b, block, rows);
    return true;
  }
  const std::int32_t row = a;
  return covariance_column({&row, 1}, b, block);
}

bool Engine::covariance_column(std::span<const std::int32_t> rows, int b, double* column) {
  std::int64_t height = 0;
  for (const std::int32_t v : rows) height += system_.size(v);
  const std::int32_t columns = system_.size(b);
  std::fill_n(column, height * columns, 0.0);
  if (held_[b]) return true;
  if (broken_ || tree_.node_of(b) < 0) return false;
  AlignedVector X(static_cast<std::size_t>(system_.scalars()) * 8);
  // Few rows are solved for along their paths alone.
  const bool few = std::ssize(rows) * kFewRows <= system_.variables();
  std::vector<std::int32_t> sources{b};
  for (const std::int32_t v : rows) {
    if (few && !held_[v]) sources.push_back(v);
  }
  for (std::int32_t first = 0; first < columns; first += 8) {
    const std::int32_t width = std::min(8, columns - first);
    std::ranges::fill(X, 0.0);
    for (std::int32_t k = 0; k < width; ++k)
      X[static_cast<std::size_t>(system_.offset(b) + first + k) * 8 + k] = 1.0;
    if (few) {
      tree_.solve_many_above(sources, X);
    } else {
      tree_.solve_many(sources, X);
    }
    const double* own = X.data() + static_cast<std::size_t>(system_.offset(b) + first) * 8;
    if (!have_digits(b, first, width, own, 8 + 1)) return false;
    double* out = column + std::int64_t{first} * height;
    for (std::int32_t k = 0; k < width; ++k) {
      for (const std::int32_t v : rows) {
        for (std::int32_t r = 0; r < system_.size(v); ++r)
          *out++ = held_[v] ? 0.0 : X[static_cast<std::size_t>(system_.offset(v) + r) * 8 + k];
      }
    }
  }
  std::int64_t row = 0;
  for (const std::int32_t v : rows) {
    if (!held_[v]) as_seen_from(v, b, column + row, height);
    row += system_.size(v);
  }
  return true;
}

}  // namespace cairn::incremental
