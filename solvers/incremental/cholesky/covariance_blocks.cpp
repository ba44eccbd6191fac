// SPDX-License-Identifier: BSD-3-Clause
#include "covariance_blocks.hpp"

#include <algorithm>
#include <vector>

#include <Eigen/Core>

#include "cairn/linear/graph_marginals.hpp"
#include "dense/products.hpp"

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

/// From a variable's frame to the pose itself.
class FrameTurn {
 public:
  explicit FrameTurn(const Problem& problem) : problem_(problem) {}

  /// Whether the variable has moved since its frame was put down; else both are the same.
  bool find(int v) {
    const States& states = problem_.states;
    size_ = problem_.system.size(v);
    x_.resize(static_cast<std::size_t>(states.ambient(v)));
    if (!problem_.motions.read(problem_.tree, states, v, x_.data())) {
      if (!states.away(v)) return false;
      std::copy_n(states.x(v), x_.size(), x_.begin());
    }
    T_.resize(static_cast<std::size_t>(size_) * size_);
    states.frame_to_body(v, x_.data(), T_.data());
    return true;
  }
  std::span<const double> matrix() const { return T_; }
  int size() const { return size_; }

 private:
  const Problem& problem_;
  int size_ = 0;
  std::vector<double> x_, T_;
};

/// Σ_ab in the variables' frames, one block below the other for each a, becomes T_a Σ_ab T_bᵀ: as
/// seen from the poses.
void turn_blocks(const Problem& problem, std::span<const std::int32_t> rows, int b, double* blocks,
                 std::int64_t stride) {
  const System& system = problem.system;
  using Block = Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
  FrameTurn of_row(problem), of_column(problem);
  const bool turns_column = of_column.find(b);
  for (const std::int32_t v : rows) {
    Block block(blocks, system.size(v), system.size(b), Eigen::OuterStride<>(stride));
    blocks += block.rows();
    if (problem.held(v)) continue;
    if (of_row.find(v)) turn_block<false>(of_row.matrix(), of_row.size(), block);
    if (turns_column) turn_block<true>(of_column.matrix(), of_column.size(), block);
  }
}

/// Whether variances of v, in its frame, have digits (`kFewestDigits`): those of its unknowns from
/// `first` on, `step` doubles apart.
bool have_digits(const System& system, int v, std::int32_t first, std::int32_t count,
                 const double* variances, std::int64_t step) {
  const double* H = system.diagonal(v);
  const std::int32_t next = system.size(v) + 1;
  for (std::int32_t k = 0; k < count; ++k) {
    if (variances[k * step] * H[(first + k) * next] > kFewestDigits) return false;
  }
  return true;
}

}  // namespace

bool covariance(Problem& problem, int a, int b, double* block) {
  const System& system = problem.system;
  const std::int32_t row = a, rows = system.size(a), columns = system.size(b);
  if (const double* kept = problem.covariances.kept(a, b)) {
    const double* own = a == b ? kept : problem.covariances.kept(b, b);
    if (own && !have_digits(system, b, 0, columns, own, columns + 1)) return false;
    std::copy_n(kept, rows * columns, block);
    turn_blocks(problem, {&row, 1}, b, block, rows);
    return true;
  }
  return covariance_column(problem, {&row, 1}, b, block);
}

bool covariance_column(Problem& problem, std::span<const std::int32_t> rows, int b,
                       double* column) {
  const System& system = problem.system;
  const Tree& tree = problem.tree;
  std::int64_t height = 0;
  for (const std::int32_t v : rows) height += system.size(v);
  const std::int32_t columns = system.size(b);
  std::fill_n(column, height * columns, 0.0);
  if (problem.held(b)) return true;
  if (tree.node_of(b) < 0) return false;
  AlignedVector X(static_cast<std::size_t>(system.scalars()) * 8);
  // Few rows are solved for along their paths alone.
  const bool few = std::ssize(rows) * kFewRows <= system.variables();
  std::vector<std::int32_t> sources{b};
  for (const std::int32_t v : rows) {
    if (few && !problem.held(v)) sources.push_back(v);
  }
  for (std::int32_t first = 0; first < columns; first += 8) {
    const std::int32_t width = std::min(8, columns - first);
    std::ranges::fill(X, 0.0);
    for (std::int32_t k = 0; k < width; ++k)
      X[static_cast<std::size_t>(system.offset(b) + first + k) * 8 + k] = 1.0;
    if (few) {
      problem.substitution.solve_many_above(system, tree, sources, X);
    } else {
      problem.substitution.solve_many(system, tree, sources, X);
    }
    const double* own = X.data() + static_cast<std::size_t>(system.offset(b) + first) * 8;
    if (!have_digits(system, b, first, width, own, 8 + 1)) return false;
    double* out = column + std::int64_t{first} * height;
    for (std::int32_t k = 0; k < width; ++k) {
      for (const std::int32_t v : rows) {
        for (std::int32_t r = 0; r < system.size(v); ++r)
          *out++ =
              problem.held(v) ? 0.0 : X[static_cast<std::size_t>(system.offset(v) + r) * 8 + k];
      }
    }
  }
  turn_blocks(problem, rows, b, column, height);
  return true;
}

}  // namespace cairn::incremental
