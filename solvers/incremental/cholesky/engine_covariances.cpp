// SPDX-License-Identifier: BSD-3-Clause
// Covariances that somebody asks for.
#include <algorithm>
#include <span>
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

/// B = T B, or with `transposed` B = B Tᵀ, for the sizes of poses without memory of its own.
template <bool transposed, int size>
void turn_by(const double* T, Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>& B) {
  const Eigen::Map<const Eigen::Matrix<double, size, size>> turn(T);
  const Eigen::Index others = transposed ? B.rows() : B.cols();
  Eigen::Matrix<double, size, 1> turned;
  for (Eigen::Index k = 0; k < others; ++k) {
    if constexpr (transposed) {
      turned.noalias() = turn * B.row(k).transpose();
      B.row(k) = turned.transpose();
    } else {
      turned.noalias() = turn * B.col(k);
      B.col(k) = turned;
    }
  }
}

template <bool transposed>
void turn_block(std::span<const double> T, int size,
                Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>& B) {
  if (size == 3) return turn_by<transposed, 3>(T.data(), B);
  if (size == 6) return turn_by<transposed, 6>(T.data(), B);
  const Eigen::Map<const Eigen::MatrixXd> turn(T.data(), size, size);
  if (transposed) {
    B = dense::product_with_transpose(B, turn);
  } else {
    B = dense::product(turn, B);
  }
}

}  // namespace

/// From a variable's frame to the pose itself.
class Engine::Turn {
 public:
  explicit Turn(const Engine& engine) : engine_(engine) {}

  /// Whether the variable has moved since its frame was put down; else both are the same.
  bool find(int v) {
    size_ = engine_.system_.size(v);
    x_.resize(static_cast<std::size_t>(engine_.states_.ambient(v)));
    if (!engine_.motions_.read(engine_.tree_, engine_.states_, v, x_.data())) {
      if (!engine_.states_.away(v)) return false;
      std::copy_n(engine_.states_.x(v), x_.size(), x_.begin());
    }
    T_.resize(static_cast<std::size_t>(size_) * size_);
    engine_.states_.frame_to_body(v, x_.data(), T_.data());
    return true;
  }
  std::span<const double> matrix() const { return T_; }
  int size() const { return size_; }

 private:
  const Engine& engine_;
  int size_ = 0;
  std::vector<double> x_, T_;
};

/// Σ_ab in the variables' frames, one block below the other for each a, becomes T_a Σ_ab T_bᵀ: as
/// seen from the poses.
void Engine::as_seen_from(std::span<const std::int32_t> rows, int b, double* blocks,
                          std::int64_t stride) const {
  using Block = Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
  Turn of_row(*this), of_column(*this);
  const bool turns_column = of_column.find(b);
  for (const std::int32_t v : rows) {
    Block block(blocks, system_.size(v), system_.size(b), Eigen::OuterStride<>(stride));
    blocks += block.rows();
    if (held_[v]) continue;
    if (of_row.find(v)) turn_block<false>(of_row.matrix(), of_row.size(), block);
    if (turns_column) turn_block<true>(of_column.matrix(), of_column.size(), block);
  }
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
  const std::int32_t row = a, rows = system_.size(a), columns = system_.size(b);
  if (const double* kept = covariances_.kept(a, b); kept && !broken_) {
    const double* own = a == b ? kept : covariances_.kept(b, b);
    if (own && !have_digits(b, 0, columns, own, columns + 1)) return false;
    std::copy_n(kept, rows * columns, block);
    as_seen_from({&row, 1}, b, block, rows);
    return true;
  }
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
      substitution_.solve_many_above(system_, tree_, sources, X);
    } else {
      substitution_.solve_many(system_, tree_, sources, X);
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
  as_seen_from(rows, b, column, height);
  return true;
}

}  // namespace cairn::incremental
