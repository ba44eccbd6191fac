// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "block/kernels.hpp"
#include "block/symbolic.hpp"
#include "cairn/aligned.hpp"
#include "cairn/block_matrix.hpp"
#include "cairn/linear_solver.hpp"

namespace cairn::block {

/// Multifrontal supernodal Cholesky factorisation P H Pᵀ = L Lᵀ of a block matrix.
///
/// Supernodes are worked off in postorder: the entries of H and the children's update matrices are
/// added into the front, the panel is factored, and what remains is the update matrix for the
/// parent. All index lists are made once a structure
/// (`analyze`); a factorisation allocates nothing. Subtrees run in parallel, and so do the tiles of
/// large fronts; what is added to what, and in which order, does not depend on the number of
/// threads, so neither does the result.
class SupernodalCholesky {
 public:
  /// `kernels`: auto, portable, avx2 or avx512. Throws `Error` (usage) for what the machine cannot
  /// run.
  explicit SupernodalCholesky(std::string_view kernels = "auto");

  /// `ordering`: one of `ordering_names()`, or auto: each of them but natural, and the one with the
  /// fewest flops.
  void analyze(const BlockStructure& structure, std::string_view ordering,
               const CostModel& cost = {});
  /// The ordering that is in use.
  const std::string& ordering() const { return ordering_; }
  Factorization factorize(const BlockMatrix& H);
  /// x = H⁻¹ g; x may be g.
  void solve(std::span<const double> g, std::span<double> x);
  double log_determinant() const;

  const Symbolic& symbolic() const { return symbolic_; }
  std::span<const double> panels() const { return panels_; }
  std::string_view kernel_set() const { return kernels_->name; }

 private:
  /// Supernodes [begin, end) of a subtree that one task works off; its update matrices share a
  /// workspace, planned when analysing.
  struct Subtree {
    std::int32_t begin, end;
    double work = 0.0;
  };
  void plan_parallel();
  void plan_workspace();
  void factorize_supernode(const BlockMatrix& H, std::int32_t s, bool parallel_inside);
  void update(const Supernode& node, double* U, bool parallel_inside);

  const Kernels* kernels_;
  std::string ordering_;
  const BlockStructure* structure_ = nullptr;
  std::uint64_t version_ = 0;
  Symbolic symbolic_;
  AlignedVector panels_;
  AlignedVector workspace_;
  std::vector<std::int64_t> update_begin_;  // by supernode: its update matrix in the workspace
  std::vector<std::int32_t> failed_;        // by supernode: first failed column, -1 if none
  std::vector<Subtree> subtrees_;
  std::vector<std::int32_t> top_;  // supernodes above the subtrees, in postorder
  AlignedVector permuted_;
  AlignedVector front_vector_;
  bool factorized_ = false;
};

}  // namespace cairn::block
