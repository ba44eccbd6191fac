// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/linear/linear_solver.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// Ability of a linear solver: blocks of Σ = H⁻¹ of the last factorisation, on the blocks of the
/// analysed structure. Σ is the covariance of the step δ if H is that of whitened factors without
/// damping. Calls before a good factorisation, and results of another size than is said here, throw
/// `std::logic_error`.
class CAIRN_API Marginals {
 public:
  static constexpr std::string_view kAbility = "marginals";
  virtual ~Marginals();

  /// Every diagonal block Σ_ii: size_i × size_i doubles each, column-major, one after the other.
  virtual void diagonal_blocks(std::span<double> out) = 0;
  /// Σ(:, block): structure.size() × size of the block, column-major.
  virtual void block_column(int block, std::span<double> out) = 0;
  /// Σ_ij for each pair (i, j): size_i × size_j doubles, column-major, one after the other.
  virtual void blocks(std::span<const std::pair<std::int32_t, std::int32_t>> pairs,
                      std::span<double> out) = 0;
};

/// `Marginals` by solves with columns of the identity, H X = [e_i e_j …]: what any solver can that
/// solves exactly. n scalars of diagonal blocks take n solves, eight at a time where the solver has
/// the ability `ManyRightHandSides`. The solver holds one of these and returns it as its ability;
/// one with a better method overrides the function concerned.
class CAIRN_API SolvedMarginals : public Marginals {
 public:
  /// `solver` must outlive this object.
  explicit SolvedMarginals(LinearSolver& solver) : solver_(&solver) {}
  ~SolvedMarginals() override;

  /// To be called by the solver's own `analyze`: the sizes of the blocks.
  void analyze(std::span<const std::int32_t> sizes);

  void diagonal_blocks(std::span<double> out) override;
  void block_column(int block, std::span<double> out) override;
  void blocks(std::span<const std::pair<std::int32_t, std::int32_t>> pairs,
              std::span<double> out) override;

 protected:
  /// X = H⁻¹ [e_i, e_j, …] for the scalar rows i, j, …: size × their number, column-major.
  virtual void columns(std::span<const std::int64_t> scalars, std::span<double> X);

  std::span<const std::int32_t> sizes() const { return sizes_; }
  std::int64_t size() const { return offsets_.empty() ? 0 : offsets_.back(); }
  /// Doubles of the block (i, j).
  std::int64_t values(std::int32_t i, std::int32_t j) const {
    return std::int64_t{sizes_[i]} * sizes_[j];
  }
  /// Of those pairs, how many scalar columns of Σ their blocks lie in at least.
  std::int64_t columns_of(std::span<const std::pair<std::int32_t, std::int32_t>> pairs) const;

 private:
  struct Wanted {
    std::int32_t row, column;  ///< blocks
    bool transpose;            ///< requested as the transposed block
    std::int64_t target;       ///< where it goes
  };
  void fetch(std::vector<Wanted>& wanted, std::span<double> out);
  bool by_first(std::span<const std::pair<std::int32_t, std::int32_t>> pairs) const;

  LinearSolver* solver_;
  std::vector<std::int32_t> sizes_;
  std::vector<std::int64_t> offsets_;
  std::vector<double> X_;
};

}  // namespace cairn
