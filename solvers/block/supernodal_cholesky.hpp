// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "block/kernels.hpp"
#include "block/schedule.hpp"
#include "block/symbolic.hpp"
#include "cairn/linear/block_matrix.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/runtime/aligned.hpp"

namespace cairn::block {

/// Multifrontal supernodal Cholesky factorisation P H Pᵀ = L Lᵀ of a block matrix.
///
/// Supernodes are worked off from the leaves of the elimination tree to its roots: the entries of H
/// and the children's update matrices are added into the front, the panel is factored, and what
/// remains is the update matrix for the parent. All index lists are made once per structure
/// (`analyze`); after the first
/// factorisation, factorising and solving with one right-hand side allocate nothing. Subtrees run
/// in parallel, and so do the tiles of large fronts (`Schedule`); what is added to what, and in
/// which order, does not depend on the number of threads, so neither does the result.
class SupernodalCholesky {
 public:
  /// `kernels`: auto, portable, avx2 or avx512. Throws `Error` (usage) for what the machine cannot
  /// run.
  explicit SupernodalCholesky(std::string_view kernels = "auto");

  /// `ordering`: a name that `order` takes, or auto: see `choose`. Room is made for as many threads
  /// as `threads()` says now.
  void analyze(const BlockStructure& structure, std::string_view ordering,
               const CostModel& cost = {});
  /// The ordering that is in use.
  const std::string& ordering() const { return ordering_; }
  Factorization factorize(const BlockMatrix& H) { return factorize_in(H, double_); }
  /// The same in single precision, to which H is rounded: about half of the time and of the memory.
  /// Afterwards there is only `solve_single`, until the next `factorize`. The first factorisation
  /// in each precision allocates its memory.
  Factorization factorize_single(const BlockMatrix& H) { return factorize_in(H, single_); }
  /// x = H⁻¹ g; x may be g.
  void solve(std::span<const double> g, std::span<double> x);
  /// As `solve`, of a factorisation in single precision and in its arithmetic.
  void solve_single(std::span<const double> g, std::span<double> x);
  /// X = H⁻¹ G, both size × columns, column-major; X may be G. Eight columns cost little more than
  /// two single solves.
  void solve(std::span<const double> G, std::span<double> X, int columns);
  /// X = H⁻¹ [e_i, e_j, …] for scalar rows i, j, …, size × their number, column-major. Forward
  /// substitution visits only the supernodes between theirs and the root.
  void inverse_columns(std::span<const std::int64_t> scalars, std::span<double> X);
  double log_determinant() const;
  /// min L_jj / d_j of a factorisation in single precision, `d` being size() numbers: how close it
  /// came to a pivot that is not positive, if d_j² = H_jj.
  double smallest_single_pivot(std::span<const double> d) const;

  const Symbolic& symbolic() const { return symbolic_; }
  std::span<const double> panels() const { return double_.panels; }
  std::string_view kernel_set() const { return kernels_->name; }
  /// Numbers of panels and room for update matrices.
  std::int64_t numbers() const { return symbolic_.panel_values() + schedule_.placement.size; }

 private:
  friend class SelectedInverse;  // the same tree, panels and room, worked off backwards
  /// The numbers of a factorisation in one precision. There is no memory for those of a precision
  /// in which nothing was factorised.
  template <class Real>
  struct Numbers {
    using Array = std::vector<Real, UninitializedAllocator<Real>>;
    const FrontKernels<Real>* kernels = nullptr;
    Array panels, workspace;
    // For solving: rows of the permuted vector, then for each task the rows that its supernodes
    // update outside it (so tasks do not meet, and are added up in a fixed order); and a front for
    // each lane.
    std::vector<Real, AlignedAllocator<Real>> vectors, fronts;
    bool factorized = false;
  };

  void plan_solve();
  template <class Real>
  void make_room(Numbers<Real>& numbers) const;
  template <class Real>
  Factorization factorize_in(const BlockMatrix& H, Numbers<Real>& numbers);
  template <class Real>
  void factorize_supernode(const BlockMatrix& H, Numbers<Real>& numbers, std::int32_t s,
                           std::int64_t lane);
  template <class Real>
  void assemble(const BlockMatrix& H, Numbers<Real>& numbers, std::int32_t s, std::int64_t size);
  template <class Real>
  void add_to_panel(Numbers<Real>& numbers, std::int32_t s, std::int32_t c, std::int64_t lane,
                    int first, int last);
  template <class Real>
  void add_to_update(Numbers<Real>& numbers, std::int32_t s, std::int32_t c, std::int64_t lane,
                     int first, int last);
  template <class Real>
  void add_child(Numbers<Real>& numbers, std::int32_t c, std::int64_t lane, int first, int last,
                 Real* front, std::int64_t stride);
  template <class Real>
  void factor_pivots(Numbers<Real>& numbers, std::int32_t s, int first);
  template <class Real>
  void run_steps(const BlockMatrix& H, Numbers<Real>& numbers, std::int64_t lane);
  template <class Real>
  void run(const Step& step, const BlockMatrix& H, Numbers<Real>& numbers, std::int64_t lane);
  void wait_for(const Step& step);
  void signal(std::int32_t gate);
  template <class Real>
  Real* update_matrix(Numbers<Real>& numbers, std::int32_t s, std::int64_t lane) {
    return numbers.workspace.data() + schedule_.placement.of(s, lane);
  }
  template <class Real>
  void solve_in(Numbers<Real>& numbers, std::span<const double> g, std::span<double> x);
  /// Forward and backward substitution on the vectors, whose rows hold `width` numbers: 1, or 8 in
  /// double precision. With `marked`, forward only through the supernodes that are `on_path_`.
  template <class Real>
  void substitute(Numbers<Real>& numbers, int width, bool marked = false);
  void mark_path(std::int64_t row);

  const Kernels* kernels_;
  std::string ordering_;
  const BlockStructure* structure_ = nullptr;
  std::uint64_t version_ = 0;
  std::uint64_t analyses_ = 0;
  Symbolic symbolic_;
  Schedule schedule_;
  Numbers<double> double_;
  Numbers<float> single_;
  std::vector<std::int32_t> failed_;  // by supernode: first failed column, -1 if none
  std::vector<std::int32_t> gates_;   // of the schedule's steps: how often each was signalled
  std::atomic<std::int32_t> next_step_{0};

  // Solving.
  std::vector<Run> gathers_;                // where the rows below of a supernode are
  std::vector<std::int64_t> gather_begin_;  // by supernode
  std::vector<Run> outside_;                // source: in the permuted vector; target: the copy
  std::vector<std::pair<std::int64_t, std::int64_t>> outside_of_;  // by task, in `outside_`
  std::int64_t vector_rows_ = 0;
  std::int64_t front_rows_ = 0;
  std::vector<bool> on_path_;  // by supernode
};

}  // namespace cairn::block
