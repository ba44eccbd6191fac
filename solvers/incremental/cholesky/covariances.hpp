// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "cairn/runtime/aligned.hpp"
#include "cairn/solve/estimator.hpp"
#include "models.hpp"
#include "substitution.hpp"
#include "system.hpp"
#include "tree.hpp"

namespace cairn::incremental {

/// The diagonal blocks of Σ = H⁻¹, and some others, while H changes.
///
/// H changes by a few factors at a time: H′ = H + Vᵀ S V, V being the Jacobians of the factors that
/// came (S = 1) and of those that went or were relinearised, as they were (S = −1). Then, with the
/// new factor of H′,
///
///     B = Σ′ Vᵀ,   U = S − V B,   Σ = Σ′ + B U⁻¹ Bᵀ   ⇒   Σ′_ij = Σ_ij − B_i U⁻¹ B_jᵀ
///
/// (IJRR 2017, equations 11 to 15, there for S = 1 and with the increment's sign turned). Variables
/// that are new are eliminated from V first, and their own blocks solved for. B takes a solution
/// for each row that is left, eight at a time. With L Lᵀ = H′ and Y = L⁻¹ Vᵀ, which is zero but on
/// the paths from the variables of V to the roots, U = S − Yᵀ Y is known half-way; it is
/// Q Λ Qᵀ, and what is substituted backwards is Y Q |Λ|^(−1/2), so that
///
///     C = L⁻ᵀ Y Q |Λ|^(−1/2),   Σ′_ii = Σ_ii − C_i sign(Λ) C_iᵀ.
///
/// A subtree that V does not touch is left out where that changes nothing: its variables v depend
/// on the rest by its separator s alone, C_v = Σ′_vs Σ′_ss⁻¹ C_s, so that
///
///     C_vᵀ Σ′_vv⁻¹ C_v ≤ C_sᵀ Σ′_ss⁻¹ C_s ≤ C_sᵀ H_ss C_s ≤ |s| Σ_i H_ii ‖C_i‖²  (i in s)
///
/// bounds what any variance in it changes by, as a part of itself. Where the rows are too many, or
/// U too badly conditioned, all blocks on the diagonal are recomputed by the recursion from the
/// roots of the tree down.
class Covariances {
 public:
  /// What changes: to be called before H does, for every factor that goes or is relinearised, and
  /// after, for every one that comes.
  void note(const Models& models, const System& system, int f, double sign,
            std::span<const std::uint8_t> held);
  /// Everything is new.
  void note_everything() { everything_ = true; }
  /// The same ones to be kept where variables are numbered anew: now[v], or -1 for one that is
  /// gone. Everything is new.
  Covariances renumbered(std::span<const std::int32_t> now) const;
  void note_variable(std::int32_t v) { fresh_.push_back(v); }
  void keep(KeptMarginals kept);
  void keep(std::int32_t a, std::int32_t b);
  /// Forgets the crosses of a variable.
  void drop(std::int32_t v);
  bool keeps_anything() const { return kept_ != KeptMarginals::none || !crosses_.empty(); }

  /// Updates everything from the tree.
  MarginalsBy update(const System& system, const Tree& tree, Substitution& substitution,
                     std::span<const std::uint8_t> held);
  /// A kept block, size_a × size_b, column-major; null if it is not kept.
  const double* kept(std::int32_t a, std::int32_t b) const;
  std::int64_t doubles() const;

 private:
  bool downdate(const System& system, const Tree& tree, Substitution& substitution,
                std::span<const std::uint8_t> held);
  bool take_out_fresh(const System& system, const Tree& tree);
  bool scale_rows(const System& system, const Tree& tree, const Substitution& substitution);
  template <int width>
  void apply(const System& system, const Tree& tree, Substitution& substitution, AlignedVector& C,
             const double* signs);
  void recompute(const System& system, const Tree& tree);
  void solve_for(const System& system, const Tree& tree, Substitution& substitution,
                 std::int32_t v);
  void solve_crosses(const System& system, const Tree& tree, Substitution& substitution,
                     std::span<const std::uint8_t> held);
  double* diagonal(std::int32_t v) { return diagonal_.data() + place_[v]; }
  AlignedVector& columns(const System& system, std::size_t group);

  struct Row {
    std::size_t begin, count;  // in entries_
    double sign;
  };
  struct Entry {
    std::int64_t scalar;
    double value;
  };

  KeptMarginals kept_ = KeptMarginals::none;
  bool everything_ = true;
  std::vector<std::int32_t> fresh_;
  std::vector<std::int32_t> sources_;  // variables that the rows touch
  std::vector<Row> rows_;
  std::vector<Entry> entries_;
  std::vector<std::int64_t> place_;  // by variable, in diagonal_
  std::vector<double> diagonal_;
  std::map<std::pair<std::int32_t, std::int32_t>, std::vector<double>> crosses_;
  std::vector<AlignedVector> B_;  // eight columns each, zero from one use to the next
  std::vector<std::int32_t> visited_;
  std::vector<double> signs_;  // of U's eigenvalues, and zeros up to a multiple of eight
  int age_ = 0;                // downdates since the last recomputation
};

}  // namespace cairn::incremental
